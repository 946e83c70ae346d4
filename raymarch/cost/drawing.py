"""Render settings over several frames, and at other resolutions than that of the picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from time import perf_counter, process_time
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.settings import Setting
from raymarch.gpu.frame import Frame
from raymarch.gpu.renderer import Renderer
from raymarch.scene.scene import Scene


class Spent(NamedTuple):
    """Milliseconds of a picture: drawing by the renderer's clock, all of it by the wall clock, and all of it by that
    clock: with the work of Python before and between."""

    drawing: float
    wall: float
    whole: float


@contextmanager
def by_cpu_time(renderer: Renderer) -> Iterator[None]:
    """Frames of a driver that renders on the CPU are timed by CPU time, which other programs hardly change."""
    before, renderer.clock.by_cpu = renderer.clock.by_cpu, True
    try:
        yield
    finally:
        renderer.clock.by_cpu = before


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
            made.kept, made.clock.by_cpu = self._given.kept, self._given.clock.by_cpu
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
) -> Spent:
    """The time of one picture."""
    start, before = perf_counter(), process_time()
    claimed = sum(frame.milliseconds for frame in draw(scene, setting, renderer, time, params, (output,)))
    wall, cpu = 1e3 * (perf_counter() - start), 1e3 * (process_time() - before)
    return Spent(claimed, wall, cpu if renderer.clock.kind == "CPU time" else wall)


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
