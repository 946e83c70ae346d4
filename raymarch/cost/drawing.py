"""Settings drawn: over several frames, and at another resolution than the picture's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from time import perf_counter
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.settings import Setting
from raymarch.gpu.renderer import Renderer
from raymarch.scene.scene import Scene


class Drawn(Protocol):
    """What is needed of a frame."""

    @property
    def timings(self) -> Any: ...
    @property
    def milliseconds(self) -> float: ...
    def array(self, name: str) -> NDArray[Any]: ...


class Draws(Protocol):
    """What is needed of a renderer; a `raymarch.Renderer` is one."""

    kept: int
    clock: Any
    context: Any

    def forget(self) -> None: ...
    def render(
        self, scene: Scene, time: float = ..., params: Mapping[str, Any] | None = ..., outputs: Sequence[str] = ...
    ) -> Drawn: ...


class Renderers:
    """A renderer for each resolution, all on one context; use it with `with`.

    given : an open one of the picture's size, which is left open.
    """

    def __init__(self, given: Draws, size: tuple[int, int]) -> None:
        self._given, self._size = given, size
        self._others: dict[tuple[int, int], Renderer] = {}
        self._stack = ExitStack()

    def of(self, setting: Setting) -> Draws:
        """The one that draws a setting."""
        size = setting.size(self._size)
        if size == self._size:
            return self._given
        if size not in self._others:
            made = self._stack.enter_context(Renderer(size, context=self._given.context))
            made.kept = self._given.kept
            self._others[size] = made
        return self._others[size]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *fault: Any) -> None:
        self._stack.close()


def draw(
    scene: Scene,
    setting: Setting,
    renderer: Draws,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    outputs: Sequence[str] = ("color",),
) -> tuple[Drawn, list[Drawn]]:
    """The last of a setting's frames, and all of them."""
    made = setting.of(scene)
    if setting.frames > 1:
        renderer.forget()
    frames = [renderer.render(made, time, params, outputs) for _ in range(setting.frames)]
    return frames[-1], frames


def timed(
    scene: Scene,
    setting: Setting,
    renderer: Draws,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    output: str = "color",
) -> tuple[float, float]:
    """Milliseconds of one picture: by the renderer's clock, and what passed on the wall clock while it was drawn."""
    start = perf_counter()
    claimed = sum(frame.milliseconds for frame in draw(scene, setting, renderer, time, params, (output,))[1])
    return claimed, 1e3 * (perf_counter() - start)


def brought_to(values: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """A picture (H, W, 3) brought to a size (width, height): linear interpolation, or, where pixels are many for one,
    a mean by a tent over them."""
    height, width = values.shape[:2]
    if (width, height) == size:
        return values
    rows, columns = _tents(height, size[1]), _tents(width, size[0])
    result: NDArray[Any] = np.einsum("ij,jkc,lk->ilc", rows, values, columns, optimize=True).astype(values.dtype)
    return result


def nearest(values: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Values (H, W, ...) at the middles of another size's pixels, each the nearest: depths are not to be mixed."""
    height, width = values.shape[:2]
    if (width, height) == size:
        return values
    row = ((np.arange(size[1]) + 0.5) * height / size[1]).astype(int)
    column = ((np.arange(size[0]) + 0.5) * width / size[0]).astype(int)
    result: NDArray[Any] = values[row[:, None], column]
    return result


def _tents(given: int, wanted: int) -> NDArray[np.float64]:
    """Weights of `given` pixels for each of `wanted`, (wanted, given)."""
    middle = (np.arange(wanted) + 0.5) * given / wanted - 0.5
    apart = np.abs(np.clip(middle, 0, given - 1)[:, None] - np.arange(given)) / max(1.0, given / wanted)
    weights = np.maximum(1.0 - apart, 0.0)
    result: NDArray[np.float64] = weights / weights.sum(axis=1, keepdims=True)
    return result
