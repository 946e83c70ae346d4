"""Random lit scenes, each pixel held against a renderer by brute force (tests/hard/brute.py), and against the proof of
its hit and of its hard shadows.

python -m tests.lab.lit --scenes 2000 [--seed 1] [--keep]

A scene is drawn as plain numbers, from which both the package's scene, as Python text, and the judge are made. One that
differs is made smaller, and printed as Python that shows it.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu import Frame, Renderer
from raymarch.scene.quality import SCHEDULES, TRACERS
from tests.hard.brute import FAMILIES, KINDS, Brute, Picture, Spec, Tree, around, distance, parts_of, shown
from tests.hard.proofs import contradicted
from tests.lab.long_runs import keep

SIZE = (33, 25)
OUTPUTS = ("color", "depth", "normal")
SECONDS = 3.0
"""The time at which scenes are drawn that depend on it."""

# As Python


class Text:
    """Numbers as text; some become parameters, or expressions of time, with the same values."""

    def __init__(self, moving: int) -> None:
        self.random = np.random.default_rng(moving) if moving else None
        self.params: dict[str, float] = {}
        self.horizon = math.inf

    def number(self, value: float, free: bool = False) -> str:
        """free : it may depend on time, which has no range, or be a parameter of any sign."""
        value = float(value)
        if self.random is None or self.random.uniform() < 0.5:
            return repr(value)
        if free and self.random.uniform() < 0.4:
            rate = 0.3 * (value or 1.0)
            return f"({value - rate * SECONDS!r} + {rate!r} * rm.time)"
        name = f"p{len(self.params)}"
        self.params[name] = value
        if free:
            return f"rm.Param({name!r}, {1.3 * value + 0.1!r})"
        return f"rm.Param({name!r}, {1.1 * value!r}, {0.5 * value!r}, {2.0 * value!r})"

    def vector(self, values: Any, free: bool = False) -> str:
        return f"({', '.join(self.number(v, free) if free else repr(float(v)) for v in values)})"

    def node(self, tree: Tree) -> str:
        kind = tree[0]
        if kind == "sphere":
            return f"rm.sphere({self.number(tree[1])})"
        if kind == "box":
            return f"rm.box({self.vector(tree[1])})"
        if kind == "plane":
            return f"rm.plane({self.vector(tree[1])}, {self.number(tree[2], True)})"
        if kind in ("torus", "cylinder"):
            return f"rm.{kind}({tree[1]!r}, {tree[2]!r})"
        if kind == "capsule":
            return f"rm.capsule({self.vector(tree[1])}, {self.vector(tree[2])}, {self.number(tree[3])})"
        if kind in ("union", "intersection", "difference"):
            children = ", ".join(self.node(child) for child in tree[3:])
            how = f", k={self.number(tree[1])}, blend={tree[2]!r}" if tree[1] else ""
            return f"rm.{kind}({children}{how})"
        if kind == "repeat":  # what is repeated must fit its cell over the whole range of its parameters
            child = Text(0).node(tree[3])
            return f"{child}.repeat({tree[1]!r}, {tree[2]!r})"
        child = self.node(tree[-1])
        if kind == "move":
            near = math.hypot(*tree[1]) < self.horizon  # with a parameter that has no range, rays end at the horizon
            return f"{child}.translate({self.vector(tree[1], True) if near else repr(tuple(tree[1]))})"
        if kind == "turn":
            return f"{child}.rotate({self.number(tree[1], True)}, {self.vector(tree[2])})"
        if kind == "scale":
            return f"{child}.scale({self.number(tree[1])})"
        if kind == "mirror":
            return f"{child}.mirror({tree[1]!r})"
        if kind == "visible":
            return f"{child}.visible({', '.join(f'{rays}=False' for rays in tree[1].split())})"
        return f"{child}.material(m{tree[1]})"

    def material(self, material: dict[str, Any]) -> str:
        parts = []
        for name, value in material.items():
            if name == "mirror":
                parts.append(f"albedo={tuple(value)!r}, metalness=1.0, roughness=0.0")
            elif name == "color" and value[0] == "checker":
                parts.append(f"color=rm.checker({tuple(value[1])!r}, {tuple(value[2])!r}, {value[3]!r})")
            else:
                parts.append(f"{name}={value!r}")
        return f"rm.Material({', '.join(parts)})"

    def light(self, light: dict[str, Any]) -> str:
        name = {"sun": "Sun", "point": "PointLight", "spot": "SpotLight"}[light["kind"]]
        parts = []
        called = {"direction": "sun_direction"} if name == "Sun" else {"angle": "half_angle"}
        for key, value in light.items():
            if key in ("position", "direction"):
                parts.append(f"{called.get(key, key)}={self.vector(value, True)}")
            elif key == "intensity":
                parts.append(f"{key}={self.number(value)}")
            elif key != "kind":
                parts.append(f"{called.get(key, key)}={value!r}")
        return f"rm.{name}({', '.join(parts)})"

    def scene(self, spec: Spec) -> str:
        """A program that leaves `scene`."""
        lines = ["import raymarch as rm", ""]
        self.horizon = 1e3 * math.dist(spec.position, spec.target)
        lines += [f"m{i} = {self.material(material)}" for i, material in enumerate(spec.materials)]
        nodes = [self.node(tree) for tree in spec.trees]
        lines.append(f"node = {nodes[0] if len(nodes) == 1 else 'rm.union(' + ', '.join(nodes) + ')'}")
        lens = f"fov={spec.fov!r}"
        if spec.height is not None:
            lens = f"projection='orthographic', height={self.number(spec.height)}"
        if spec.near or math.isfinite(spec.far):
            lens += f", near={self.number(spec.near)}, far={self.number(spec.far)}"
        lines.append(f"camera = rm.Camera({self.vector(spec.position, True)}, {self.vector(spec.target)}, {lens})")
        lines.append(f"lights = [{', '.join(self.light(light) for light in spec.lights)}]")
        rest = [f"sky=rm.Sky({tuple(spec.sky)!r}, light={spec.sky_light})"]
        if spec.fog is not None:
            color, density, falloff, height = spec.fog
            layer = f", {self.number(falloff)}, {self.number(height, True)}" if falloff else ""
            rest.append(f"fog=rm.Fog({color!r}, {self.number(density)}{layer})")
        if spec.occlusion is not None:
            rest.append(f"occlusion=rm.AmbientOcclusion{spec.occlusion!r}")
        quality = ", ".join(f"{name}={value!r}" for name, value in {"max_steps": 2048, **spec.quality}.items())
        if spec.bounces:
            rest.append(f"bounces={spec.bounces}")
            quality += ", integrator='whitted'"
        lines.append(f"scene = rm.Scene(node, camera, lights, {', '.join(rest)}, quality=rm.Quality({quality}))")
        return "\n".join(lines) + "\n"


def program(spec: Spec) -> tuple[str, dict[str, float]]:
    """A scene as Python, and the values of its parameters."""
    text = Text(spec.moving)
    return text.scene(spec), text.params


def scene_of(spec: Spec) -> tuple[rm.Scene, dict[str, float]]:
    text, params = program(spec)
    names: dict[str, Any] = {}
    exec(compile(text, f"<scene {spec.tags}>", "exec"), names)
    return names["scene"], params


# Random scenes


class Draw:
    """The parts of a random scene, in a unit of length of its own."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.unit = 10.0 ** self.random.uniform(-3, 3) if self.chance(0.4) else 1.0
        self.materials: list[dict[str, Any]] = []
        self.tags: list[str] = []

    def chance(self, share: float) -> bool:
        return bool(self.random.uniform() < share)

    def one(self, *of: Any) -> Any:
        return of[self.random.integers(len(of))]

    def length(self, low: float, high: float) -> float:
        return self.unit * float(self.random.uniform(low, high))

    def far(self, low: float, high: float) -> float:
        """A length, evenly drawn by its order of magnitude."""
        return self.unit * float(10.0 ** self.random.uniform(math.log10(low), math.log10(high)))

    def color(self) -> tuple[float, ...]:
        return tuple(round(float(c), 3) for c in self.random.uniform(0.1, 1.0, 3))

    def direction(self, least: float = 0.15) -> np.ndarray[Any, Any]:
        """A unit vector that points up by at least so much."""
        while True:
            v = self.random.normal(size=3)
            v /= np.linalg.norm(v)
            if v[1] > least:
                return np.asarray(v)

    def paint(self, tree: Tree, pattern: Any = None) -> Tree:
        made: dict[str, Any] = {"color": pattern or self.color()}
        if self.chance(0.5):
            made["shininess"] = float(self.one(4.0, 16.0, 64.0))
            made["specular"] = float(self.one(0.0, 0.2, 0.8))
        if self.chance(0.3):
            made["ambient"] = float(self.one(0.0, 0.3))
        self.materials.append(made)
        return ("paint", len(self.materials) - 1, tree)

    def leaf(self) -> Tree:
        u = self.length
        kind = self.random.integers(5)
        if kind == 0:
            return ("sphere", u(0.2, 0.6))
        if kind == 1:
            return ("box", (u(0.3, 0.9), u(0.3, 0.9), u(0.3, 0.9)))
        if kind == 2:
            return ("torus", u(0.3, 0.5), u(0.08, 0.2))
        if kind == 3:
            return ("cylinder", u(0.15, 0.4), u(0.3, 0.9))
        return ("capsule", (0.0, u(-0.4, -0.2), 0.0), (u(-0.2, 0.2), u(0.2, 0.4), 0.0), u(0.1, 0.25))

    def blend(self) -> tuple[float, str]:
        return self.length(0.05, 0.5), str(self.one(*FAMILIES))

    def placed(self, tree: Tree) -> Tree:
        if self.chance(0.6):
            tree = ("turn", float(self.random.uniform(-3, 3)), tuple(map(float, self.direction(-1.0))), tree)
        if self.chance(0.2):
            tree = ("scale", float(self.random.uniform(0.5, 1.5)), tree)
        return tree

    def moved(self, tree: Tree, reach: float = 0.4) -> Tree:
        return ("move", tuple(self.length(-reach, reach) for _ in range(3)), tree)

    def solid(self, depth: int = 2) -> Tree:
        kind = self.random.integers(8) if depth else 0
        if kind <= 1:
            return self.paint(self.placed(self.leaf()))
        if kind == 2:
            return self.symmetric()
        first, second = self.solid(depth - 1), self.moved(self.solid(depth - 1))
        if kind == 3:
            return ("union", *self.blend(), first, second)
        if kind == 4:
            tool = self.moved(self.placed(self.leaf())) if self.chance(0.5) else second
            return ("difference", *(self.blend() if self.chance(0.5) else (0.0, "quadratic")), first, tool)
        if kind == 5:
            body = self.paint(("box", (self.unit, self.length(0.5, 1), self.unit)))
            return ("intersection", *(self.blend() if self.chance(0.5) else (0.0, "quadratic")), body, first)
        if kind == 6:
            counts = tuple(int(self.random.integers(1, 4)) for _ in range(3))
            part = self.paint(self.placed(self.leaf()))
            spacing = 4.0 * around(part)[1]  # its box may be larger than its ball
            return ("scale", 0.3, ("repeat", (spacing, None, spacing), (counts[0], None, counts[2]), part))
        return ("mirror", self.one("x", "z"), ("move", (self.length(0.1, 0.5), 0.0, 0.0), first))

    def symmetric(self) -> Tree:
        """Two parts, the images of each other in the plane x = 0, that meet there in a blend."""
        self.tags.append("symmetry")
        leaf = self.leaf()
        if leaf[0] == "capsule":
            leaf = ("sphere", self.length(0.3, 0.6))
        angle, aside = float(self.random.uniform(-1, 1)), self.length(0.15, 0.5)
        up = self.length(-0.1, 0.1)
        right = ("move", (aside, up, 0.0), ("turn", angle, (0.0, 0.0, 1.0), leaf))
        left = ("move", (-aside, up, 0.0), ("turn", -angle, (0.0, 0.0, 1.0), leaf))
        kind = self.one("union", "union", "intersection", "difference")
        blend = self.blend()
        if kind == "union":
            both: Tree = ("union", *blend, self.paint(left), self.paint(right))
        elif kind == "intersection":
            both = ("intersection", *blend, self.paint(left), self.paint(right))
            if aside > self.length(0.2, 0.2):
                both = ("union", *both[1:])
        else:
            body = ("box", (self.length(1.0, 1.4), self.length(0.3, 0.6), self.length(0.4, 0.8)))
            both = ("difference", *blend, self.paint(body), ("union", *blend, left, right))
        return both

    def floor(self) -> Tree:
        u = self.length
        height = float(self.one(0.0, 0.0, -0.5, -1.0)) * self.unit if self.chance(0.7) else u(-1.0, 0.0)
        size = u(0.3, 1.0)
        pattern: Any = None
        if self.chance(0.6):
            pattern = ("checker", self.color(), self.color(), size)
            if self.chance(0.5):  # exactly between two layers of cells
                self.tags.append("border")
                height = -(int(self.random.integers(0, 3)) + 0.25) * size
                if self.chance(0.5):
                    pattern, height = (*pattern[:3], 0.8 * self.unit), -1.0 * self.unit
        if self.chance(0.6):
            made: Tree = ("plane", (0.0, 1.0, 0.0), height)
        else:
            made = ("box", (20.0 * self.unit, 2.0 * self.unit, 20.0 * self.unit))
            if pattern is None:
                made = ("move", (0.0, height - self.unit, 0.0), made)
            else:  # the pattern stays where it was
                return self.paint(("move", (0.0, height - self.unit, 0.0), made), pattern)
        return self.paint(made, pattern)

    def light(self, bright: float) -> dict[str, Any]:
        """A light whose brightness at the middle of the scene is as told."""
        made: dict[str, Any] = {"shadow": self.chance(0.75)}
        if self.chance(0.4):
            made["color"] = self.color()
        kind = self.one("sun", "point", "point", "spot")
        towards = self.direction()
        if kind == "sun":
            return {"kind": kind, "direction": tuple(map(float, towards)), "intensity": bright, **made}
        away = self.far(0.3, 1e5) if self.chance(0.8) else self.far(0.03, 0.3)
        made["position"] = tuple(map(float, away * towards))
        made["intensity"] = bright * away**2
        if self.chance(0.2):
            made["range"] = away * float(self.random.uniform(1.3, 4.0))
        if self.chance(0.15):
            made["attenuation"] = (
                1.0,
                float(self.random.uniform(0, 1) / away),
                float(self.random.uniform(0.1, 1) / away**2),
            )
            made["intensity"] = bright
        if kind == "spot":
            aim = self.random.normal(size=3) * 0.2 * min(away, self.unit) - away * towards
            made["direction"] = tuple(map(float, aim / np.linalg.norm(aim)))
            made["angle"] = float(self.random.uniform(0.1, 1.2))
            made["blend"] = float(self.one(0.0, 0.2, 1.0))
        return {"kind": kind, **made}

    def quality(self) -> dict[str, Any]:
        """Settings that must not change the picture."""
        made: dict[str, Any] = {}
        if self.chance(0.3):
            made["tracer"] = self.one(*(name for name in TRACERS if name not in ("auto", "advance")))
        if self.chance(0.3):
            made["schedule"] = self.one(*(name for name in SCHEDULES if name != "auto"))
        if self.chance(0.15):
            made["rays"] = "interpolated"
        if self.chance(0.15):
            made["steps_per_pass"] = int(self.random.integers(4, 40))
        if self.chance(0.1) and made.get("tracer", "plain") == "plain":
            made |= {self.one("step_scale", "step_variation"): 0.7, "max_steps": 8192}
        if self.chance(0.15):
            made["objects"] = "data"
        if self.chance(0.2):
            made["bounding_volumes"] = True
        if self.chance(0.2):
            made["analytic"] = self.one(True, False)
        return made

    def occluder(self, light: dict[str, Any]) -> Tree | None:
        """A solid between the middle of the scene and a light, far or near."""
        if light["kind"] == "sun":
            towards, room = np.array(light["direction"]), 1e5 * self.unit
        else:
            place = np.array(light["position"])
            room = float(np.linalg.norm(place))
            towards, room = place / room, 0.8 * room
        if room < 10 * self.unit:
            return None
        away = min(self.far(20, 1e5), room)
        wide = self.length(1.0, 5.0) if self.chance(0.5) else away * float(self.random.uniform(0.05, 0.3))
        self.tags.append("far occluder")
        shape: Tree = self.one(("sphere", wide), ("box", (wide, wide, wide)), ("torus", wide, 0.4 * wide))
        return ("move", tuple(map(float, away * towards)), self.paint(shape))


def drawn(seed: int) -> Spec:
    """A random scene."""
    draw = Draw(seed)
    random = draw.random
    trees: list[Tree] = [draw.floor()] if draw.chance(0.85) else []
    symmetric = draw.chance(0.3)
    if symmetric:
        trees.append(("move", (0.0, draw.length(0.0, 0.5), 0.0), draw.symmetric()))
    else:
        trees += [draw.moved(draw.solid(int(random.integers(0, 3))), 1.0) for _ in range(random.integers(1, 3))]
    if draw.chance(0.2):  # two boxes with a common face
        draw.tags.append("touching")
        a, b = draw.length(0.3, 0.8), draw.length(0.3, 0.8)
        low = ("box", (a, a, a)), ("box", (b, b, b))
        x, z = draw.length(-1, 1), draw.length(-1, 1)
        trees.append(("move", (x, 0.0, z), draw.paint(low[0])))
        trees.append(("move", (x + 0.5 * (a + b), 0.0, z), draw.paint(low[1])))
    lights = [draw.light(float(random.uniform(0.4, 1.2))) for _ in range(random.integers(1, 4))]
    if draw.chance(0.4):
        lights[0]["shadow"] = True
        far = draw.occluder(lights[0])
        trees += [far] if far else []
    bounces = 0
    if draw.chance(0.15):
        draw.tags.append("mirror")
        bounces = 2
        draw.materials.append({"mirror": draw.color()})
        mirror: Tree = draw.one(("sphere", draw.length(0.3, 0.6)), ("box", (draw.length(0.5, 1.5),) * 3))
        trees.append(draw.moved(("paint", len(draw.materials) - 1, draw.placed(mirror)), 1.0))
    away = draw.length(2.0, 5.0) * (1.0 if draw.chance(0.8) else draw.one(0.5, 10.0))
    if symmetric or draw.chance(0.2):
        position = (0.0, 0.4 * away * float(random.uniform(0, 1)), away)
        target = (0.0, 0.0, 0.0)
    else:
        towards = draw.direction(0.02)
        position = tuple(map(float, away * towards))
        target = tuple(draw.length(-0.2, 0.2) for _ in range(3))
    fov = (
        float(draw.one(20.0, 45.0, 70.0))
        if draw.chance(0.5 if "far occluder" in draw.tags else 0.85)
        else float(random.uniform(0.5, 5.0))
    )
    spec = Spec(trees, draw.materials, lights, position, target, fov, draw.color(), draw.chance(0.3), bounces=bounces)
    if draw.chance(0.15):
        spec.fog = (draw.color(), float(random.uniform(0.02, 0.3)) / draw.unit, 0.0, 0.0)
    if draw.chance(0.15):
        spec.occlusion = (int(random.integers(1, 6)), draw.length(0.1, 0.8), float(random.uniform(0.5, 1.5)), 0.75)
    if draw.chance(0.25):
        draw.tags.append("moving")
        spec.moving = seed + 1
    if draw.unit != 1.0:
        draw.tags.append("scaled")
    if draw.chance(0.25):
        draw.tags.append("orthographic")
        spec.height = 2.0 * math.tan(math.radians(fov) / 2.0) * away
    if draw.chance(0.2):
        draw.tags.append("clipped")
        reach = math.dist(position, target)
        spec.near, spec.far = reach * float(random.uniform(0.0, 1.0)), reach * float(random.uniform(1.0, 2.0))
    spec.quality = draw.quality()
    _hide(spec, draw, np.random.default_rng((seed, 1)))
    spec.tags = tuple(sorted(set(draw.tags)))
    if blocked(spec):
        return drawn(seed + 1_000_003)
    return spec


def _hide(spec: Spec, draw: Draw, random: np.random.Generator) -> None:
    """Fog in a layer, and solids hidden from kinds of rays."""
    if spec.fog is None and random.uniform() < 0.15:
        draw.tags.append("layered fog")
        density, falloff = 10.0 ** random.uniform((-2.0, -1.0), (0.5, 1.0)) / draw.unit
        color = None if random.uniform() < 0.3 else tuple(round(float(c), 3) for c in random.uniform(0.1, 1.0, 3))
        spec.fog = (color, float(density), float(falloff), float(draw.unit * random.uniform(-1.0, 1.0)))
    if random.uniform() < 0.3:
        draw.tags.append("hidden")
        for _ in range(random.integers(1, 3)):
            i = int(random.integers(len(spec.trees)))
            kinds = " ".join(rays for rays in KINDS if random.uniform() < 0.5)
            spec.trees[i] = _hidden(spec.trees[i], kinds or "shadow", random)


def _hidden(tree: Tree, kinds: str, random: np.random.Generator) -> Tree:
    """A tree of which a drawn part is hidden."""
    places = [i for i, c in enumerate(tree) if isinstance(c, tuple) and c and isinstance(c[0], str)]
    if tree[0] == "repeat" or not places or random.uniform() < 0.4:
        return ("visible", kinds, tree)
    place = int(random.choice(places))
    return (*tree[:place], _hidden(tree[place], kinds, random), *tree[place + 1 :])


def blocked(spec: Spec) -> bool:
    """True if the camera or a light lies in a solid or nearly on one."""
    scale = math.dist(spec.position, spec.target)
    places = [(spec.position, 0.02 * scale)]
    places += [
        (light["position"], 1e-3 * math.hypot(*light["position"])) for light in spec.lights if "position" in light
    ]
    return any(
        distance(part.tree, np.array([place], float))[0] < least
        for place, least in places
        for kind in KINDS
        for part in parts_of([shown(tree, kind) for tree in spec.trees])
    )


# Disagreements


@dataclass
class Difference:
    """Pixels that differ, by what is wrong with them."""

    kinds: Counter[str]
    example: str

    @property
    def pixels(self) -> int:
        return self.kinds.total()

    def __str__(self) -> str:
        return f"{dict(self.kinds)}; {self.example}"


def differences(spec: Spec, judge: Picture, frame: Frame) -> Difference | None:
    """What of a frame the judge cannot agree with, away from what is uncertain."""
    color, depth, normal = (frame.array(name).astype(np.float64) for name in OUTPUTS)
    certain = judge.certain & ~(np.isfinite(judge.t) & (judge.t > 2e3 * math.dist(spec.position, spec.target)))
    kinds: Counter[str] = Counter()
    example = ""
    hit = np.isfinite(judge.t)

    def note(wrong: Any, name: str, said: Any, right: Any) -> None:
        nonlocal example
        if wrong.any():
            kinds[name] += int(wrong.sum())
            y, x = np.argwhere(wrong)[0]
            example = example or f"{name} at row {y}, column {x}: {said[y, x]} where {right[y, x]} is right"

    lost = certain & (np.isfinite(depth) != hit)
    note(lost, "hit", depth, judge.t)
    both = certain & hit & ~lost
    eye = np.abs(spec.position).max()
    t = np.where(both, judge.t, 1.0)
    with np.errstate(invalid="ignore"):
        wide = t * math.radians(spec.fov) if spec.height is None else spec.height
        slack = 0.3 * judge.apart + 3e-6 * (t + eye) + 0.01 * wide / SIZE[1]
        deep = both & ~(np.abs(depth - judge.t) <= slack)
    note(deep, "depth", depth, judge.t)
    both &= ~deep
    tilted = both & ~(np.linalg.norm(normal - judge.normal, axis=-1) <= 0.02 + judge.turned)
    note(tilted, "normal", normal, judge.normal)
    rest = certain & ~lost & ~deep & ~tilted
    off = [_off(color, c, span) for c, span in zip(judge.color, judge.span, strict=True)]
    chosen = _side(judge, off)
    wrong = rest & np.where(chosen, off[1], off[0])
    right = np.where(chosen[..., None], judge.color[1], judge.color[0])
    if wrong.any():
        pattern = wrong & ~(off[0] & off[1])
        note(pattern, "pattern", color, right)
        wrong &= ~pattern
        for i, light in enumerate(judge.flipped):
            shadow = wrong & ~_off(color, np.where(chosen[..., None], light[1], light[0]), judge.span[0])
            note(shadow, f"shadow of light {i}", color, right)
            wrong &= ~shadow
        note(wrong, "color", color, right)
    return Difference(kinds, example) if kinds else None


def _off(color: Any, right: Any, span: Any) -> Any:
    allowed = 4e-3 * np.maximum(1.0, np.abs(right).max(axis=-1)) + 0.6 * span
    return ~(np.abs(color - right).max(axis=-1) <= allowed)


def _side(judge: Picture, off: list[Any]) -> Any:
    """Where surfaces lie exactly between two cells of a pattern, either side is right, but it must be one for all of a
    surface: that of which fewer pixels differ. True for the outer one."""
    chosen = np.zeros(judge.t.shape, bool)
    between = np.any(judge.color[0] != judge.color[1], axis=-1)
    if not between.any():
        return chosen
    facing = np.round(np.nan_to_num(judge.normal) * 4).astype(int) @ (1, 20, 400) + 100_000 * judge.part
    for group in np.unique(facing[between]):
        rows = between & (facing == group) & judge.certain
        chosen |= between & (facing == group) & bool((rows & off[1]).sum() < (rows & off[0]).sum())
    return chosen


# The run


class Court:
    """Two renderers, which draw in turns, and the judges. proofs : with the proof as the second one."""

    def __init__(self, renderers: int = 2, context: Any = None, proofs: bool = True) -> None:
        self.proofs = proofs
        self.renderers = [Renderer(SIZE, context=context) if context else Renderer(SIZE) for _ in range(renderers)]
        self.turn = 0

    def draw(self, spec: Spec) -> Frame:
        scene, params = scene_of(spec)
        self.turn = (self.turn + 1) % len(self.renderers)
        renderer = self.renderers[self.turn]
        renderer.forget()
        return renderer.render(scene, outputs=OUTPUTS, params=params, time=SECONDS if spec.moving else 0.0)

    def verdict(self, spec: Spec) -> Difference | None:
        """A scene drawn with constants; and with parameters and time if it has any."""
        judge = Brute(spec, SIZE).picture()
        found = self._judged(judge, spec.changed(moving=0))
        if found is None and spec.moving:
            found = self._judged(judge, spec)
            if found is not None:
                found.kinds["only as parameters"] += 1
        return found

    def _judged(self, judge: Picture, spec: Spec) -> Difference | None:
        frame = self.draw(spec)
        found = differences(spec, judge, frame)
        if found is None and self.proofs:
            scene, params = scene_of(spec)
            said = contradicted(scene, frame, params, SECONDS if spec.moving else 0.0, shadows=True)
            found = Difference(Counter({"proof": len(said)}), said[0]) if said else None
        return found

    def close(self) -> None:
        for renderer in self.renderers:
            renderer.close()


def smaller(spec: Spec) -> Iterator[Spec]:
    """Simpler scenes."""
    plain: dict[str, Any] = {"near": 0.0, "far": math.inf, "height": None}
    plain |= {"moving": 0, "fog": None, "occlusion": None, "sky_light": False}
    if not any("mirror" in m for m in spec.materials):
        plain["bounces"] = 0
    yield from with_less(spec, plain, ("color", "range", "attenuation", "shadow"))
    for name in spec.quality:
        yield spec.changed(quality={key: value for key, value in spec.quality.items() if key != name})
    used = {i for tree in spec.trees for i in painted(tree)}
    yield from with_plain_materials(spec, [i for i in sorted(used) if "mirror" not in spec.materials[i]])


def with_less(spec: Any, plain: dict[str, Any], keys: Sequence[str]) -> Iterator[Any]:
    """Scenes with a tree, a light, an operator or a value of a light less, or with a plain value. keys : of lights."""
    for i in range(len(spec.trees) if len(spec.trees) > 1 else 0):
        yield spec.changed(trees=spec.trees[:i] + spec.trees[i + 1 :])
    for i in range(len(spec.lights)):
        yield spec.changed(lights=spec.lights[:i] + spec.lights[i + 1 :])
    for name, value in plain.items():
        if getattr(spec, name) != value:
            yield spec.changed(**{name: value})
    for i, tree in enumerate(spec.trees):
        for other in simpler(tree):
            yield spec.changed(trees=[*spec.trees[:i], other, *spec.trees[i + 1 :]])
    for i, light in enumerate(spec.lights):
        for key in keys:
            if light.get(key):
                made = {k: v for k, v in light.items() if k != key}
                yield spec.changed(lights=[*spec.lights[:i], made, *spec.lights[i + 1 :]])


def with_plain_materials(spec: Any, numbers: Sequence[int]) -> Iterator[Any]:
    """Scenes in which one of some materials is plain."""
    for i in numbers:
        if spec.materials[i] != {"color": (0.8, 0.8, 0.8)}:
            yield spec.changed(materials=[*spec.materials[:i], {"color": (0.8, 0.8, 0.8)}, *spec.materials[i + 1 :]])


def painted(tree: Tree) -> list[int]:
    own = [tree[1]] if tree[0] == "paint" else []
    return own + [
        i for child in tree if isinstance(child, tuple) and child and isinstance(child[0], str) for i in painted(child)
    ]


def simpler(tree: Tree) -> Iterator[Tree]:
    """A tree with one operator left out somewhere."""
    for place, child in enumerate(tree):
        if not (isinstance(child, tuple) and child and isinstance(child[0], str)):
            continue
        yield child
        for other in simpler(child):
            yield (*tree[:place], other, *tree[place + 1 :])


def without_unused(spec: Spec) -> Spec:
    """Only the materials that some tree names."""
    used = sorted({i for tree in spec.trees for i in painted(tree)})

    def renamed(tree: Tree) -> Tree:
        made = tuple(renamed(c) if isinstance(c, tuple) and c and isinstance(c[0], str) else c for c in tree)
        return ("paint", used.index(tree[1]), *made[2:]) if tree[0] == "paint" else made

    return spec.changed(trees=[renamed(tree) for tree in spec.trees], materials=[spec.materials[i] for i in used])


def shrunk(spec: Spec, fails: Callable[[Spec], bool], tries: int = 60) -> Spec:
    """The smallest scene found that still fails."""
    while tries > 0:
        for other in smaller(spec):
            tries -= 1
            if tries <= 0:
                break
            if fails(other):
                spec = other
                break
        else:
            break
    return without_unused(spec)


@dataclass
class Report:
    """What one scene showed."""

    seed: int
    spec: Spec
    found: str
    kinds: Counter[str]

    def __str__(self) -> str:
        text, params = program(self.spec)
        call = f"rm.Renderer({SIZE}).render(scene, params={params}, time={SECONDS})"
        return f"--- seed {self.seed} {self.spec.tags}: {self.found}\n{text}# {call}"


def look(court: Court, seed: int, shrinks: Callable[[str], bool] = lambda kind: True) -> Report | None:
    """One scene; a report if it differs. shrinks : whether one with this fault is made smaller."""
    spec = drawn(seed)
    try:
        found = court.verdict(spec)
    except RaymarchError as error:
        return Report(seed, spec, f"{type(error).__name__}: {error}", Counter({"refused": 1}))
    if found is None:
        return None
    main = found.kinds.most_common(1)[0][0].split(" of light")[0]
    if shrinks(main):

        def fails(other: Spec) -> bool:
            try:
                shown = court.verdict(other)
            except (RaymarchError, ValueError):
                return False
            return shown is not None and any(kind.startswith(main) for kind in shown.kinds)

        spec = shrunk(spec, fails)
        found = court.verdict(spec) or found
    return Report(seed, spec, str(found), found.kinds)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--small", type=int, default=3, help="how many scenes of each kind of fault are made smaller")
    parser.add_argument("--keep", action="store_true", help="put the figures into docs/figures/long_runs.json")
    given = parser.parse_args(arguments)
    kinds: Counter[str] = Counter()
    tags: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    seeds = []
    court = Court()
    begun = time.monotonic()
    for seed in range(given.seed, given.seed + given.scenes):
        report = look(court, seed, lambda kind: kinds[kind] < given.small)
        found = drawn(seed).tags
        tags.update(found)
        if report is not None:
            print(report, flush=True)
            seeds.append(seed)
            kinds.update({kind.split(" of light")[0] for kind in report.kinds})
            failed.update(found)
        if (seed - given.seed) % 100 == 99:
            print(f"{seed - given.seed + 1} scenes, {len(seeds)} differ", flush=True)
    court.close()
    print(f"{given.scenes} scenes; {len(seeds)} differ: seeds {seeds}")
    print(f"kinds {dict(kinds)}; scenes by tag {dict(tags)}, of which differ {dict(failed)}")
    print(f"{time.monotonic() - begun:.0f} s", file=sys.stderr)
    if given.keep:
        keep(
            "lit",
            **{
                "random lit scenes": given.scenes,
                "size of each picture": "x".join(map(str, SIZE)),
                "scenes that differ": len(seeds),
            },
        )
    return 1 if seeds else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
