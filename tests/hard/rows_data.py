"""Cases of data: patterns asked on their own borders, and letters, meshes, pictures and trees from outside."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib
import numpy as np
import trimesh
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.vocabulary import mod, where
from raymarch.plan import plan
from tests.hard.world import Figure, World, case, refusals, view_of
from tests.support.analytic import View, edges, hit_plane, points, unit
from tests.support.cameras import camera_of

Array = NDArray[Any]
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
SIZE = (96, 54)


def checkered(q: Array, edge: float) -> Array:
    """True where a checker of cubes shows its first colour. The origin is a quarter of an edge inside its cube."""
    return np.asarray(np.floor(q / edge + 0.25).sum(axis=-1) % 2 == 0)


def wrong_cells(color: Array, red: Array, seen: Array) -> int:
    """Pixels that show the other colour, but for those at the borders that run across the surface."""
    shown = color[..., 0] > color[..., 2]
    dark = color[..., 0] + color[..., 2] == 0
    labels = np.where(seen, red.astype(int), -1)
    return int(np.sum(((shown != red) | dark) & seen & ~edges(labels)))


def turned(angle: float, axis: Any) -> Array:
    """The matrix of a rotation (Rodrigues)."""
    x, y, z = unit(np.asarray(axis, np.float64))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


BOARD = rm.checker(RED, BLUE, 0.8)
GLOWING = rm.Material(emission=BOARD, specular=0.0, ambient=0.0)
PLACES: tuple[tuple[float, float, tuple[float, float, float]], ...] = (
    (1.0, 0.0, (0.0, 0.0, 0.0)),
    (1.0, 0.7, (0.0, 0.0, 0.0)),
    (1.0, 0.0, (3.1, -2.3, 1.7)),
    (0.37, 0.4, (-0.7, 0.6, 0.3)),
    (30.0, 1.1, (7.0, 5.0, -3.0)),
    (1.0, 0.3, (1000.0, 300.0, -700.0)),
    (1.0, 0.3, (3.0e6, 1.0e6, -7.0e5)),
)


@case(67, "a pattern asked on its border", before="57 % of the pixels of a floor at y = -1 with cells of .8")
def on_the_border(world: World) -> Iterator[Figure]:
    """On a floor at the border of a 3D checker's cells, the rounding of each hit decides: noise. Materials are
    evaluated just inside the solid, which shows the cell that it fills."""
    wrong = truth = total = 0
    for scale, angle, offset in PLACES:
        rotation = turned(angle, (0, 0, 1))
        for node in (rm.plane(offset=-1), rm.box((1.2, 1.2, 1.2))):
            placed = node.material(GLOWING).scale(scale).rotate(angle, "z").translate(offset)
            local = np.array([0.9, 1.5, 3.1]) if node.name == "box" else np.array([0.3, 1.2, 3.0])
            eye = scale * rotation @ local + offset
            aim = scale * rotation @ np.array([0.0, -0.2 if node.name == "box" else -1.0, 0.0]) + offset
            view = view_of(tuple(eye), tuple(aim), 40.0, SIZE, tuple(rotation @ (0, 1, 0)))
            red, seen = _shown(view, node.name, scale, rotation, np.asarray(offset))
            scene = rm.Scene(placed, camera_of(view), [])
            total += int(seen.sum())
            wrong += wrong_cells(world.draw(scene, SIZE, ("color",)).color, red, seen)
            truth += wrong_cells(rm.truth(scene, SIZE, outputs=("color",)).color, red, seen)
    yield Figure(f"pixels of the wrong cell, of {total} moved, turned and scaled", wrong, 0, "the cell just inside")
    yield Figure("the same of the float64 reference", truth, 0, "the cell just inside")
    for name, scene, red, seen in _indirect():
        frame = world.draw(scene, SIZE, ("color",))
        yield Figure(
            f"pixels of the wrong cell, {name}", wrong_cells(frame.color, red, seen), 0, "the cell just inside"
        )
    wrong = total = 0
    for node, boxes in _neighbours():
        view = view_of((3.0, 2.5, 4.0), (0.0, 0.0, 0.0), 40.0, SIZE)
        red, seen = _first_box(view, boxes)
        scene = rm.Scene(node, camera_of(view), [])
        total += int(seen.sum())
        wrong += wrong_cells(world.draw(scene, SIZE, ("color",)).color, red, seen)
        wrong += wrong_cells(rm.truth(scene, SIZE, outputs=("color",)).color, red, seen)
    because = "the material of the copy that stands there"
    yield Figure(f"pixels of the wrong copy, of {total} with walls on cell borders", wrong, 0, because)


Box = tuple[tuple[float, float, float], tuple[float, float, float], bool]
"""Middle, full extents, and whether it is red."""


def _neighbours() -> Iterator[tuple[rm.Node, list[Box]]]:
    """Copies that fill their cells, so that walls stand on the borders between two, and the boxes that they are."""
    red, blue = (rm.Material(emission=color) for color in (RED, BLUE))

    def bar(index: Any) -> rm.Node:
        odd = mod(index.x + index.z, 2.0) < 0.5
        glow = rm.Material(emission=where(odd, RED, BLUE))
        return rm.box((0.7, where(odd, 0.6, 1.2), 0.7)).material(glow)

    cells = [(i, k) for i in range(-2, 3) for k in range(-2, 3)]
    bars: list[Box] = [
        ((0.7 * i, 0.0, 0.7 * k), (0.7, 1.2 if (i + k) % 2 else 0.6, 0.7), (i + k) % 2 == 0) for i, k in cells
    ]
    yield rm.repeat_varied(bar, (0.7, None, 0.7), (5, 1, 5)), bars
    one = rm.box((0.35, 0.6, 0.6)).translate((0.175, 0, 0)).material(red)
    both = one | rm.box((0.35, 0.4, 0.5)).translate((-0.175, 0, 0)).material(blue)
    pairs: list[Box] = []
    for i, k in cells:
        pairs += [((0.7 * i + 0.175, 0.0, 0.7 * k), (0.35, 0.6, 0.6), True)]
        pairs += [((0.7 * i - 0.175, 0.0, 0.7 * k), (0.35, 0.4, 0.5), False)]
    bound = both.scale((1.0, 1.0 + 1e-6, 1.0))  # no longer exact: repeat guards against wrong neighbours
    yield bound.repeat((0.7, None, 0.7), (5, None, 5)), pairs


def _first_box(view: View, boxes: list[Box]) -> tuple[Array, Array]:
    """Where the nearest box along each ray is red, and where there is one."""
    best, red = np.full(view.directions.shape[:2], np.inf), np.zeros(view.directions.shape[:2], bool)
    for middle, size, colour in boxes:
        ends = [(np.asarray(middle) + s * np.asarray(size) / 2 - view.origin) / view.directions for s in (-1, 1)]
        near, far = np.minimum(*ends).max(axis=-1), np.maximum(*ends).min(axis=-1)
        first = (near < far) & (near < best - 1e-9)
        best, red = np.where(first, near, best), np.where(first, colour, red)
    return red, np.isfinite(best)


def _shown(view: View, name: str, scale: float, rotation: Array, offset: Array) -> tuple[Array, Array]:
    """Where the first colour is seen, and where the solid is, by the analytic hit in the object's own space."""
    origin = (view.origin - offset) @ rotation / scale
    directions = view.directions @ rotation
    if name == "plane":
        t, normals = hit_plane(origin, directions, -1.0), np.broadcast_to([0.0, 1.0, 0.0], directions.shape)
        sure = t < 30.0
    else:
        with np.errstate(divide="ignore"):
            ends = np.sort(np.stack([(s * 0.6 - origin) / directions for s in (-1, 1)]), axis=0)
        near, far = ends[0].max(axis=-1), ends[1].min(axis=-1)
        t = np.where(near < far, near, np.inf)
        normals = -np.sign(directions) * (ends[0] == near[..., None])
        sure = np.isfinite(t) & ~edges(ends[0].argmax(axis=-1))  # a pixel on an edge covers two faces
    q = points(origin, directions, t) - 1e-9 * normals
    return checkered(q, 0.8), sure


def _indirect() -> Iterator[tuple[str, rm.Scene, Array, Array]]:
    """Scenes in which the floor at y = -1 is shaded, or seen in a mirror and through glass that bends nothing."""
    floor = rm.plane(offset=-1)
    view = view_of((0.3, 1.2, 3.0), (0.0, -1.0, 0.0), 40.0, SIZE)
    t = hit_plane(view.origin, view.directions, -1.0)
    p = points(view.origin, view.directions, t)
    seen = np.isfinite(t) & (t < 30.0)
    red = checkered(p - (0, 1e-9, 0), 0.8)
    lit = rm.Material(BOARD, specular=0.0, ambient=1.0)
    sun = [rm.Sun((0.2, 1.0, 0.3))]
    yield "shaded after Phong", rm.Scene(floor.material(lit), camera_of(view), sun), red, seen
    matte = rm.Material(BOARD, specular=0.0, ambient=0.0)
    yield (
        "lit by bounces",
        rm.Scene(floor.material(matte), camera_of(view), [], sky=(1, 1, 1), bounces=1),
        red,
        seen,
    )
    layers = rm.Material(rm.stripes(RED, BLUE, 0.5, "y"), specular=0.0, ambient=1.0)
    below = np.zeros_like(seen)  # the layer from -1.5 to -1 is the odd one
    yield "of stripes", rm.Scene(floor.material(layers), camera_of(view), sun), below, seen
    step = rm.Material(lambda q: where(q.y < -1.0, RED, BLUE), specular=0.0, ambient=1.0)
    yield "of a step", rm.Scene(floor.material(step), camera_of(view), sun), ~below, seen
    pane = rm.Material(albedo=(1, 1, 1), transmission=1.0, ior=1.0, f0=0.0)
    glazed = floor.material(GLOWING) | rm.box((20, 0.1, 20)).material(pane)
    for integrator in ("path", "whitted"):
        quality = rm.Quality(integrator=integrator)
        scene = rm.Scene(glazed, camera_of(view), [], sky=(0, 0, 0), bounces=4, quality=quality)
        yield f"through glass, {integrator}", scene, red, seen
    wall = rm.Material(albedo=(1, 1, 1), metalness=1.0, roughness=0.0)
    mirrored = floor.material(GLOWING) | rm.plane((0, 0, 1), -2.0).material(wall)
    view = view_of((0.3, 0.2, 2.0), (0.0, -0.3, -2.0), 40.0, SIZE)
    reach = (-2.0 - view.origin[2]) / view.directions[..., 2]
    at = points(view.origin, view.directions, reach)
    back = view.directions * (1.0, 1.0, -1.0)
    t = hit_plane(at, back, -1.0)
    seen = (reach > 0) & (at[..., 1] > -1.0) & np.isfinite(t) & (t < 30.0)
    red = checkered(points(at, back, t) - (0, 1e-9, 0), 0.8)
    for integrator in ("path", "whitted"):
        quality = rm.Quality(integrator=integrator)
        scene = rm.Scene(mirrored, camera_of(view), [], sky=(0, 0, 0), bounces=2, quality=quality)
        yield f"in a mirror, {integrator}", scene, red, seen


@case(68, "letters that the font lacks", before="a crossed box for each, exit code 0, no warning")
def letters(world: World) -> Iterator[Figure]:
    """A font shows a placeholder, a box, for a missing letter. Such a text is refused, and the message names the
    letter."""
    font = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    missing = "\u0905 \u0bae \u0e01 \u3042 \u6f22 \ua000 \uac00 \U00020000 \t \ud800".split(" ")
    calls = [(partial(rm.text, f"a{c}b", font=font), ("lacks", repr(c), "DejaVuSans", "font=")) for c in missing]
    yield refusals(*calls)
    known = [chr(i) for i in range(33, 127)]
    refused = 0
    for letter in known:
        try:
            rm.text(letter, resolution=8)
        except rm.SceneError as error:
            refused += "lacks" in str(error)
    yield Figure(f"letters of ASCII refused, of {len(known)}", refused, 0, "the font that comes with Pillow has them")


@case(69, "a mesh turned inside out", before="a noisy cube, its sign lost")
def inside_out(world: World) -> Iterator[Figure]:
    """The sign of the distance depends on the orientation of the triangles. Inverted parts are turned, with a warning.
    A mesh without an inside is refused."""
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (4000, 3))
    away = np.abs(q) - (0.5, 1.0, 0.5)
    known = np.linalg.norm(np.maximum(away, 0), axis=1) + np.minimum(away.max(axis=1), 0)
    clear = np.abs(known) > 0.15
    cube = trimesh.creation.box((1, 2, 1))
    turns = {"all": slice(None), "three": [0, 5, 7], "eight": slice(0, 8)}
    wrong = said = 0
    with TemporaryDirectory() as folder:
        file = Path(folder) / "cube.stl"

        def read(faces: Array, vertices: Array) -> rm.Node:
            trimesh.Trimesh(vertices, faces, process=False).export(file)
            return rm.mesh(file, resolution=24, cache=folder)

        for turned in turns.values():
            faces = cube.faces.copy()
            faces[turned] = faces[turned][:, ::-1]
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                node = read(faces, cube.vertices)
            said += len(caught) == 1 and "turned" in str(caught[0].message)
            wrong += int(np.sum((node.distance(q) < 0)[clear] != (known < 0)[clear]))
        yield Figure("points on the wrong side, of three cubes", wrong, 0, "farther than two cells off the surface")
        yield Figure("cubes that were turned without a warning, of 3", 3 - said, 0, "one warning each")
        lost = cube.vertices.copy()
        lost[3] = np.nan
        crossed = np.concatenate([cube.vertices, cube.vertices + np.array([0.4, 0.3, 0.2])])
        yield refusals(
            (lambda: read(cube.faces[1:], cube.vertices), ("not closed", "cube.stl")),
            (lambda: read(cube.faces[:0], cube.vertices), ("cube.stl",)),
            (lambda: read(cube.faces, lost), ("not finite", "cube.stl")),
            (lambda: read(np.concatenate([cube.faces, cube.faces + 8]), crossed), ("not clear", "cube.stl")),
            (lambda: rm.heightmap(np.zeros((1, 1))), ("(1, 1)", "2 x 2")),
            (lambda: rm.heightmap(np.full((4, 4), np.nan)), ("16 of 16", "not finite")),
            (lambda: rm.grid(np.full((4, 4, 4), np.nan)), ("64 of 64", "not finite")),
        )


@case(92, "an isosurface that nearly reaches its level", "a solid between two others where no value reaches the level")
def nearly_a_level(world: World) -> Iterator[Figure]:
    """Between two lobes with steep sides a wide one stays just below the level: the field is small there. The
    samples tell how many times as far as its value the surface is at most, which limits the value of a hit."""
    x, y, z = np.meshgrid(*[np.linspace(-1.0, 1.0, 33)] * 3, indexing="ij")
    wide = y * y + z * z
    density = np.exp(-((abs(x) - 0.7) ** 2 + wide) / 0.03) + 0.099 * np.exp(-(x * x + wide) / 0.06)
    scene = rm.Scene(rm.isosurface(density, 0.1), rm.Camera((0.3, 0.5, 4.0), (0, 0, 0), fov=30))
    known = rm.truth(scene, (64, 48), outputs=("depth",)).hit
    found = np.isfinite(world.draw(scene, (64, 48), outputs=("depth",)).depth)
    assert known.sum() > 100
    yield Figure("hits where no value reaches the level", int(np.sum(found & ~known)), 2, "silhouettes")
    yield Figure("hits that are missed", int(np.sum(known & ~found)), 2, "silhouettes")


@case(90, "a mesh thinner than its samples", before="an empty picture, or part of the mesh, exit code 0, no warning")
def thinner_than_samples(world: World) -> Iterator[Figure]:
    """A wall between two samples has no sample inside. A mesh without any is refused, and one that loses more than a
    hundredth of its surface warns of the share."""
    cube, sheet = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 0.01))
    fin = trimesh.util.concatenate([cube, trimesh.creation.box((1, 1, 0.01)).apply_translation((0, 0, 1.013))])
    beside = trimesh.util.concatenate([cube, trimesh.creation.box((0.1, 0.1, 0.01)).apply_translation((0, 0, 1.013))])
    silent = 0
    with TemporaryDirectory() as folder:
        file = Path(folder) / "thin.stl"

        def read(solid: trimesh.Trimesh, resolution: int) -> rm.Node:
            solid.export(file)
            return rm.mesh(file, resolution=resolution, cache=folder)

        for solid, share in ((cube, None), (fin, "25 %"), (beside, None), (trimesh.creation.icosphere(2), None)):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                read(solid, 24)
            words = [str(one.message) for one in caught]
            silent += len(words) != (share is not None) or not all(f"{share} of the surface" in text for text in words)
        yield Figure("meshes with a wrong warning, or without one, of 4", silent, 0, "more than 1 % is missing")
        yield refusals(
            (lambda: read(sheet, 24), ("resolution = 24", "0.0526", "thin.stl", "up to 256")),
            (lambda: read(sheet.copy().apply_scale(1e-3), 64), ("resolution = 64", "thin.stl")),
        )


@case(78, "deep trees", before="200 smooth unions compile for 16 s, 1,000 for 346 s, without a word")
def deep(world: World) -> Iterator[Figure]:
    """Software renderers compile a field in a time that grows with the square of its operations. The time is estimated
    before the compilation: from 10 s on it is reported, and beyond a limit, which can be raised, it is refused."""
    measured = {100: 4.5, 200: 16.0}
    worst = 1.0
    for n, seconds in measured.items():
        share = plan(rm.Scene(_chain(n))).compile_seconds / seconds
        worst = max(worst, share, 1 / share)
    yield Figure("factor between the estimate and what was measured", worst, 2, "a rough estimate is enough")
    limit, os.environ["RAYMARCH_COMPILE_LIMIT"] = os.environ.get("RAYMARCH_COMPILE_LIMIT"), "7"
    try:
        words = ("operations", "compiling takes about", "RAYMARCH_COMPILE_LIMIT")
        yield refusals((lambda: world.draw(rm.Scene(_chain(200))), words), what="compiled beyond the limit")
    finally:
        del os.environ["RAYMARCH_COMPILE_LIMIT"]
        if limit is not None:
            os.environ["RAYMARCH_COMPILE_LIMIT"] = limit


def _chain(n: int) -> rm.Node:
    random, node = np.random.default_rng(1), rm.sphere(0.3)
    for i in range(n):
        node = rm.union(node, rm.sphere(0.3 + 0.001 * i).translate(tuple(random.uniform(-2, 2, 3))), k=0.1)
    return node
