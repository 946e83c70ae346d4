"""What a hard case is, what it measures, and what it is measured with."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu import Frame, Renderer
from raymarch.gpu.context import Context, open_context
from tests.support.analytic import EPSILON, ULP, View

GEOMETRY = ("depth", "normal", "material", "iterations", "evaluations")


class Figure(NamedTuple):
    """A quantity of a case, what was measured, the most that it may be, and what that limit follows from."""

    quantity: str
    measured: float
    limit: float
    because: str

    @property
    def holds(self) -> bool:
        return bool(self.measured <= self.limit)  # NaN does not hold


@dataclass(frozen=True)
class Case:
    """A row of the table: its number, its name, what it looked like before it was mended, and its measurement."""

    row: int
    name: str
    before: str
    measure: Callable[[World], Iterator[Figure]]

    @property
    def id(self) -> str:
        return f"{self.row:02d}-{self.name.replace(' ', '-').replace(',', '')}"

    @property
    def wrong(self) -> str:
        """What goes wrong, and what is done about it: the docstring."""
        return " ".join((self.measure.__doc__ or "").split())


CASES: list[Case] = []


def case(
    row: int, name: str, before: str = ""
) -> Callable[[Callable[[World], Iterator[Figure]]], Callable[[World], Iterator[Figure]]]:
    """Enter a measurement as the case of a row."""

    def enter(measure: Callable[[World], Iterator[Figure]]) -> Callable[[World], Iterator[Figure]]:
        CASES.append(Case(row, name, before, measure))
        return measure

    return enter


class World:
    """A renderer on EGL, which a case may use as it likes."""

    tracer = "auto"
    """The tracer of scenes that state none."""

    def __init__(self, context: Context | None = None) -> None:
        self._owns = context is None
        self.context = open_context("egl") if context is None else context
        self.renderer = Renderer((64, 48), context=self.context)
        self.digest = 0
        """Of all frames drawn so far, bit for bit."""

    def draw(
        self, scene: rm.Scene, size: tuple[int, int] = (64, 48), outputs: Sequence[str] = GEOMETRY, **how: Any
    ) -> Frame:
        """A frame of a scene with some arrays, as if nothing had been drawn before.

        No lights are rows because they came and went: a compiler adds products of those in another order.
        """
        if self.renderer.size != size:
            self.renderer.resize(size)
        self.renderer.forget()
        if scene.quality.tracer == "auto" and not scene.quality.shortened:
            scene = scene.replace(quality=scene.quality.replace(tracer=self.tracer))
        with self.renderer.resources.scenes_apart():
            frame = self.renderer.render(scene, outputs=outputs, **how)
        for name in outputs:
            self.digest = zlib.crc32(frame.array(name).tobytes(), self.digest)
        return frame

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.renderer.close()
        if self._owns:
            self.context.release()


# What many cases measure


def refusals(
    *calls: tuple[Callable[[], Any], Sequence[str]], what: str = "illegal calls that are not refused with their reason"
) -> Figure:
    """Calls that must be refused with words in the message: what, the value, the legal range, and the caller's line."""
    wrong = 0
    for call, words in calls:
        try:
            call()
        except RaymarchError as error:
            wrong += not all(word in str(error) for word in (*words, ".py:"))
        else:
            wrong += 1
    return Figure(f"{what}, of {len(calls)}", wrong, 0, "no such value is meaningful")


def view_of(
    position: Any, target: Any, fov: float = 40.0, size: tuple[int, int] = (64, 48), up: Any = (0, 1, 0)
) -> View:
    return View(position, target, fov, size, up)


def off(depth: NDArray[Any], view: View, t: NDArray[Any], cosine: NDArray[Any], where: NDArray[Any]) -> float:
    """The largest error of a depth over what an epsilon allows there: epsilon / cosine, and rounding."""
    allowed = EPSILON * view.pixel * t[where] / np.abs(cosine[where]) + 8 * ULP * (t[where] + np.abs(view.origin).max())
    return float(np.max(np.abs(depth[where] - t[where]) / allowed, initial=0.0))


def bytes_off(a: Frame, b: Frame, where: NDArray[Any] | None = None) -> int:
    """The largest difference of two pictures in steps of 8 bits."""
    apart = np.abs(np.asarray(a.image(), int) - np.asarray(b.image(), int)).max(axis=-1)
    return int(apart.max() if where is None else np.max(apart[where], initial=0))


def steepest(node: rm.Node, seed: int = 3, count: int = 4000) -> float:
    """The largest slope of a field between points near and far, over what the node promises."""
    from tests.support.node_samples import Field

    field, random = Field(node), np.random.default_rng(seed)
    points = field.draw(random, count)
    values = field.value(points)
    steps = random.normal(size=points.shape)
    steps *= (field.size * 10 ** random.uniform(-5, -0.3, count) / np.linalg.norm(steps, axis=1))[:, None]
    found = 0.0
    for other, there in ((points[::-1], values[::-1]), (points + steps, field.value(points + steps))):
        far = np.linalg.norm(other - points, axis=1)
        found = max(found, float(np.max(np.abs(there - values) / np.maximum(far, 1e-9))))
    return found / node.lipschitz
