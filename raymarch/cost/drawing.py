"""Render settings over several frames, and at other resolutions than that of the picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from time import perf_counter
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.settings import Setting
from raymarch.gpu.frame import Frame
from raymarch.gpu.renderer import Renderer
from raymarch.scene.scene import Scene


class Renderers:
    """A renderer for each resolution, all on one context; use it with `with`.

    given : an open renderer of the picture's size; it stays open.
    """

    def __init__(self, given: Renderer, size: tuple[int, int]) -> None:
        self._given, self._size = given, size
        self._others: dict[tuple[int, int], Renderer] = {}
        self._stack = ExitStack()

    def of(self, setting: Setting) -> Renderer:
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
    renderer: Renderer,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    outputs: Sequence[str] = ("color",),
) -> list[Frame]:
    made = setting.of(scene)
    if setting.frames > 1:
        renderer.forget()
    return [renderer.render(made, time, params, outputs) for _ in range(setting.frames)]


def timed(
    scene: Scene,
    setting: Setting,
    renderer: Renderer,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    output: str = "color",
) -> tuple[float, float]:
    """Milliseconds of one picture, by the renderer's clock and by the wall clock."""
    start = perf_counter()
    claimed = sum(frame.milliseconds for frame in draw(scene, setting, renderer, time, params, (output,)))
    return claimed, 1e3 * (perf_counter() - start)


def brought_to(values: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Resample a picture (H, W, 3) to a size (width, height): linear interpolation to enlarge, a tent filter to
    reduce."""
    height, width = values.shape[:2]
    if (width, height) == size:
        return values
    rows, columns = _tents(height, size[1]), _tents(width, size[0])
    result: NDArray[Any] = np.einsum("ij,jkc,lk->ilc", rows, values, columns, optimize=True).astype(values.dtype)
    return result


def nearest(values: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Resample values (H, W, ...) by nearest neighbour: depths must not be averaged."""
    height, width = values.shape[:2]
    if (width, height) == size:
        return values
    row = ((np.arange(size[1]) + 0.5) * height / size[1]).astype(int)
    column = ((np.arange(size[0]) + 0.5) * width / size[0]).astype(int)
    result: NDArray[Any] = values[row[:, None], column]
    return result


def _tents(given: int, wanted: int) -> NDArray[np.float64]:
    """Filter weights of the `given` pixels for each of the `wanted` ones, (wanted, given)."""
    middle = (np.arange(wanted) + 0.5) * given / wanted - 0.5
    apart = np.abs(np.clip(middle, 0, given - 1)[:, None] - np.arange(given)) / max(1.0, given / wanted)
    weights = np.maximum(1.0 - apart, 0.0)
    result: NDArray[np.float64] = weights / weights.sum(axis=1, keepdims=True)
    return result
