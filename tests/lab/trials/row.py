"""What a row of trials is, and what several rows need."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm

Array = NDArray[Any]
WHITE = rm.Material((1, 1, 1), specular=0.0, ambient=0.0)


@dataclass(frozen=True)
class Figure:
    """What is measured, the figure when it was found wrong, the figure now, and the most that is right."""

    what: str
    then: str
    now: float
    bar: float

    @property
    def right(self) -> bool:
        return bool(self.now <= self.bar)


Row = Callable[[], Iterator[Figure]]


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Without warnings and printed lines."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield


def refused(make: Callable[[], Any]) -> str:
    """The message by which a call is refused, or nothing."""
    try:
        make()
    except Exception as fault:
        return str(fault) or type(fault).__name__
    return ""


def crossing(inside: Callable[[Array], NDArray[np.bool_]], start: Array, way: Array, far: float) -> Array:
    """How far from points within a solid, along unit directions, its surface lies, by bisection: (N,)."""
    low, high = np.zeros(len(start)), np.full(len(start), far)
    for _ in range(48):
        middle = 0.5 * (low + high)
        held = inside(start + middle[:, None] * way)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    return 0.5 * (low + high)


def looking_down(height: float, at: tuple[float, float, float] = (0, 5, 0)) -> rm.Camera:
    """A camera above a point, without perspective, with x to the right and z to the bottom of the picture."""
    return rm.Camera(at, (at[0], 0, at[2]), up=(0, 0, -1), projection="orthographic", height=height)


def pixels(height: float, size: tuple[int, int], at: tuple[float, float] = (0.0, 0.0)) -> tuple[Array, Array]:
    """x and z of the pixels of `looking_down`, each (H, W)."""
    step = height / size[1]
    x = (np.arange(size[0]) + 0.5 - size[0] / 2) * step + at[0]
    z = (np.arange(size[1]) + 0.5 - size[1] / 2) * step + at[1]
    return tuple(np.meshgrid(x, z))  # type: ignore[return-value]


def drawn(scene: rm.Scene, size: tuple[int, int], **given: Any) -> rm.Frame:
    """A frame, with depths."""
    with quiet(), rm.Renderer(size=size) as renderer:
        return renderer.render(scene, outputs=("color", "depth"), **given)
