"""Scenes that must look the same as a scene, or as it was told: metamorphic relations.

Each takes a scene and gives a frame of another one, brought back to the first: its depths may then be judged by the
first one's truth; where both must be the same bit for bit, that is checked as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.gpu import Frame
from raymarch.gpu.tiles import tiles_of
from raymarch.scene.parameter import Values
from raymarch.sdf import transform
from raymarch.sdf.node import METHODS
from tests.hard.world import ULP, World, bytes_off

OUTPUTS = ("color", "depth", "normal", "iterations", "evaluations", "material")

MARCHED = ("depth", "iterations")


@dataclass
class Seen:
    """A scene with its frame, and what a relation needs to draw others."""

    world: World
    scene: rm.Scene
    size: tuple[int, int]
    frame: Frame
    seed: int

    def draw(self, scene: rm.Scene, outputs: Sequence[str] = OUTPUTS) -> Frame:
        return self.world.draw(scene, self.size, outputs)

    def marched(self, scene: rm.Scene) -> Frame:
        """Depths alone: half the compilation."""
        return self.draw(scene, MARCHED)

    def other(self, node: rm.Node | None = None, **parts: Any) -> rm.Scene:
        """The scene with some of its parts in the place of others."""
        return self.scene.replace(**parts if node is None else {**parts, "node": node})

    def quality(self, **settings: Any) -> rm.Scene:
        return self.other(quality=replace(self.scene.quality, **settings))


Verdict = tuple[NDArray[Any] | None, NDArray[Any] | None, list[str]]
"""Depths for the first scene's truth, the iterations, and what is wrong already."""
Relation = Callable[[Seen], Verdict]
RELATIONS: dict[str, Relation] = {}


def relation(make: Relation) -> Relation:
    RELATIONS[make.__name__] = make
    return make


def _judged(frame: Frame, factor: float = 1.0) -> Verdict:
    return frame.depth / factor, frame.iterations, []


def _same(seen: Seen, frame: Frame, *names: str, ulps: float = 0.0) -> Verdict:
    wrong = []
    for name in names or ("depth", "normal", "color"):
        a, b = seen.frame.array(name).astype(np.float64), frame.array(name).astype(np.float64)
        with np.errstate(invalid="ignore"):
            apart = (a != b) & ~(np.abs(a - b) <= ulps * ULP * np.maximum(np.abs(a), 1.0))
        if apart.any():
            wrong.append(
                f"{apart.sum()} values of {name} differ, {np.nanmax(np.abs(np.where(apart, a - b, 0))):.3g} at most"
            )
    return None, None, wrong


# The same field


@relation
def united_with_itself(seen: Seen) -> Verdict:
    return _same(seen, seen.draw(seen.other(seen.scene.node | seen.scene.node)))


@relation
def cut_with_itself(seen: Seen) -> Verdict:
    return _same(seen, seen.draw(seen.other(seen.scene.node & seen.scene.node)))


@relation
def copied(seen: Seen) -> Verdict:
    """Every node made anew."""

    def rebuilt(node: rm.Node) -> rm.Node:
        children = tuple(rebuilt(child) for child in node.children)
        facts = node.definition.derive(children, node.params)
        return type(node)(node.definition, children, node.params, facts, node.label)

    return _same(seen, seen.draw(seen.other(rebuilt(seen.scene.node))))


@relation
def drawn_again(seen: Seen) -> Verdict:
    return _same(seen, seen.draw(seen.scene))


@relation
def operands_in_another_order(seen: Seen) -> Verdict:
    ball = rm.sphere(0.2)
    one, two = (seen.marched(seen.other(node)) for node in (seen.scene.node | ball, ball | seen.scene.node))
    wrong = int(np.sum(one.depth != two.depth))
    return None, None, [f"{wrong} depths depend on the order"] if wrong else []


@relation
def complement_of_the_complement(seen: Seen) -> Verdict:
    return _judged(seen.marched(seen.other(seen.scene.node.complement().complement())))


@relation
def moved_and_back(seen: Seen) -> Verdict:
    return _judged(seen.marched(seen.other(seen.scene.node.translate((0.3, -0.7, 0.2)).translate((-0.3, 0.7, -0.2)))))


@relation
def turned_and_back(seen: Seen) -> Verdict:
    node = seen.scene.node.rotate(0.7, (1, 2, 3)).rotate(-0.7, (1, 2, 3))
    return _judged(seen.marched(seen.other(node)))


@relation
def in_a_box_that_holds_it(seen: Seen) -> Verdict:
    low, high = seen.scene.node.bounds
    room = rm.box(tuple(1.5 * np.maximum(high - low, 0.0) + 0.1)).translate(tuple(0.5 * (low + high)))
    return _judged(seen.marched(seen.other(seen.scene.node & room)))


@relation
def with_a_ball_out_of_sight(seen: Seen) -> Verdict:
    """Behind the camera: the box of the scene is another."""
    pose = seen.scene.pose(Values({}))
    behind = pose.position + 3.0 * np.linalg.norm(pose.position) * pose.frame[:, 2] + pose.frame[:, 2]
    camera = rm.Camera(
        tuple(pose.position), tuple(pose.position - pose.frame[:, 2]), tuple(pose.frame[:, 1]), seen.scene.camera.fov
    )
    return _judged(seen.marched(seen.other(seen.scene.node | rm.sphere(0.1).translate(tuple(behind)), camera=camera)))


@relation
def one_cell_of_a_repetition(seen: Seen) -> Verdict:
    spacing = 2.0 * max(float(np.max(seen.scene.node.facts.size)), 0.0) + 1.0
    return _judged(seen.marched(seen.other(seen.scene.node.repeat(spacing, 1))))


@relation
def two_cells_and_a_union(seen: Seen) -> Verdict:
    node = seen.scene.node
    step = 1.2 * max(float(node.facts.size[0]), 0.0) + 0.1
    pair = node.repeat((step, None, None), (2, 1, 1))
    union = node.translate((-0.5 * step, 0, 0)) | node.translate((0.5 * step, 0, 0))
    from tests.hard.referee import Referee

    known = Referee(seen.other(union), seen.size)
    frame = seen.marched(seen.other(pair))
    return None, None, known.unexplained(frame.depth, frame.iterations)


# The same picture of another scene


def _with_camera(seen: Seen, node: rm.Node, place: Callable[[Any], Any], turn: Callable[[Any], Any]) -> rm.Scene:
    pose = seen.scene.pose(Values({}), seen.size[0] / seen.size[1])
    target = pose.position - pose.frame[:, 2]
    camera = rm.Camera(
        tuple(place(pose.position)), tuple(place(target)), tuple(turn(pose.frame[:, 1])), seen.scene.camera.fov
    )
    return seen.other(node, camera=camera)


def _moved(seen: Seen, by: Any) -> Verdict:
    return _judged(
        seen.marched(_with_camera(seen, seen.scene.node.translate(by), lambda v: v + np.array(by), lambda v: v))
    )


@relation
def moved_with_its_camera(seen: Seen) -> Verdict:
    return _moved(seen, (1.0, -2.0, 0.5))


@relation
def moved_a_million_with_its_camera(seen: Seen) -> Verdict:
    return _moved(seen, (1e6, -1e6, 5e5))


@relation
def turned_with_its_camera(seen: Seen) -> Verdict:
    def turn(v: Any) -> Any:  # a quarter about y
        return np.array((v[2], v[1], -v[0]))

    return _judged(seen.marched(_with_camera(seen, seen.scene.node.rotate(np.pi / 2, "y"), turn, turn)))


@relation
def enlarged_with_its_camera(seen: Seen) -> Verdict:
    s = (0.3, 7.0, 1e3, 1e-3)[seen.seed % 4]
    return _judged(seen.marched(_with_camera(seen, seen.scene.node.scale(s), lambda v: v * s, lambda v: v)), s)


@relation
def mirrored_with_its_camera(seen: Seen) -> Verdict:
    def image(v: Any) -> Any:
        return v * np.array((-1.0, 1.0, 1.0))

    node = transform(seen.scene.node, np.diag([-1.0, 1.0, 1.0, 1.0]))
    frame = seen.marched(_with_camera(seen, node, image, image))
    return frame.depth[:, ::-1], frame.iterations[:, ::-1], []


@relation
def symmetric_with_its_camera(seen: Seen) -> Verdict:
    """Two images of the solid, blended where they meet, from a camera on their plane: normals on the plane lie between
    those on both sides of it."""
    if seen.scene.node.exactness == "estimate":
        return None, None, []
    low, high = seen.scene.node.bounds
    size = np.maximum(high - low, 1e-3)
    aside = tuple(np.array((0.3, 0.0, 0.0)) * size - 0.5 * (low + high))
    node = seen.scene.node.translate(aside)
    image = transform(node, np.diag([-1.0, 1.0, 1.0, 1.0]))
    family = ("quadratic", "cubic", "quartic", "circular", "exponential")[seen.seed % 5]
    both = rm.union(node, image, k=0.3 * float(size[0]), blend=family)
    away = 2.5 * float(np.linalg.norm(size))
    camera = rm.Camera((0.0, 0.3 * away, away), (0.0, 0.0, 0.0))
    scene = seen.other(both, camera=camera)
    frame = seen.world.draw(scene, (33, 25), ("depth", "normal"))
    depth, normal = frame.depth.astype(np.float64), frame.normal.astype(np.float64)
    pixel = scene.pose(Values({})).pixel(25)
    left, middle, right = (depth[:, i] for i in (15, 16, 17))
    with np.errstate(invalid="ignore"):
        calm = np.maximum(np.abs(left - middle), np.abs(right - middle)) < 2 * pixel * middle
    beside = np.max(np.abs(normal[:, (15, 17), 0]), axis=1)
    turned = calm & (np.abs(normal[:, 16, 0]) > beside + 0.05)
    return None, None, [f"{turned.sum()} normals on the plane are turned"] if turned.any() else []


# The same scene, drawn in another way


@relation
def by_another_tracer(seen: Seen) -> Verdict:
    name = ("plain", "relaxed", "relaxed_again", "enhanced", "bracketing")[seen.seed % 5]
    return _judged(seen.marched(seen.quality(tracer=name)))


@relation
def with_other_closed_forms(seen: Seen) -> Verdict:
    """Solved what was marched, or marched what was solved."""
    return _judged(seen.marched(seen.quality(analytic=not seen.scene.quality.analytic)))


@relation
def after_cones(seen: Seen) -> Verdict:
    return _judged(seen.marched(seen.quality(schedule=("cone", "cones", "six", "two", "four")[seen.seed % 5])))


@relation
def with_interpolated_rays(seen: Seen) -> Verdict:
    return _judged(seen.marched(seen.quality(rays="interpolated")))


@relation
def in_tiles(seen: Seen) -> Verdict:
    world = seen.world
    for call in world.renderer.draw_calls(seen.scene):
        for tile in tiles_of(call.target.size, 8):
            call.draw(tile)
        shown = call.target.read()[..., :3]
    wrong = int(np.sum((shown != seen.frame.color) & ~(np.isnan(shown) & np.isnan(seen.frame.color))))
    return None, None, [f"{wrong} values differ"] if wrong else []


@relation
def by_parameters(seen: Seen) -> Verdict:
    """A scale and a translation as uniforms."""
    s, x = rm.Param("s", 1.0, 0.5, 2.0), rm.Param("x", 0.0, -1.0, 1.0)
    return _judged(seen.marched(seen.other(seen.scene.node.scale(s).translate((x, 0, 0)))))


@relation
def by_parameters_that_moved(seen: Seen) -> Verdict:
    """Scale, place and camera by parameters and time, with other values than their defaults."""
    s, x = rm.Param("s", 1.0, 0.5, 2.0), rm.Param("x", 0.0)
    pose = seen.scene.pose(Values({}), seen.size[0] / seen.size[1])
    by = (x, 0.1 * rm.time, 0.0)

    def place(v: Any) -> Any:
        return tuple(s * float(c) + b for c, b in zip(v, by, strict=True))

    camera = rm.Camera(
        place(pose.position), place(pose.position - pose.frame[:, 2]), tuple(pose.frame[:, 1]), seen.scene.camera.fov
    )
    scene = seen.other(seen.scene.node.scale(s).translate(by), camera=camera)
    values = {"s": 1.3, "x": -0.7}
    return _judged(seen.world.draw(scene, seen.size, MARCHED, params=values, time=5.0), 1.3)


@relation
def frames_and_samples(seen: Seen) -> Verdict:
    world, scene = seen.world, seen.quality(temporal="accumulate", schedule="single")
    world.draw(scene, seen.size, ("color",))
    for _ in range(3):
        found = world.renderer.render(scene)
    sampled = world.draw(seen.quality(samples=4, schedule="single"), seen.size, ("color",))
    steps = bytes_off(found, sampled)
    return None, None, [f"4 frames and 4 samples differ by {steps} of 255"] if steps > 1 else []


# The same light


def _near(frame: Frame, other: Frame, steps: float = 0.02) -> list[str]:
    """Colours of another frame that no pixel beside one of a frame has: more than borders that shift by a hair."""
    color, found = frame.color.astype(np.float64), other.color.astype(np.float64)
    padded = np.pad(color, ((1, 1), (1, 1), (0, 0)), mode="edge")
    h, w = color.shape[:2]
    around = np.array([padded[i : i + h, j : j + w] for i in range(3) for j in range(3)])
    slack = steps * np.maximum(1.0, around.max(axis=0))
    off = ~np.all((found >= around.min(axis=0) - slack) & (found <= around.max(axis=0) + slack), axis=-1)
    return [f"{off.sum()} pixels have another light"] if off.sum() > 0.003 * off.size else []


def _reach(seen: Seen) -> tuple[Any, float]:
    """The middle of the solid, and its size."""
    low, high = seen.scene.node.bounds
    return 0.5 * (low + high), max(float(np.linalg.norm(high - low)), 1e-3)


@relation
def enlarged_with_its_lamp(seen: Seen) -> Verdict:
    """Everything a thousand times as large or small, the lamp brighter by the square."""
    if seen.scene.node.exactness == "estimate":
        return None, None, []
    middle, size = _reach(seen)
    s = (1e3, 1e-3)[seen.seed % 2]
    place = middle + size * np.array((0.7, 1.3, 0.9)) * (0.6, 5.0, 300.0)[seen.seed % 3]
    bright = float(np.sum((place - middle) ** 2))
    lamp = rm.PointLight(tuple(place), intensity=bright, shadow=True)
    larger = rm.PointLight(tuple(s * place), intensity=s * s * bright, shadow=True)
    frame = seen.draw(seen.other(lights=(lamp,)), ("color",))
    scene = _with_camera(seen, seen.scene.node.scale(s), lambda v: v * s, lambda v: v)
    scene = scene.replace(lights=(larger,))
    return None, None, _near(frame, seen.draw(scene, ("color",)))


@relation
def a_lamp_far_away_and_a_sun(seen: Seen) -> Verdict:
    if seen.scene.node.exactness == "estimate":
        return None, None, []
    middle, size = _reach(seen)
    towards = np.array((0.5, 1.0, 0.7)) / np.linalg.norm((0.5, 1.0, 0.7))
    far = size * (3e3, 1e4, 1e5)[seen.seed % 3]
    sun = rm.Sun(tuple(towards), shadow=True)
    lamp = rm.PointLight(tuple(middle + far * towards), intensity=far * far, shadow=True)
    frames = [seen.draw(seen.other(lights=(light,)), ("color",)) for light in (sun, lamp)]
    return None, None, _near(*frames)


@relation
def in_the_shadow_of_a_ball_far_away(seen: Seen) -> Verdict:
    """Whatever faces the sun is dark then, as if it were turned away."""
    if any(part.label is not None for part in _all(seen.scene.node)):
        return None, None, []
    middle, size = _reach(seen)
    towards = np.array((0.5, 1.0, 0.7)) / np.linalg.norm((0.5, 1.0, 0.7))
    away = size * (30.0, 1e3, 3e4)[seen.seed % 3]
    ball = rm.sphere(2.0 * size).translate(tuple(middle + away * towards))
    sun = rm.Sun(tuple(towards), shadow=True)
    frame = seen.draw(seen.other(seen.scene.node | ball, lights=(sun,)), ("color", "depth"))
    hit = np.isfinite(frame.depth) & np.isfinite(seen.frame.depth)
    lit = hit & (np.abs(frame.color - 0.1 * 0.5).max(axis=-1) > 1e-3)
    return None, None, [f"{lit.sum()} of {hit.sum()} pixels are lit"] if lit.any() else []


@relation
def with_a_lamp_that_is_off(seen: Seen) -> Verdict:
    lamp = rm.PointLight((0, 3, 3), intensity=0.0, shadow=True)
    return _same(seen, seen.draw(seen.other(lights=(*seen.scene.lights, lamp))), "depth", "color")


@relation
def in_fog_of_no_density(seen: Seen) -> Verdict:
    return _same(seen, seen.draw(seen.other(fog=rm.Fog(density=0.0))), "color", ulps=4)


@relation
def made_of_the_default(seen: Seen) -> Verdict:
    node = seen.scene.node
    if any(part.label is not None for part in _all(node)):
        return None, None, []
    return _same(seen, seen.draw(seen.other(node.material(rm.Material()))), "depth", "color", ulps=16)


def _all(node: rm.Node) -> list[rm.Node]:
    found = [node]
    for part in found:
        found += part.children
    return found


assert METHODS
