"""Random scenes written in two ways, or moved, turned, scaled and mirrored as a whole: the picture must be the same.

python -m tests.lab.spellings --scenes 500 [--seed 1] [--sets]

A scene is drawn as plain numbers. Each of its parts has several spellings: nodes that are the same set of points, such
as a cylinder and a revolved rectangle, or a repetition and the union of its copies. Nothing but the package takes part:
a picture is compared with another picture and with the proof of its hits, or with --sets the sign of a field with that
of another, at random points. What differs is made smaller, and printed. Pixels at which the driver ended loops of the
shader are not compared: llvmpipe ends those of a polygon of many corners, with mirrors, after 65,535 turns.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import RaymarchError, SceneWarning
from raymarch.expr.arrays import bound
from raymarch.gpu import Frame, Renderer
from raymarch.gpu.context import Context
from tests.hard.proofs import contradicted
from tests.lab.lit import with_less, with_plain_materials
from tests.support.cpu_limit import LateError, cpu_limit
from tests.support.ended_loops import ended_loops

SIZE = (48, 36)
EVERY = 5
"""Scenes after which a long run says how far it is."""

TIME = 2.0
"""The time at which scenes are drawn; some spellings depend on it."""
Tree = Any
"""("kind", numbers..., children...)"""

# The same set, written otherwise


class Spelling:
    """How the parts of trees are written. 0 is the plain form of each.

    seed : 0 chooses the plain form everywhere. plain : paths of parts that are written plainly in any case.
    """

    def __init__(self, materials: Sequence[rm.Material], seed: int = 0, plain: frozenset[str] = frozenset()) -> None:
        self.materials, self.seed, self.plain = materials, seed, plain
        self.chosen: dict[str, int] = {}

    def pick(self, path: str, count: int) -> int:
        if self.seed == 0 or path in self.plain:
            return 0
        made = zlib.crc32(f"{self.seed} {path}".encode()) % count
        if made:
            self.chosen[path] = made
        return made

    def node(self, tree: Tree, path: str = "", exact: bool = False) -> rm.Node:
        """exact : the field must be the same too, not only the set."""
        kind, *rest = tree
        made: rm.Node = getattr(self, f"_{kind}")(path, exact, *rest)
        return made

    def one_of(self, path: str, *forms: Callable[[], rm.Node]) -> rm.Node:
        return forms[self.pick(path, len(forms))]()

    # shapes

    def _sphere(self, path: str, exact: bool, r: float) -> rm.Node:
        forms = [
            lambda: rm.sphere(r),
            lambda: rm.circle(r).revolve(),
            lambda: rm.sphere(2.0).scale(0.5 * r),
            lambda: rm.sphere(0.3 * r).round(0.7 * r),
            lambda: rm.ellipsoid((2 * r, 2 * r, 2 * r)),
            lambda: rm.sphere(rm.Param(_named("r", path), r, 0.5 * r, 2 * r)),
        ]
        if not exact:
            forms += [
                lambda: rm.sphere(1.0).scale((r, r, r)),
                lambda: rm.sphere(r).twist(1.0 / r),
                lambda: rm.union(rm.cut_sphere(r, 0.0), rm.cut_sphere(r, -0.3 * r).rotate(math.pi, "x")),
            ]
        return self.one_of(path, *forms)

    def _box(self, path: str, exact: bool, x: float, y: float, z: float) -> rm.Node:
        forms = [
            lambda: rm.box((x, y, z)),
            lambda: rm.rectangle((x, y)).extrude(z),
            lambda: rm.box((z, y, x)).rotate(math.pi / 2, "y"),
            lambda: rm.polygon([(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2)]).extrude(z),
            lambda: rm.box((2 * x, 2 * y, 2 * z)).scale(0.5),
            lambda: rm.box((x, y, rm.Param(_named("z", path), z, 0.5 * z, 2 * z))),
        ]
        if not exact:
            forms += [
                lambda: rm.box((x, y, 0.5 * z)).elongate((0, 0, 0.5 * z)),
                lambda: rm.box((1, 1, 1)).scale((x, y, z)),
                lambda: rm.intersection(rm.slab((1, 0, 0), x), rm.slab((0, 1, 0), y), rm.slab((0, 0, 1), z)),
                lambda: rm.heightmap(np.ones((4, 5)), (x, z), 0.4 * y, 0.6 * y).translate((0, 0.1 * y, 0)),
                lambda: rm.difference(
                    rm.box((2 * x, y, z)),
                    rm.plane((1, 0, 0), -x / 2),
                    rm.plane((-1, 0, 0), -x / 2),
                ),
                lambda: rm.union(
                    rm.box((x / 2, y, z)).translate((x / 4, 0, 0)), rm.box((x / 2, y, z)).translate((-x / 4, 0, 0))
                ),
                lambda: rm.box((x / 2, y, z)).translate((x / 4, 0, 0)).mirror("x"),
            ]
        return self.one_of(path, *forms)

    def _cylinder(self, path: str, exact: bool, r: float, h: float) -> rm.Node:
        forms = [
            lambda: rm.cylinder(r, h),
            lambda: rm.rectangle((2 * r, h)).revolve(),
            lambda: rm.circle(r).extrude(h).rotate(math.pi / 2, "x"),
            lambda: rm.cone(r, h, r),
            lambda: rm.line((0, -h / 2, 0), (0, h / 2, 0), r),
            lambda: rm.cylinder(rm.Param(_named("c", path), r, 0.5 * r, 2 * r), h),
        ]
        if not exact:
            forms += [
                lambda: rm.cylinder(r, h / 2).elongate((0, h / 2, 0)),
                lambda: rm.infinite_cylinder(r) & rm.slab((0, 1, 0), h),
                lambda: rm.cylinder(r, h).twist(2.0 / r),
                lambda: rm.cylinder(1.0, 1.0).scale((r, h, r)),
                lambda: rm.cylinder(r, 2 * h) - rm.plane((0, 1, 0), -h / 2) - rm.plane((0, -1, 0), -h / 2),
                lambda: rm.cylinder(r, h) - rm.sphere(r).translate((0, h + 2 * r, 0)),
                lambda: rm.cylinder(r, h / 2).translate((0, h / 4, 0)).mirror("y"),
            ]
        return self.one_of(path, *forms)

    def _capsule(self, path: str, exact: bool, h: float, r: float) -> rm.Node:
        forms = [
            lambda: rm.capsule((0, -h / 2, 0), (0, h / 2, 0), r),
            lambda: (
                rm.round_cone(r, h, r).translate((0, -h / 2, 0))
                if abs(rm.round_cone(r, h, r).bounds[0][1] + r) < 1e-9 * r
                else rm.round_cone(r, h, r)
            ),
            lambda: rm.stroke((0, -h / 2), (0, h / 2), 2 * r).revolve(),
            lambda: rm.capsule((0, -h / 2, 0), (0, h / 2, 0), 0.4 * r).round(0.6 * r),
        ]
        if not exact:
            forms += [
                lambda: rm.sphere(r).elongate((0, h, 0)),
                lambda: rm.polyline_tube(((0, -h / 2, 0), (0, 0.1 * h, 0), (0, h / 2, 0)), r),
                lambda: rm.union(
                    rm.cylinder(r, h),
                    rm.sphere(r).translate((0, h / 2, 0)),
                    rm.sphere(r).translate((0, -h / 2, 0)),
                ),
                lambda: rm.infinite_cylinder(r) & rm.sphere(r).elongate((0, h, 0)),
            ]
        return self.one_of(path, *forms)

    def _torus(self, path: str, exact: bool, a: float, b: float) -> rm.Node:
        forms = [
            lambda: rm.torus(a, b),
            lambda: rm.circle(b).revolve(a),
            lambda: rm.torus(a, 0.5 * b).round(0.5 * b),
            lambda: rm.torus(a, rm.Param(_named("b", path), b, 0.5 * b, 1.5 * b)),
        ]
        if not exact:
            forms += [
                lambda: rm.torus(a, b).twist(1.0 / a),
                lambda: rm.capped_torus(a, b, 3.2).rotate(math.pi, "y") | rm.capped_torus(a, b, 3.2),
            ]
        return self.one_of(path, *forms)

    def _prism(self, path: str, exact: bool, n: int, r: float, h: float) -> rm.Node:
        """A regular polygon with one corner up, extruded."""
        around = [(r * math.sin(2 * math.pi * i / n), r * math.cos(2 * math.pi * i / n)) for i in range(n)]
        forms = [
            lambda: rm.regular_polygon(n, r).extrude(h),
            lambda: rm.polygon(around).extrude(h),
            lambda: rm.polygon(list(reversed(around))).extrude(h),
            lambda: rm.polygon(_finer(around, 128)).extrude(h),  # as data
        ]
        if not exact:
            inner = r * math.cos(math.pi / n)
            sides = [
                rm.plane((math.sin(t), math.cos(t), 0), inner) for t in (2 * math.pi * (i + 0.5) / n for i in range(n))
            ]
            forms += [
                lambda: rm.regular_polygon(n, r).extrude(0.5 * h).elongate((0, 0, 0.5 * h)),
                lambda: rm.intersection(rm.slab((0, 0, 1), h), *sides),
                lambda: rm.regular_polygon(n, r).extrude_to(rm.regular_polygon(n, r), h),
            ]
        return self.one_of(path, *forms)

    def _slope(self, path: str, exact: bool, x: float, y: float, z: float, rise: float) -> rm.Node:
        """A box of height y whose top rises by `rise` along x, from -x/2 to x/2, and falls as much."""
        top = rm.plane((-rise, x, 0), (0.5 * x * y) / math.hypot(rise, x))

        def points() -> rm.Node:
            c = y / 2
            return rm.polygon([(-x / 2, -c), (x / 2, -c), (x / 2, c + rise / 2), (-x / 2, c - rise / 2)]).extrude(z)

        def mapped() -> rm.Node:
            ramp = np.tile(np.linspace(0, 1, 9), (6, 1))
            return rm.heightmap(ramp, (x, z), rise, y - rise / 2).translate((0, (y - rise) / 2, 0))

        forms = [
            lambda: rm.box((x, 3 * y, z)) & top & rm.plane((0, -1, 0), y / 2),
            points,
            lambda: (rm.box((x, 3 * y, z)) - top.complement()) - rm.plane((0, 1, 0), -y / 2),
        ]
        if not exact:
            forms += [mapped]
        return forms[0]() if exact else self.one_of(path, *forms)

    # transforms

    def _move(self, path: str, exact: bool, v: Any, child: Tree) -> rm.Node:
        v = tuple(map(float, v))
        if child[0] in ("union", "inter", "diff") and self.pick(path + "!", 2):
            kind, k, family, *parts = child
            return self.node((kind, k, family, *(("move", v, part) for part in parts)), path + "0", exact)
        made = self.node(child, path + "0", exact)
        matrix = np.eye(4)
        matrix[3, :3] = v
        return self.one_of(
            path,
            lambda: made.translate(v),
            lambda: made.translate((v[0], 0, 0)).translate((0, v[1], v[2])),
            lambda: made.transform(matrix),
            lambda: made.translate((rm.Param(_named("x", path), v[0]), v[1], v[2])),
            lambda: made.translate((v[0], v[1] + 0.5 * (rm.time - TIME), v[2])),
            lambda: made.rotate(0.7, "y").translate(_turned(v, 0.7)).rotate(-0.7, "y"),
        )

    def _turn(self, path: str, exact: bool, angle: float, axis: Any, child: Tree) -> rm.Node:
        if child[0] in ("union", "inter", "diff") and self.pick(path + "!", 2):
            kind, k, family, *parts = child
            return self.node((kind, k, family, *(("turn", angle, axis, part) for part in parts)), path + "0", exact)
        made = self.node(child, path + "0", exact)
        matrix = np.eye(4)
        matrix[:3, :3] = rotation(angle, axis).T
        return self.one_of(
            path,
            lambda: made.rotate(angle, axis),
            lambda: made.rotate(-angle, tuple(-np.array(axis))),
            lambda: made.transform(matrix),
            lambda: made.rotate(0.4 * angle, axis).rotate(0.6 * angle, axis),
            lambda: made.rotate(rm.Param(_named("a", path), angle), axis),
            lambda: made.rotate(angle * (rm.time - (TIME - 1.0)), axis),
        )

    def _scale(self, path: str, exact: bool, s: float, child: Tree) -> rm.Node:
        if child[0] in ("union", "inter", "diff") and self.pick(path + "!", 2):
            kind, k, family, *parts = child
            return self.node((kind, s * k, family, *(("scale", s, part) for part in parts)), path + "0", exact)
        made = self.node(child, path + "0", exact)
        return self.one_of(
            path,
            lambda: made.scale(s),
            lambda: made.transform(np.diag((s, s, s, 1.0))),
            lambda: made.scale(rm.Param(_named("s", path), s, 0.5 * s, 2 * s)),
            lambda: made.scale((s, s, s)),
        )

    def _stretch(self, path: str, exact: bool, v: Any, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        forms = [lambda: made.scale(tuple(v))]
        if not exact:
            forms += [
                lambda: made.transform(np.diag((*v, 1.0))),
                lambda: made.scale((v[0], 1, 1)).scale((1, v[1], v[2])),
            ]
        return self.one_of(path, *forms)

    def _sheared(self, path: str, exact: bool, amount: float, child: Tree) -> rm.Node:
        """x grows by amount * y."""
        made = self.node(child, path + "0", exact)
        matrix = np.eye(4)
        matrix[1, 0] = amount
        forms = [lambda: made.transform(matrix)]
        if not exact:
            half = np.eye(4)
            half[1, 0] = amount / 2
            forms += [lambda: made.transform(half).transform(half)]
        return self.one_of(path, *forms)

    def _reflect(self, path: str, exact: bool, axis: int, child: Tree) -> rm.Node:
        """The image in a plane through the origin."""
        made = self.node(child, path + "0", exact)
        flip = np.ones(4)
        flip[axis] = -1.0
        all_three = np.diag((-1.0, -1.0, -1.0, 1.0))
        return self.one_of(
            path,
            lambda: made.transform(np.diag(flip)),
            lambda: made.transform(all_three).rotate(math.pi, "xyz"[axis]),
        )

    # repetition

    def _mirror(self, path: str, exact: bool, axis: int, child: Tree) -> rm.Node:
        """A solid on the side to which the axis points, and its image."""
        made = self.node(child, path + "0", exact)
        flip = np.ones(4)
        flip[axis] = -1.0
        return self.one_of(
            path, lambda: made.mirror("xyz"[axis]), lambda: rm.union(made, made.transform(np.diag(flip)))
        )

    def _repeat(self, path: str, exact: bool, spacing: float, counts: Any, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        at = [(np.arange(n) - (n // 2 if n % 2 else n / 2 - 0.5)) * spacing for n in (counts[0], 1, counts[1])]
        places = np.array([(x, y, z) for x in at[0] for y in at[1] for z in at[2]])
        forms = [
            lambda: made.repeat((spacing, None, spacing), (counts[0], None, counts[1])),
            lambda: rm.union(*(made.translate(tuple(p)) for p in places)),
            lambda: made.repeat((spacing, None, None), (counts[0], None, None)).repeat(
                (None, None, spacing), (None, None, counts[1])
            ),
        ]
        if not exact:
            forms += [lambda: rm.instances(made, places)]
        return self.one_of(path, *forms)

    def _polar(self, path: str, exact: bool, n: int, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        return self.one_of(
            path,
            lambda: made.polar(n),
            lambda: rm.union(*(made.rotate(2 * math.pi * i / n, "y") for i in range(n))),
        )

    def _rows(self, path: str, exact: bool, seed: int, count: int, unit: float, child: Tree) -> rm.Node:
        """Copies at random places, turned and scaled."""
        made = self.node(child, path + "0", exact)
        random = np.random.default_rng(seed)
        low, high = Spelling(self.materials).node(child).bounds
        size = float(np.linalg.norm(high - low))
        matrices, nodes = [], []
        for _ in range(count):
            s, angle = 0.4 * unit / size * random.uniform(0.4, 1.0), random.uniform(-3, 3)
            axis = random.normal(size=3)
            at = unit * random.uniform(-1, 1, 3)
            matrix = np.eye(4)
            matrix[:3, :3] = s * rotation(angle, axis).T
            matrix[3, :3] = at
            matrices.append(matrix)
            nodes.append(made.scale(s).rotate(angle, tuple(axis)).translate(tuple(at)))
        forms = [
            lambda: rm.union(*nodes),
            lambda: rm.union(*reversed(nodes)),
            lambda: rm.union(*(made.transform(m) for m in matrices)),
            lambda: rm.union(rm.union(*nodes[::2]), rm.union(*nodes[1::2])),
        ]
        if not exact:
            forms += [lambda: rm.instances(made, np.array(matrices))]
        return self.one_of(path, *forms)

    # thickness, deformation

    def _round(self, path: str, exact: bool, r: float, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", True)
        return self.one_of(
            path,
            lambda: made.round(r),
            lambda: made.offset(r),
            lambda: made.round(0.3 * r).round(0.7 * r),
            lambda: made.displace_by(lambda p: 0.0 * p.x - r, r, 0.0),
            lambda: rm.morph(made.round(0.5 * r), made.round(1.5 * r), 0.5),
        )

    def _shell(self, path: str, exact: bool, t: float, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", True)
        forms = [lambda: made.shell(t)]
        if not exact and 0.6 * t < -float(np.min(made.distance(np.zeros((1, 3))))):
            forms += [lambda: made.offset(0.5 * t) - made.offset(-0.5 * t)]
        return self.one_of(path, *forms)

    def _twist(self, path: str, exact: bool, rate: float, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        forms = [lambda: made.twist(rate)]
        if not exact:
            flip = np.diag((-1.0, 1.0, 1.0, 1.0))
            forms += [
                lambda: made.rotate(0.5, "y").twist(rate).rotate(-0.5, "y"),
                lambda: made.transform(flip).twist(-rate).transform(flip),
                lambda: made.scale(2.0).twist(rate / 2).scale(0.5),
                lambda: made.twist(rate / 2).twist(rate / 2),
            ]
        return self.one_of(path, *forms)

    def _bend(self, path: str, exact: bool, rate: float, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        forms = [lambda: made.bend(rate)]
        if not exact:
            flip = np.diag((1.0, 1.0, -1.0, 1.0))
            forms += [
                lambda: made.scale(2.0).bend(rate / 2).scale(0.5),
                lambda: made.transform(flip).bend(rate).transform(flip),
            ]
        return self.one_of(path, *forms)

    def _taper(self, path: str, exact: bool, rate: float, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        forms = [lambda: made.taper(rate)]
        if not exact:
            forms += [
                lambda: made.rotate(0.5, "y").taper(rate).rotate(-0.5, "y"),
                lambda: made.scale(2.0).taper(rate / 2).scale(0.5),
            ]
        return self.one_of(path, *forms)

    def _waves(self, path: str, exact: bool, a: float, f: float, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", True)

        def wave(p: Any) -> Any:
            return a * rm.sin(f * p.x) * rm.sin(f * p.y) * rm.sin(f * p.z)

        forms = [lambda: made.displace(a, f)]
        if not exact:  # the divisor of the field may be another
            forms += [
                lambda: made.displace_by(wave),
                lambda: made.scale(2.0).displace(2 * a, f / 2).scale(0.5),
            ]
        return self.one_of(path, *forms)

    def _relief(self, path: str, exact: bool, seed: int, unit: float, child: Tree) -> rm.Node:
        """A surface displaced by data."""
        made = self.node(child, path + "0", True)
        data = np.random.default_rng(seed).uniform(0, 1, (5, 6))
        size, h = (2.0 * unit, 1.7 * unit), 0.1 * unit
        flip = np.diag((-1.0, 1.0, 1.0, 1.0))
        forms = [lambda: made.displace_by_image(data, size, h)]
        if not exact:
            forms += [
                lambda: made.scale(2.0).displace_by_image(data, (2 * size[0], 2 * size[1]), 2 * h).scale(0.5),
                lambda: made.transform(flip).displace_by_image(data[:, ::-1], size, h).transform(flip),
                lambda: made.rotate(math.pi, "y").displace_by_image(data[::-1, ::-1], size, h).rotate(math.pi, "y"),
            ]
        return self.one_of(path, *forms)

    # operators

    def _union(self, path: str, exact: bool, k: float, family: str, *children: Tree) -> rm.Node:
        parts = [self.node(child, f"{path}{i}", exact or k > 0) for i, child in enumerate(children)]
        if k:
            return self.one_of(
                path,
                lambda: rm.union(*parts, k=k, blend=family),
                lambda: (
                    rm.union(*reversed(parts), k=k, blend=family)
                    if len(parts) == 2
                    else rm.union(*parts, k=k, blend=family)
                ),
                lambda: rm.union(*parts, k=rm.Param(_named("k", path), k, 0.5 * k, 2 * k), blend=family),
            )
        forms = [
            lambda: rm.union(*parts),
            lambda: rm.union(*reversed(parts)),
            lambda: rm.union(*parts, parts[0]),
        ]
        if not exact:
            forms += [
                lambda: rm.intersection(*(part.complement() for part in parts)).complement(),
                lambda: rm.union(rm.union(*parts), parts[0]).complement().complement(),
                lambda: rm.union(*(part.visible() for part in parts)),
            ]
        return self.one_of(path, *forms)

    def _inter(self, path: str, exact: bool, k: float, family: str, *children: Tree) -> rm.Node:
        parts = [self.node(child, f"{path}{i}", exact or k > 0) for i, child in enumerate(children)]
        if k:
            return self.one_of(
                path,
                lambda: rm.intersection(*parts, k=k, blend=family),
                lambda: rm.union(*(part.complement() for part in parts), k=k, blend=family).complement(),
                lambda: rm.difference(parts[0], *(part.complement() for part in parts[1:]), k=k, blend=family),
            )
        return self.one_of(
            path,
            lambda: rm.intersection(*parts),
            lambda: rm.intersection(*reversed(parts)),
            lambda: rm.difference(parts[0], *(part.complement() for part in parts[1:])),
            lambda: rm.union(*(part.complement() for part in parts)).complement(),
        )

    def _diff(self, path: str, exact: bool, k: float, family: str, *children: Tree) -> rm.Node:
        parts = [self.node(child, f"{path}{i}", exact or k > 0) for i, child in enumerate(children)]
        if k:
            return self.one_of(
                path,
                lambda: rm.difference(*parts, k=k, blend=family),
                lambda: rm.intersection(parts[0], *(part.complement() for part in parts[1:]), k=k, blend=family),
            )
        return self.one_of(
            path,
            lambda: rm.difference(*parts),
            lambda: rm.intersection(parts[0], *(part.complement() for part in parts[1:])),
            lambda: rm.difference(parts[0], rm.union(*parts[1:])),
            lambda: rm.union(parts[0].complement(), *parts[1:]).complement(),
        )

    def _xor(self, path: str, exact: bool, a: Tree, b: Tree) -> rm.Node:
        one, two = self.node(a, path + "0", exact), self.node(b, path + "1", exact)
        forms = [lambda: rm.xor(one, two)]
        if not exact:
            forms += [lambda: (one - two) | (two - one), lambda: (one | two) - (one & two)]
        return self.one_of(path, *forms)

    def _paint(self, path: str, exact: bool, number: int, child: Tree) -> rm.Node:
        made = self.node(child, path + "0", exact)
        material = self.materials[number]
        return self.one_of(
            path,
            lambda: made.material(material),
            lambda: made.translate((0, 0, 0)).material(material),
            lambda: made.material(_at_any_time(material)),
        )

    def _plane(self, path: str, exact: bool, y: float) -> rm.Node:
        forms = [
            lambda: rm.plane((0, 1, 0), y),
            lambda: rm.plane((0, -1, 0), -y).complement(),
            lambda: rm.plane().translate((0, y, 0)),
            lambda: rm.plane((1, 0, 0), y).rotate(math.pi / 2, "z"),
            lambda: rm.plane((0, 1, 0), rm.Param(_named("y", path), y)),
        ]
        if not exact:
            forms += [
                lambda: rm.plane((0, 1, 0), y) & rm.plane((0, 1, 0), y + 1.0),
                lambda: rm.plane((0, 1, 0), y).scale((2, 1, 3)) if y == 0 else rm.plane((0, 1, 0), y),
                lambda: rm.plane((0, 1, 0), y).transform(np.diag((-1.0, 1.0, 1.0, 1.0))),
            ]
        return self.one_of(path, *forms)


def _named(name: str, path: str) -> str:
    return f"{name} {path}".replace(":", "-").replace("!", "")


def _at_any_time(material: rm.Material) -> rm.Material:
    """The material, its colour times a wave of time that is 1 at `TIME`, after a million periods."""
    name = "albedo" if material.physical else "color"
    return material.replace(**{name: rm.cos(1e6 * math.tau / TIME * rm.time) * getattr(material, name)})


def _finer(points: list[tuple[float, float]], count: int) -> list[tuple[float, float]]:
    """Points along the sides of a polygon."""
    n, made = len(points), []
    each = -(-count // n)
    for i in range(n):
        a, b = np.array(points[i]), np.array(points[(i + 1) % n])
        made += [tuple(map(float, a + (b - a) * j / each)) for j in range(each)]
    return made


def rotation(angle: float, axis: Any) -> NDArray[np.float64]:
    """After Rodrigues, for column vectors."""
    n = np.array(axis, float) / np.linalg.norm(axis)
    k = np.array(((0, -n[2], n[1]), (n[2], 0, -n[0]), (-n[1], n[0], 0)))
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k)


def _turned(v: Any, angle: float) -> tuple[float, ...]:
    return tuple(map(float, rotation(angle, (0, 1, 0)) @ np.array(v)))


# The whole scene moved


@dataclass(frozen=True)
class Similarity:
    """x -> factor * matrix x + offset, of solids, lights and camera."""

    factor: float = 1.0
    angle: float = 0.0
    axis: tuple[float, ...] = (0.0, 1.0, 0.0)
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    mirrored: bool = False

    @property
    def matrix(self) -> NDArray[np.float64]:
        turned = rotation(self.angle, self.axis)
        return turned @ np.diag((-1.0, 1.0, 1.0)) if self.mirrored else turned

    def point(self, v: Any) -> tuple[float, ...]:
        return tuple(map(float, self.factor * self.matrix @ np.array(v, float) + np.array(self.offset)))

    def direction(self, v: Any) -> tuple[float, ...]:
        return tuple(map(float, self.matrix @ np.array(v, float)))

    def node(self, node: rm.Node) -> rm.Node:
        if self.mirrored:
            node = node.transform(np.diag((-1.0, 1.0, 1.0, 1.0)))
        if self.factor != 1.0:
            node = node.scale(self.factor)
        if self.angle:
            node = node.rotate(self.angle, self.axis)
        return node.translate(self.offset) if any(self.offset) else node


@dataclass
class Spec:
    """A scene as numbers, in its own unit of length."""

    trees: list[Tree]
    materials: list[dict[str, Any]]
    lights: list[dict[str, Any]]
    position: Any
    target: Any
    fov: float
    height: float | None = None
    near: float = 0.0
    far: float | None = None
    sky: Any = (0.4, 0.5, 0.7)
    sky_light: bool = False
    fog: Any = None
    occlusion: Any = None
    bounces: int = 0
    quality: dict[str, Any] = field(default_factory=dict)
    tags: tuple[str, ...] = ()

    def changed(self, **parts: Any) -> Spec:
        return replace(self, **parts)


def _material(made: dict[str, Any]) -> rm.Material:
    given = dict(made)
    for name, value in made.items():
        if isinstance(value, tuple) and value and isinstance(value[0], str):
            given[name] = _pattern(*value)
    return rm.Material(**given)


def _pattern(kind: str, *numbers: Any) -> Any:
    if kind in ("planar", "triplanar"):
        seed, channels, size, where = numbers
        data = np.random.default_rng(seed).uniform(0.1, 0.9, (8, 8, 3) if channels == 3 else (8, 8))
        if channels == "normal":
            data = np.random.default_rng(seed).uniform(0.35, 0.65, (8, 8, 3)) * (1, 1, 0) + (0, 0, 0.95)
        return rm.planar(data, size, where) if kind == "planar" else rm.triplanar(data, size, where)
    if kind == "bumps":
        f, a = numbers
        return lambda p: a * rm.sin(f * p.x) * rm.sin(f * p.y + 1.0) * rm.sin(f * p.z + 2.0)
    return getattr(rm, kind)(*numbers)


def scene_of(spec: Spec, spelling: Spelling, moved: Similarity) -> rm.Scene:
    nodes = [spelling.node(tree, f"{i}:") for i, tree in enumerate(spec.trees)]
    node = moved.node(nodes[0] if len(nodes) == 1 else rm.union(*nodes))
    s = moved.factor
    lights: list[Any] = []
    for light in spec.lights:
        given = {key: value for key, value in light.items() if key != "kind"}
        for key in ("position", "direction", "sun_direction"):
            if key in given:
                given[key] = (moved.point if key == "position" else moved.direction)(given[key])
        if "position" in given:
            given["intensity"] = given.get("intensity", 1.0) * s * s
        for key in ("radius", "range"):
            if key in given and "position" in given:
                given[key] = s * given[key]
        lights.append(
            {"sun": rm.Sun, "point": rm.PointLight, "spot": rm.SpotLight, "ball": rm.SphereLight}[light["kind"]](
                **given
            )
        )
    lens: dict[str, Any] = {"fov": spec.fov}
    if spec.height is not None:
        lens = {"projection": "orthographic", "height": s * spec.height}
    if spec.near:
        lens["near"] = s * spec.near
    if spec.far is not None:
        lens["far"] = s * spec.far
    camera = rm.Camera(moved.point(spec.position), moved.point(spec.target), moved.direction((0, 1, 0)), **lens)
    rest: dict[str, Any] = {"sky": rm.Sky(spec.sky, light=spec.sky_light)}
    if spec.fog is not None:
        rest["fog"] = rm.Fog(spec.fog[0], spec.fog[1] / s)
    if spec.occlusion is not None:
        steps, reach = spec.occlusion
        rest["occlusion"] = rm.AmbientOcclusion(steps, s * reach)
    quality = {"max_steps": 2048, **spec.quality}
    if spec.bounces:
        rest["bounces"] = spec.bounces
        quality["integrator"] = "whitted"
    return rm.Scene(node, camera, lights, quality=rm.Quality(**quality), **rest)


# Random scenes

FAMILIES = ("quadratic", "cubic", "quartic", "circular", "exponential", "root", "circular_geometric")


class Draw:
    """The parts of a random scene, whose size is about `unit`."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng((seed, 77))
        self.unit = float(10.0 ** self.random.uniform(-3, 3)) if self.chance(0.3) else 1.0
        self.materials: list[dict[str, Any]] = []
        self.tags: list[str] = []

    def chance(self, share: float) -> bool:
        return bool(self.random.uniform() < share)

    def one(self, *of: Any) -> Any:
        return of[self.random.integers(len(of))]

    def u(self, low: float, high: float) -> float:
        return self.unit * float(self.random.uniform(low, high))

    def axis(self) -> tuple[float, ...]:
        return tuple(map(float, self.random.normal(size=3)))

    def color(self) -> tuple[float, ...]:
        return tuple(round(float(c), 3) for c in self.random.uniform(0.1, 0.9, 3))

    def pattern(self, least: float = 0.05) -> Any:
        size = self.unit * float(10 ** self.random.uniform(math.log10(least), 0.3))
        kind = self.one("checker", "axis checker", "stripes", "noise", "marble", "grid_lines", "planar", "triplanar")
        self.tags.append(kind)
        if kind == "axis checker":
            return ("checker", self.color(), self.color(), size, self.one(*"xyz"))
        if kind == "stripes":
            return ("stripes", self.color(), self.color(), size, self.one(*"xyz"))
        if kind == "grid_lines":
            return ("grid_lines", self.color(), self.color(), size)
        if kind == "planar":
            return ("planar", int(self.random.integers(99)), 3, 2 * size, self.one(*"xyz"))
        if kind == "triplanar":
            return ("triplanar", int(self.random.integers(99)), 3, 2 * size, float(self.one(1.0, 4.0)))
        return (kind, self.color(), self.color(), size)

    def paint(self, tree: Tree) -> Tree:
        made: dict[str, Any] = {}
        physical = self.chance(0.4)
        made["albedo" if physical else "color"] = self.pattern() if self.chance(0.5) else self.color()
        if physical:
            made["roughness"] = float(self.random.uniform(0.15, 1.0))
            made["metalness"] = float(self.one(0.0, 0.0, 1.0))
        if self.chance(0.25):
            f = float(self.random.uniform(3, 12)) / self.unit
            if self.chance(0.5):
                self.tags.append("bumps")
                made["height"], made["height_scale"] = ("bumps", f, 1.0), 0.1 / f
            else:
                self.tags.append("normal map")
                kind, where = self.one(("planar", "x"), ("planar", "y"), ("planar", "z"), ("triplanar", 4.0))
                made["normal"] = (kind, int(self.random.integers(99)), "normal", self.u(0.5, 2.0), where)
        self.materials.append(made)
        return ("paint", len(self.materials) - 1, tree)

    def leaf(self) -> Tree:
        u = self.u
        kind = self.one("sphere", "box", "cylinder", "capsule", "torus", "prism", "slope", "plate")
        if kind == "sphere":
            return ("sphere", u(0.2, 0.6))
        if kind == "box":
            return ("box", u(0.3, 0.9), u(0.3, 0.9), u(0.3, 0.9))
        if kind == "plate":
            return ("box", u(0.5, 0.9), self.unit * float(10 ** self.random.uniform(-5, -1)), u(0.5, 0.9))
        if kind == "cylinder":
            return ("cylinder", u(0.2, 0.4), u(0.3, 0.9))
        if kind == "capsule":
            return ("capsule", u(0.3, 0.7), u(0.1, 0.3))
        if kind == "torus":
            return ("torus", u(0.3, 0.5), u(0.05, 0.2))
        if kind == "prism":
            return ("prism", int(self.random.integers(3, 8)), u(0.3, 0.5), u(0.2, 0.8))
        return ("slope", u(0.5, 0.9), u(0.4, 0.6), u(0.4, 0.9), u(0.1, 0.3))

    def placed(self, tree: Tree, reach: float = 0.4) -> Tree:
        if self.chance(0.6):
            tree = ("turn", float(self.random.uniform(-3, 3)), self.axis(), tree)
        return ("move", tuple(self.u(-reach, reach) for _ in range(3)), tree)

    def blend(self) -> tuple[float, str]:
        return (self.u(0.05, 0.4), str(self.one(*FAMILIES))) if self.chance(0.4) else (0.0, "quadratic")

    def solid(self, depth: int) -> Tree:
        kind = self.random.integers(21) if depth else 0
        if kind <= 2:
            return self.paint(self.leaf())
        first = self.solid(depth - 1)
        if kind <= 4:
            return ("union", *self.blend(), first, self.placed(self.solid(depth - 1)))
        if kind <= 6:
            return ("diff", *self.blend(), first, self.placed(self.solid(depth - 1)))
        if kind == 7:
            return ("inter", *self.blend(), self.paint(("sphere", self.u(0.5, 0.8))), first)
        if kind == 8:
            return ("xor", first, self.placed(self.solid(depth - 1)))
        names = {
            9: "stretch",
            10: "sheared",
            11: "reflect",
            12: "mirror",
            13: "repeat",
            14: "polar",
            15: "rows",
            16: "round",
            17: "shell",
            18: "twist",
            19: "waves",
            20: "relief",
        }
        name = names[int(kind)]
        if name == "twist":
            name = self.one("twist", "bend", "taper")
        self.tags.append(name)
        return self.operated(name, first, depth)

    def operated(self, name: str, child: Tree, depth: int) -> Tree:
        r = self.random
        if not math.isfinite(_extent(child, 0)):
            return child
        if name == "stretch":
            return (name, tuple(map(float, 10.0 ** r.uniform(-2.0, 0.2, 3))), child)
        if name == "sheared":
            return (name, float(r.uniform(-1.5, 1.5)), child)
        if name == "reflect":
            return (name, int(r.integers(3)), child)
        if name == "mirror":
            axis = int(r.integers(3))
            size = _extent(child, axis)
            aside = [0.0, 0.0, 0.0]
            aside[axis] = size * float(self.one(1.0, 1.0, 1.3))  # exactly on the plane, or off it
            return (name, axis, ("move", tuple(aside), child))
        if name == "repeat":
            inner = (
                self.operated(self.one("repeat", "polar", "mirror"), child, 0)
                if depth > 1 and self.chance(0.3)
                else child
            )
            size = max(_extent(inner, 0), _extent(inner, 2))
            spacing = 2.0 * size * float(self.one(1.0, 1.2, 2.0))
            return ("scale", 0.35, (name, spacing, tuple(int(n) for n in r.integers(1, 5, 2)), inner))
        if name == "polar":
            n = int(r.integers(2, 9))
            size = math.hypot(_extent(child, 0), _extent(child, 2))
            far = size / math.sin(math.pi / n) * 1.2
            angle = float(self.one(0.0, math.pi / n, float(r.uniform(0, 1))))
            along = (far * math.cos(angle), 0.0, -far * math.sin(angle))
            return ("scale", 0.8 * self.unit / far, (name, n, ("move", along, child)))
        if name == "rows":
            return (name, int(r.integers(999)), int(self.one(3, 8, 40) if _size(child) < 4 else 3), self.unit, child)
        if name == "round":
            return (name, self.u(0.02, 0.3), child)
        if name == "shell":
            return (name, self.unit * float(10 ** r.uniform(-4, -1)), child)
        if name == "twist":
            return (name, float(r.uniform(-2, 2)) / self.unit, child)
        if name == "bend":
            return (name, float(r.uniform(-0.5, 0.5)) / self.unit, child)
        if name == "taper":
            return (name, float(r.uniform(-0.4, 0.4)) / self.unit, child)
        if name == "waves":
            return (name, self.u(0.01, 0.05), float(r.uniform(3, 10)) / self.unit, child)
        return (name, int(r.integers(99)), self.unit, child)


def _size(tree: Tree) -> int:
    """The number of nodes."""
    return 1 + sum(_size(part) for part in tree if isinstance(part, tuple) and part and isinstance(part[0], str))


def _extent(tree: Tree, axis: int) -> float:
    """The largest coordinate of a solid along an axis, from the plane through the origin to either side."""
    low, high = Spelling([rm.Material()] * 99).node(tree).bounds
    return float(max(abs(low[axis]), abs(high[axis])))


def drawn(seed: int) -> Spec:
    """A random scene."""
    draw = Draw(seed)
    r, u = draw.random, draw.unit
    trees: list[Tree] = []
    if draw.chance(0.6):
        trees.append(draw.paint(("plane", draw.u(-0.8, -0.3) if draw.chance(0.7) else 0.0)))
    centred = draw.chance(0.3)
    for _ in range(int(r.integers(1, 3))):
        tree = draw.solid(int(r.integers(0, 3)))
        trees.append(tree if centred else draw.placed(tree, 0.6))
    lights: list[dict[str, Any]] = []
    for _ in range(int(r.integers(1, 3))):
        towards = r.normal(size=3)
        towards[1] = abs(towards[1]) + 0.3
        towards /= np.linalg.norm(towards)
        made: dict[str, Any] = {"shadow": draw.chance(0.7), "intensity": float(r.uniform(0.4, 1.0))}
        kind = draw.one("sun", "sun", "point", "spot", "ball")
        made["kind"] = kind
        if kind != "ball" and made["shadow"] and draw.chance(0.3):
            made["penumbra"] = draw.one("two-sided", "cone", "triangulated")
            made |= {"softness": 0.1} if kind == "sun" else {"radius": 0.2 * u}
        if kind == "sun":
            made["sun_direction"] = tuple(map(float, towards))
        else:
            away = u * float(10 ** r.uniform(0.2, 4))
            made["position"] = tuple(map(float, away * towards))
            made["intensity"] *= away * away
            if kind == "spot":
                made["direction"] = tuple(map(float, -towards + 0.1 * min(1, u / away) * r.normal(size=3)))
                made["half_angle"] = float(min(1.2, max(0.02, 1.2 * u / away)))
            if kind == "ball":
                made["radius"] = draw.u(0.05, 0.3)
        lights.append(made)
    away = draw.u(2.0, 4.0)
    towards = r.normal(size=3)
    towards[1] = abs(towards[1])
    towards /= np.linalg.norm(towards)
    position = away * towards
    target = np.array([draw.u(-0.2, 0.2) for _ in range(3)])
    where = draw.one("generic", "generic", "generic", "generic", "plane", "axis", "inside", "grazing", "far")
    if where == "plane":
        position, target = np.array((0.0, 0.4 * away, away)), np.zeros(3)
    elif where == "axis":
        position, target = np.array((0.0, 0.0, away)), np.zeros(3)
    elif where == "inside":
        position = np.array([draw.u(-0.15, 0.15) for _ in range(3)])
        target = position + u * towards
    elif where == "grazing":
        position = away * np.array((towards[0], 0.02, 1.0))
    elif where == "far":
        position = position * float(10 ** r.uniform(1, 3))
    draw.tags.append(where)
    if where in ("axis", "inside", "grazing") and trees[0] == ("paint", 0, ("plane", 0.0)):
        trees[0] = ("paint", 0, ("plane", -0.5 * u))  # a camera on a surface sees either side
    fov = float(draw.one(20.0, 40.0, 40.0, 70.0, 120.0))
    if where == "far":
        fov = math.degrees(2 * math.atan(u / float(np.linalg.norm(position))))
    spec = Spec(trees, draw.materials, lights, tuple(map(float, position)), tuple(map(float, target)), fov)
    if draw.chance(0.2) and where != "inside":
        draw.tags.append("orthographic")
        spec.height = draw.u(1.5, 3.0)
    if draw.chance(0.15):
        draw.tags.append("clipped")
        reach = math.dist(spec.position, spec.target)
        spec.near, spec.far = reach * float(r.uniform(0, 1)), reach * float(r.uniform(1.1, 2))
    if draw.chance(0.15):
        spec.fog = (draw.color(), float(r.uniform(0.02, 0.3)) / u)
    if draw.chance(0.15):
        spec.occlusion = (int(r.integers(1, 6)), draw.u(0.1, 0.6))
    spec.sky_light = draw.chance(0.3)
    if draw.chance(0.25):
        draw.tags.append("mirror")
        spec.bounces = int(r.integers(1, 3))
        for material in spec.materials[:: 2 if draw.chance(0.7) else 1]:
            for name in ("color", "shininess", "specular", "ambient"):
                material.pop(name, None)
            material |= {"albedo": draw.color(), "metalness": 1.0, "roughness": 0.0}
    spec.tags = tuple(sorted(set(draw.tags)))
    return spec


# What must be the same


def padded(values: NDArray[Any], by: int = 1) -> NDArray[Any]:
    """The values of a pixel and of its neighbours, (K, H, W, ...)."""
    h, w = values.shape[:2]
    edge = np.pad(values, ((by, by), (by, by), *((0, 0),) * (values.ndim - 2)), mode="edge")
    return np.array([edge[i : i + h, j : j + w] for i in range(2 * by + 1) for j in range(2 * by + 1)])


def beyond(a: NDArray[Any], b: NDArray[Any], slack: float) -> NDArray[np.bool_]:
    """Pixels of b outside of the range of a there and beside it."""
    around = padded(a)
    low, high = around.min(axis=0), around.max(axis=0)
    room = slack * np.maximum(1.0, np.abs(high))
    with np.errstate(invalid="ignore"):
        fits = (b >= low - room) & (b <= high + room)
    return np.asarray(~fits.reshape(*b.shape[:2], -1).all(axis=-1))


def apart(first: Frame, second: Frame, moved: Similarity, unit: float) -> dict[str, NDArray[np.bool_]]:
    """Pixels that differ, by what differs."""
    depth, other = first.depth.astype(np.float64) / unit, second.depth.astype(np.float64) / (unit * moved.factor)
    depth, other = np.where(np.isfinite(depth), depth, 1e9), np.where(np.isfinite(other), other, 1e9)
    color, shown = first.color.astype(np.float64), second.color.astype(np.float64)
    normal, turned = first.normal.astype(np.float64), second.normal.astype(np.float64) @ moved.matrix
    if moved.mirrored:
        other, shown, turned = other[:, ::-1], shown[:, ::-1], turned[:, ::-1]
    found = {}
    for name, a, b, slack in (
        ("depth", depth, other, 1e-3),
        ("color", np.log(np.maximum(color, 1e-3)), np.log(np.maximum(shown, 1e-3)), 0.05),
        ("normal", normal, turned, 0.05),
    ):
        found[name] = beyond(a, b, slack) | beyond(b, a, slack) | ~np.isfinite(b).reshape(*b.shape[:2], -1).all(axis=-1)
    return found


@dataclass
class Variant:
    """How a scene is drawn the second time."""

    spelling: int = 0
    plain: frozenset[str] = frozenset()
    moved: Similarity = Similarity()
    quality: dict[str, Any] = field(default_factory=dict)


def variants(seed: int, spec: Spec) -> list[Variant]:
    """Another spelling; the whole moved; other choices of Quality; all at once."""
    r = np.random.default_rng((seed, 5))

    def moved() -> Similarity:
        kind = r.integers(4)
        axis = tuple(map(float, r.normal(size=3)))
        if kind == 0:
            return Similarity(factor=float(r.choice([1e-3, 1e3, 0.37])))
        if kind == 1:
            return Similarity(angle=float(r.uniform(-3, 3)), axis=axis)
        if kind == 2:
            return Similarity(mirrored=True)
        away = float(10 ** r.uniform(0, 3)) * math.dist(spec.position, spec.target)
        return Similarity(offset=tuple(map(float, away * r.normal(size=3))))

    def quality() -> dict[str, Any]:
        return {
            "analytic": [None, True, False][r.integers(3)],
            "bounding_volumes": [None, True, False][r.integers(3)],
            "objects": str(r.choice(["auto", "text", "data"])),
            **({"tracer": str(r.choice(["plain", "relaxed", "enhanced", "bracketing"]))} if r.uniform() < 0.3 else {}),
        }

    return [
        Variant(spelling=int(r.integers(1, 10**6))),
        Variant(spelling=int(r.integers(1, 10**6)), moved=moved(), quality=quality()),
    ]


class Court:
    """Draws scenes. proofs : hits are also held against their proof."""

    def __init__(self, context: Context | None = None, proofs: bool = True) -> None:
        self.proofs = proofs
        self.renderer = Renderer(SIZE, context=context) if context else Renderer(SIZE)
        self.drawn = 0
        self.ended = 0  # pixels that are not compared, since the driver ended loops there

    def frame(self, spec: Spec, variant: Variant) -> Frame:
        spelling = Spelling([_material(made) for made in spec.materials], variant.spelling, variant.plain)
        scene = scene_of(spec.changed(quality={**spec.quality, **variant.quality}), spelling, variant.moved)
        self.renderer.forget()
        self.scene, self.chosen = scene, spelling.chosen
        with warnings.catch_warnings():
            warnings.filterwarnings("error", ".* compiling takes about")
            frame = self.renderer.render(scene, outputs=("color", "depth", "normal"), time=TIME)
        self.drawn += 1
        self.last = frame
        return frame

    def verdict(self, spec: Spec, variant: Variant, first: Frame | None = None) -> str | None:
        unit = max(math.dist(spec.position, spec.target), 1e-9)
        first = first or self.frame(spec, Variant())
        found = apart(first, self.frame(spec, variant), variant.moved, unit)
        if any(where.sum() > 3 for where in found.values()):
            ended = self.ended_loops(variant)
            self.ended += int(ended.sum())
            found = {name: where & ~padded(ended).any(axis=0) for name, where in found.items()}
        wrong = [f"{where.sum()} of {name}" for name, where in found.items() if where.sum() > 3]
        return ", ".join(wrong or self.contradicted()) or None

    def ended_loops(self, variant: Variant) -> NDArray[np.bool_]:
        """The pixels of the last picture, mirrored back, at which the driver ended loops."""
        ended = ended_loops(self.renderer.context, SIZE, self.scene, TIME)
        return ended[:, ::-1] if variant.moved.mirrored else ended

    def contradicted(self) -> list[str]:
        """What a proof says against the last picture."""
        return contradicted(self.scene, self.last, time=TIME) if self.proofs else []

    def close(self) -> None:
        self.renderer.close()


def smaller(spec: Spec) -> Iterator[Spec]:
    plain: dict[str, Any] = {"near": 0.0, "far": None, "height": None, "fog": None, "occlusion": None, "bounces": 0}
    yield from with_less(spec, {**plain, "sky_light": False}, ("shadow", "softness", "radius", "penumbra"))
    yield from with_plain_materials(spec, range(len(spec.materials)))


def shrunk(court: Court, spec: Spec, variant: Variant, tries: int = 80) -> tuple[Spec, Variant]:
    """The smallest scene, and the fewest other spellings, that still differ."""

    def fails(other: Spec, how: Variant) -> bool:
        try:
            return court.verdict(other, how) is not None
        except (RaymarchError, SceneWarning, ValueError):
            return False

    going = True
    while going and tries > 0:
        going = False
        for how in (replace(variant, moved=Similarity()), replace(variant, quality={}), replace(variant, spelling=0)):
            tries -= 1
            if how != variant and fails(spec, how):
                variant, going = how, True
        for other in smaller(spec):
            tries -= 1
            if tries <= 0:
                break
            if fails(other, variant):
                spec, going = other, True
                break
    court.frame(spec, variant)
    for path in list(court.chosen):
        how = replace(variant, plain=variant.plain | {path})
        if fails(spec, how):
            variant = how
    return spec, variant


def look(court: Court, seed: int, shrink: bool = True) -> str | None:
    """One scene; a report if its pictures differ, or if one of them is refused and the other is not."""
    spec = drawn(seed)
    try:
        first = court.frame(spec, Variant())
    except (RaymarchError, SceneWarning):
        return None
    if said := court.contradicted():
        return f"--- seed {seed} {spec.tags}: {', '.join(said)}\n{spec}"
    for variant in variants(seed, spec):
        try:
            wrong = court.verdict(spec, variant, first)
        except SceneWarning:
            continue
        except RaymarchError as error:
            if "instances" in str(error) or "is unbounded along" in str(error):  # half-spaces have no box
                continue
            return f"--- seed {seed}: one spelling is refused: {error}\n{spec}\n{variant}"
        if wrong:
            tags = spec.tags
            if shrink:
                spec, variant = shrunk(court, spec, variant)
            left = court.verdict(spec, variant)
            return f"--- seed {seed} {tags}: {wrong}; made smaller: {left}\n{spec}\n{variant}\n{court.chosen}"
    return None


def disagreements(seed: int, spellings: int = 4, count: int = 1500) -> tuple[int, list[str]]:
    """How many spellings of the solids of a scene were compared, and those whose field has another sign somewhere.

    Half of the `count` points are near the surface. Where a field is nearly 0 nothing is said.
    """
    spec, draw, compared, found = drawn(seed), Draw(seed), 0, []
    materials = [rm.Material()] * len(spec.materials)
    for tree in spec.trees:
        plain = Spelling(materials).node(tree)
        points = draw.unit * draw.random.uniform(-1.5, 1.5, (count // 2, 3))
        off = plain.distance(points) + 0.01 * draw.unit * draw.random.normal(size=len(points))
        points = np.concatenate([points, points - off[:, None] * plain.gradient(points)])
        known = plain.distance(points)
        for i in range(1, spellings + 1):
            spelling = Spelling(materials, seed * 100 + i)
            try:
                other = spelling.node(tree)
            except RaymarchError:  # such as a child that no longer fits its cell
                continue
            with bound({}, TIME):
                value = other.distance(points)
            compared += 1
            wrong = (known * value < 0) & (np.minimum(np.abs(known), np.abs(value)) > 1e-4 * draw.unit)
            if wrong.any():
                found.append(f"seed {seed}: {wrong.sum()} points, {tree}, {spelling.chosen}")
    return compared, found


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=float, default=60.0, help="CPU seconds of a scene; it is unfinished after them")
    parser.add_argument("--no-shrink", action="store_true")
    parser.add_argument("--sets", action="store_true", help="compare signs of fields at random points, not pictures")
    given = parser.parse_args(arguments)
    if given.sets:
        results = [disagreements(seed) for seed in range(given.seed, given.seed + given.scenes)]
        print("\n".join(line for _, found in results for line in found))
        print(
            f"{given.scenes} scenes, {sum(n for n, _ in results)} spellings, {sum(len(f) for _, f in results)} differ"
        )
        return 1 if any(found for _, found in results) else 0
    return pictures(range(given.seed, given.seed + given.scenes), given.each, not given.no_shrink)


def pictures(seeds: range, each: float, shrink: bool) -> int:
    """Print the scenes whose pictures differ, and every few scenes how many there are. each : CPU seconds of a scene,
    and of making it smaller."""
    tags, failed, late = Counter[str](), Counter[str](), list[int]()
    court, drawn_before, ended_before, wrong = Court(), 0, 0, 0

    def bounded(seed: int, smaller: bool) -> str | None:
        nonlocal court, drawn_before, ended_before
        try:
            with cpu_limit(each):
                return look(court, seed, smaller)
        except LateError:
            late.append(seed)
            drawn_before, ended_before = drawn_before + court.drawn, ended_before + court.ended
            court = Court()
            return None

    for done, seed in enumerate(seeds, 1):
        found = drawn(seed).tags
        tags.update(found)
        if report := bounded(seed, smaller=False):
            print(report, flush=True)
            wrong += 1
            failed.update(found)
            if shrink and (report := bounded(seed, smaller=True)):
                print(report, flush=True)
        if done % EVERY == 0 or done == len(seeds):
            said = f"{done} scenes, {drawn_before + court.drawn} pictures; {wrong} differ; unfinished: {late}"
            print(
                f"{said}; loops ended at {ended_before + court.ended} pixels; {time.process_time():.0f} s CPU",
                flush=True,
            )
    print(f"by tag {dict(tags)}, of which {dict(failed)}")
    court.close()
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
