"""Seeded faults of shader, march and picture, with the proof of the right scene as their judge.

python -m tests.lab.proof_faults [--size 96x54] [--within 0.05px] [--each 6]

Each fault is drawn in six scenes. One that moves no hit by more than the tolerance is none in that scene, and one that
moves hits on grazing rays alone is told from the others.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch import glsl
from raymarch.expr.glsl import Dialect
from raymarch.expr.templates import Template
from raymarch.scene.file import load
from raymarch.scene.parameter import set_values

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENES = ("hello", "columns", "csg", "plates", "smoothing", "primitives")
LOOP = "march/loop"
VALUE = "float next = march_distance(ray, t);"

MARCH = {
    "a step too long": (
        ("return leap_pixels * u_pixel;", "return 200.0 * u_pixel;"),
        ("Way(step_length(at, far), -1.0, 0.0);", "Way(1.5 * at.r + 0.01, -1.0, 0.0);"),
        (VALUE, "float next = 1.02 * march_distance(ray, t) - 0.004;"),
        (VALUE, "float next = march_distance(ray, t) + 0.01;"),
    ),
    "a hit moved": (
        ("at.t + last_step(widths, at)", "at.t * (1.0 + 0.2 * u_pixel)"),
        ("at.t + last_step(widths, at)", "at.t * (1.0 - 0.2 * u_pixel)"),
        ("refined(widths, t, next, derivative)", "next > 0.0"),
        (VALUE, "float next = march_distance(ray, t) - 0.01;"),
        ("bool near = empty && next < (last.refining ? abs(last.r) :", "bool near = next < (last.refining ? 1.0e30 :"),
    ),
    "a hit lost": (("hit.found = found;", "hit.found = found && fract(97.0 * hit.t) > 0.05;"),),
}
"""Lines of the march in a spoiled form."""

NONE = "no fault here"
"""The verdict about a fault that moves no hit by more than the tolerance."""

MOVED = 1.25
"""Tolerances by which a hit is moved: that of the right picture is itself off by up to a quarter of one."""

Depth = NDArray[np.float64]
Draw = Callable[[rm.Scene, tuple[int, int]], Depth]


def _first(_printer: Any, _node: Any, pieces: Sequence[Any]) -> Any:
    return pieces[0]


def _as(op: str) -> Template:
    return lambda printer, node, pieces: Dialect.templates[op](printer, node, pieces)


PRINTED: dict[str, tuple[tuple[str, Template], ...]] = {
    "a dropped operand": tuple((op, _first) for op in ("min", "max", "add", "sub", "mul")),
    "a wrong sign": (("sub", _as("add")), ("add", _as("sub")), ("neg", _first), ("min", _as("max"))),
}
"""Operations that the shader's text has in a spoiled form, once."""


@contextmanager
def spoiled(line: str, by: str) -> Iterator[None]:
    """The march with another line."""
    load_module = glsl.load

    def load_spoiled(name: str, variants: frozenset[str] = frozenset()) -> glsl.Module:
        made = load_module(name, variants)
        return replace(made, lines=tuple(x.replace(line, by) for x in made.lines)) if name == LOOP else made

    glsl.load = load_spoiled
    try:
        yield
    finally:
        glsl.load = load_module


@contextmanager
def printed(op: str, number: int, by: Template) -> Iterator[Counter[str]]:
    """Shaders whose operation `op` is printed otherwise in one place; the count of all places."""
    right, seen = Dialect.templates, Counter[str]()

    def template(printer: Any, node: Any, pieces: Any) -> Any:
        if any(arg.type is not node.type for arg in node.args):
            return right[op](printer, node, pieces)
        seen[op] += 1
        return (by if seen[op] == number else right[op])(printer, node, pieces)

    Dialect.templates = {**right, op: template}
    try:
        yield seen
    finally:
        Dialect.templates = right


def drawn(scene: rm.Scene, size: tuple[int, int]) -> Depth:
    with rm.Renderer(size) as renderer:
        return np.asarray(renderer.render(scene, outputs=("depth",)).depth, np.float64)


def _pixels(scene: rm.Scene, depth: Depth) -> Depth:
    height, width = depth.shape
    pose = scene.pose(set_values(scene.parameters, None, 0.0, scene.where), width / height)
    return np.asarray(pose.pixel(height) * np.where(np.isfinite(depth), depth, 0.0))


def _middle(depth: Depth) -> NDArray[np.bool_]:
    hits = np.flatnonzero(np.isfinite(depth))
    return (np.arange(depth.size) == hits[len(hits) // 2]).reshape(depth.shape)


def _behind(scene: rm.Scene, depth: Depth) -> Depth:
    """The farthest of the operands of the outermost union, in place of the nearest."""
    size = depth.shape[::-1]
    parts = [drawn(scene.replace(node=part), size) for part in scene.node.children]
    return np.max([np.where(np.isfinite(part), part, -1.0) for part in parts] + [depth], axis=0)


PICTURES: dict[str, dict[str, Callable[[rm.Scene, Depth], Depth]]] = {
    "a hit moved": {
        "0.1 px behind": lambda scene, depth: depth + 0.11 * _pixels(scene, depth),
        "0.1 px before": lambda scene, depth: depth - 0.11 * _pixels(scene, depth),
        "half the distance": lambda _, depth: 0.5 * depth,
        "a row shifted": lambda _, depth: np.roll(depth, 1, axis=1),
    },
    "a hit lost": {
        "one pixel": lambda _, depth: np.where(_middle(depth), np.inf, depth),
        "a column": lambda _, depth: np.where(np.arange(depth.shape[1]) == depth.shape[1] // 2, np.inf, depth),
    },
    "a part behind another": {"of the outermost operation": _behind},
}
"""Faults of whole pictures."""


@dataclass(frozen=True)
class Fault:
    """A fault in one scene, and how its picture is drawn."""

    kind: str
    title: str
    draw: Callable[[], Depth]


def faults(scene: rm.Scene, right: Depth, each: int) -> Iterator[Fault]:
    """All of them. each : places of an operation."""
    size = right.shape[::-1]

    def march(line: str, by: str) -> Depth:
        with spoiled(line, by):
            return drawn(scene, size)

    def otherwise(op: str, number: int, by: Template) -> Depth:
        with printed(op, number, by):
            return drawn(scene, size)

    for kind, lines in MARCH.items():
        for line, by in lines:
            yield Fault(kind, by, lambda line=line, by=by: march(line, by))  # type: ignore[misc]
    random = np.random.default_rng(1)
    for kind, operations in PRINTED.items():
        for op, by in operations:
            with printed(op, 0, by) as seen:
                drawn(scene, size)
            for n in map(int, random.permutation(seen[op])[:each] + 1):
                title = f"{op} {n} of {seen[op]}"
                yield Fault(kind, title, lambda op=op, n=n, by=by: otherwise(op, n, by))  # type: ignore[misc]
    for kind, pictures in PICTURES.items():
        for title, spoil in pictures.items():
            yield Fault(kind, title, lambda spoil=spoil: spoil(scene, right))  # type: ignore[misc]


def verdict(scene: rm.Scene, right: Depth, wrong: Depth, within: str) -> tuple[str, str]:
    """What the proof says of a picture, and figures."""
    found = rm.prove(scene, Depths(wrong), tolerance=within)
    both = np.isfinite(right) & np.isfinite(wrong)
    apart = np.abs(np.where(both, right, 0.0) - np.where(both, wrong, 0.0)) > MOVED * found.within
    differs = apart | (np.isfinite(right) != np.isfinite(wrong))
    figures = f"{differs.sum()} hits moved, {found.contradicted} contradicted, {found.open} open"
    if found.contradicted:
        return "contradicted", figures
    if not differs.any():
        return NONE, figures
    if np.all(found.grazing[differs]):
        return "on grazing rays alone", figures
    return "missed", figures


class Depths:
    """A picture of another renderer."""

    def __init__(self, depth: Depth) -> None:
        self.depth = depth


def look(scene: rm.Scene, name: str, size: tuple[int, int], within: str, each: int) -> Iterator[tuple[str, str]]:
    """The kind and the verdict of each fault; those that change the picture are printed."""
    scene = scene.replace(quality=rm.Quality(analytic=False))
    right = drawn(scene, size)
    for fault in faults(scene, right, each):
        try:
            said, figures = verdict(scene, right, fault.draw(), within)
        except rm.RaymarchError as error:
            said, figures = "refused", str(error).splitlines()[0][:120]
        if said != NONE:
            print(f"| {name} | {fault.kind} | {fault.title} | {said} | {figures} |", flush=True)
        yield fault.kind, said


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), help="names of examples")
    parser.add_argument("--size", default="96x54")
    parser.add_argument("--within", default="0.05px")
    parser.add_argument("--each", type=int, default=6, help="places of each operation that are spoiled")
    given = parser.parse_args(arguments)
    width, height = map(int, given.size.split("x"))
    counts: dict[str, Counter[str]] = {}
    begun = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in given.scenes:
            scene = load(next(EXAMPLES.rglob(f"{name}.py")))
            for kind, said in look(scene, name, (width, height), given.within, given.each):
                counts.setdefault(kind, Counter())[said] += 1
    for kind, count in counts.items():
        print(f"{kind}: {dict(count)}")
    print(f"{time.process_time() - begun:.0f} s CPU")
    return 1 if any(count["missed"] for count in counts.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
