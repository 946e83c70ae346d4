"""Random solids that turn, under time and parameters, and the points of their surfaces, by NumPy alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import raymarch as rm
from raymarch.sdf import Node

Points = np.ndarray
Moment = dict[str, float]
"""Time as "time", and the values of parameters."""


@dataclass
class Turned:
    """A solid, and its surface points at a moment."""

    node: Node
    points: Callable[[Moment], Points]
    steps: list[str]


def _shapes(random: np.random.Generator, n: int) -> list[tuple[str, Node, Points]]:
    directions = random.normal(size=(n, 3))
    ball = directions / np.linalg.norm(directions, axis=1)[:, None]
    size = random.uniform(0.3, 2.0, 3)
    faces = random.uniform(-0.5, 0.5, (n, 3)) * size
    axis = random.integers(0, 3, n)
    faces[np.arange(n), axis] = np.sign(faces[np.arange(n), axis]) * 0.5 * size[axis]
    corners = 0.5 * size * (np.indices((2, 2, 2)).reshape(3, 8).T * 2 - 1)
    a = random.uniform(0, 2 * np.pi, n)
    ring = np.stack([np.cos(a), np.zeros(n), np.sin(a)], axis=1)
    radius, height = size[:2]
    rims = radius * ring + np.outer(random.choice([-0.5, 0.5], n) * height, (0, 1, 0))
    minor = 0.3 * radius
    tube = (radius + minor * ball[:, :1]) * ring + minor * np.sqrt(1 - ball[:, :1] ** 2) * (0, 1, 0)
    ends = random.uniform(-1, 1, (2, 3))
    return [
        ("sphere", rm.sphere(radius), radius * ball),
        ("box", rm.box(tuple(size)), np.concatenate([faces, corners])),
        ("cylinder", rm.cylinder(radius, height), rims),
        ("torus", rm.torus(radius, minor), tube),
        ("ellipsoid", rm.ellipsoid(tuple(size)), 0.5 * size * ball),
        ("capsule", rm.capsule(*map(tuple, ends), 0.2), ends[random.integers(0, 2, n)] + 0.2 * ball),
        ("cone", rm.cone(radius, height, 0.5 * radius), rims * np.where(rims[:, 1:2] > 0, (0.5, 1, 0.5), 1)),
    ]


def _angle(random: np.random.Generator, k: int, calm: bool) -> tuple[str, Any, Callable[[Moment], float]]:
    """A name, an expression and its value: of time, of a parameter of a small or any range, or a number."""
    kind = random.choice(
        ["time", "small", "free", "number"], p=[0.0, 0.0, 0.0, 1.0] if calm else [0.35, 0.25, 0.1, 0.3]
    )
    rate, name = float(random.uniform(0.5, 3.0)), f"a{k}"
    if kind == "time":
        return kind, rate * rm.time, lambda at: rate * at["time"]
    if kind == "number":
        return kind, rate, lambda at: rate
    low = float(random.uniform(-3, 3)) if kind == "small" else -4.0
    high = low + 0.3 if kind == "small" else 4.0
    return kind, rm.Param(name, low, low, high), lambda at: low + (high - low) * at[name]


def drawn(random: np.random.Generator, length: int, n: int = 200, calm: bool = False, rigid: bool = False) -> Turned:
    """A chain of motions of a shape. calm : by numbers alone. rigid : without uneven scales and mirrors."""
    shapes = _shapes(random, n)
    name, node, start = shapes[random.integers(len(shapes))]
    points: Callable[[Moment], Points] = lambda at, start=start: start  # noqa: E731
    steps = [name]
    weights = np.array([5, 3, 1, 1, 0 if rigid else 1, 0 if rigid else 1, 1, 1], float)
    for k in range(length):
        step = str(
            random.choice(
                "rotate translate scale material stretch mirror orient union".split(), p=weights / weights.sum()
            )
        )
        before = points
        if step == "rotate":
            kind, angle, value = _angle(random, k, calm)
            axis = random.normal(size=3) if random.random() < 0.4 else np.eye(3)[random.integers(3)]
            unit = axis / np.linalg.norm(axis)
            node = node.rotate(angle, tuple(axis))
            step += f" {kind}"
            points = lambda at, b=before, v=value, u=unit: Rotation.from_rotvec(v(at) * u).apply(b(at))  # noqa: E731
        elif step == "orient":
            node = node.orient((1, 0, 0), "y")
            turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # y to x
            points = lambda at, b=before, m=turn: b(at) @ m.T  # noqa: E731
        elif step == "translate":
            offset = random.uniform(-1, 1, 3)
            node = node.translate(tuple(offset))
            points = lambda at, b=before, o=offset: b(at) + o  # noqa: E731
        elif step in ("scale", "stretch"):
            factor = random.uniform(0.5, 2.0, 3 if step == "stretch" else 1)
            node = node.scale(tuple(factor) if step == "stretch" else float(factor[0]))
            points = lambda at, b=before, f=factor: b(at) * f  # noqa: E731
        elif step == "material":
            node = node.material(rm.Material())
        elif step == "union":
            _, other, more = shapes[random.integers(len(shapes))]
            node = node | other
            points = lambda at, b=before, m=more: np.concatenate([b(at), m])  # noqa: E731
        else:
            axis = random.normal(size=3)
            unit = axis / np.linalg.norm(axis)
            node = node.mirror(tuple(axis))

            def points(at: Moment, b: Any = before, u: Points = unit) -> Points:
                half = b(at)
                half = half[half @ u >= 0]
                return np.concatenate([half, half - 2 * np.outer(half @ u, u)])

        steps.append(step)
    return Turned(node, points, steps)


def moments(random: np.random.Generator, count: int) -> list[Moment]:
    return [
        {"time": float(t), **{f"a{k}": float(v) for k, v in enumerate(values)}}
        for t, values in zip(random.uniform(-300, 300, count), random.random((count, 16)), strict=True)
    ]


def measured(solid: Turned, at: list[Moment]) -> tuple[float, float]:
    """How far a surface point lies outside of the bounds, and the volume of the bounds over that of the points' box."""
    low, high = solid.node.bounds
    points = [p for moment in at if len(p := solid.points(moment))]
    if not points:
        return 0.0, 1.0
    least, most = np.min([p.min(axis=0) for p in points], axis=0), np.max([p.max(axis=0) for p in points], axis=0)
    outside = float(max((low - least).max(), (most - high).max()))
    return outside, float(np.prod(high - low) / np.prod(most - least))
