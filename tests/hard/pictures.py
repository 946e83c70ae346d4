"""Pictures of visible cases without (left) and with (right) their remedy: docs/pictures/hard-*.png.

python -m tests.hard.pictures
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np
from PIL import Image

import raymarch as rm
from raymarch import glsl
from raymarch.gpu import Renderer
from raymarch.scene import load
from tests.hard.rows_far import HELLO, displaced
from tests.lab.seeded import reads

SIZE = (180, 120)
FOLDER = Path(__file__).parents[2] / "docs" / "pictures"
SUN = rm.Sun((0.6, 1.0, 0.4), shadow=True)
ABOVE = rm.Camera((2.2, 1.6, 3.0), (0, -0.1, 0), fov=40.0)

Draw = Callable[[Renderer, rm.Scene], rm.Frame]


def first_frame(renderer: Renderer, scene: rm.Scene) -> rm.Frame:
    return renderer.render(scene)


class Pair(NamedTuple):
    """A row of the table, a scene that shows it, and the same without the remedy: another scene, or other code."""

    row: int
    name: str
    scene: rm.Scene
    other: rm.Scene | None = None
    unmended: Callable[[], AbstractContextManager[object]] = nullcontext
    draw: Draw = first_frame


def pairs() -> list[Pair]:
    return [*marches(), *fields(), *far_away(), *lit(), *histories()]


def marches() -> Iterator[Pair]:
    shell = rm.sphere(1.0).shell(0.004) - rm.box((2.2, 2.2, 2.2)).translate((0.9, 0.9, 0.9))
    always = without("march/loop", "z <= last.r + behind + max(way.leap, least_leap(last.t))", "true")
    yield Pair(1, "thin shell", rm.Scene(shell, ABOVE, quality=rm.Quality(tracer="auto_relaxed")), unmended=always)
    columns = rm.cylinder(0.025, 3.0).repeat((0.7, None, 0.7)) | rm.plane(offset=-0.5)
    cones = rm.Scene(columns, rm.Camera((0.35, 0.9, 3.0), (0, 0.3, 0), fov=60.0), quality=rm.Quality(schedule="cones"))
    narrow = without("march/distance", "(r - u_cone * t) / (1.0 + u_cone)", "r")
    yield Pair(54, "cone pass", cones, unmended=narrow)
    low = rm.Camera((0, 0.4, 3.0), (0, 0.38, 0), fov=40.0)
    floor = rm.plane() | rm.sphere(0.3).translate((0, 0.3, 0))
    horizon = rm.Scene(floor, low, quality=rm.Quality(max_steps=48, tracer="plain", analytic=False))
    yield Pair(
        58,
        "infinite plane at the horizon",
        horizon,
        unmended=without("march/on_exhausted", "hit.found = true", "hit.found = false"),
    )
    bulb = rm.Scene(rm.mandelbulb(), rm.Camera((1.6, 1.2, 2.2), (0, 0, 0), fov=38.0), [SUN])
    relaxed = replace(bulb.quality, tracer="relaxed", assume_certified=True, omega=1.9)
    yield Pair(55, "relaxed tracer on an estimate", bulb, rm.Scene(bulb.node, bulb.camera, [SUN], quality=relaxed))
    room = rm.Scene(
        rm.box(4.0) - rm.sphere(0.5).translate((-0.4, -0.8, -1.6)),
        rm.Camera((0.9, 0.3, 1.6), (-0.2, -0.3, -1), fov=70.0),
        quality=rm.Quality(tracer="bracketing"),
    )
    yield Pair(27, "camera inside a solid", room, unmended=without("march/distance", "u_side * field", "field"))


def fields() -> Iterator[Pair]:
    """On the left a field in GLSL that promises what it does not keep."""
    yield promised(
        13,
        "exponential blend",
        rm.union(rm.sphere(0.7), rm.plane(offset=-0.8), k=0.03, blend="exponential"),
        "return -0.0108 * log(exp(-a / 0.0108) + exp(-b / 0.0108));",
        "float a = length(p) - 0.7; float b = p.y + 0.8;",
    )
    yield promised(
        16,
        "off-centre child in a repetition",
        rm.sphere(0.35).translate((0.35, 0, 0)).repeat((1.0, None, 1.0), (5, None, 5)),
        "return length(q - vec3(0.35, 0.0, 0.0)) - 0.35;",
        "vec3 q = p; q.xz -= clamp(floor(p.xz + 0.5), -2.0, 2.0);",
    )
    yield promised(
        20,
        "uneven scale",
        rm.sphere(1.0).scale((1.6, 0.25, 1.6)),
        "return length(p / vec3(1.6, 0.25, 1.6)) - 1.0;",
    )
    twisted = rm.box((1.4, 2.4, 0.3)).twist(5.0)
    yield promised(
        22,
        "twist and bend",
        twisted,
        "vec3 q = abs(vec3(c * p.x - s * p.z, p.y, s * p.x + c * p.z)) - vec3(0.7, 1.2, 0.15);"
        " return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0);",
        "float c = cos(5.0 * p.y); float s = sin(5.0 * p.y);",
    )
    yield promised(
        23,
        "displacement",
        rm.sphere(0.9).displace(0.3, 20.0),
        "return length(p) - 0.9 + 0.3 * sin(20.0 * p.x) * sin(20.0 * p.y) * sin(20.0 * p.z);",
    )
    yield promised(
        28,
        "fractal without bail-out",
        rm.mandelbulb(),
        "return 0.25 * log(dot(w, w)) * length(w) / d;",
        "vec3 w = p; float d = 1.0; for (int i = 0; i < 12; i++) { float r = length(w);"
        " d = 8.0 * pow(r, 7.0) * d + 1.0;"
        " float a = 8.0 * acos(w.y / r); float b = 8.0 * atan(w.x, w.z);"
        " w = p + pow(r, 8.0) * vec3(sin(a) * sin(b), cos(a), sin(a) * cos(b)); }",
    )

    balls = [rm.sphere(0.5).translate((0.04 * i, 0, 0)) for i in range(16)]
    chain = functools.reduce(lambda a, b: rm.union(a, b, k=0.4), balls)
    camera = rm.Camera((1.9, 1.7, 2.7), (0.3, 0, 0), fov=42.0)
    yield Pair(8, "order in a smooth chain", rm.Scene(rm.union(*balls, k=0.4), camera), rm.Scene(chain, camera))


def promised(row: int, name: str, node: rm.Node, returned: str, before: str = "") -> Pair:
    """A solid, and a naive field of the same that calls itself a safe one."""
    camera = rm.Camera((1.9, 1.7, 2.7), (0, 0, 0), fov=42.0)
    naive = rm.glsl_node(
        f"float naive(vec3 p) {{ {before} {returned} }}",
        "naive",
        "bound",
        bounds=((-2.6, -2.6, -2.6), (2.6, 2.6, 2.6)),
    )
    return Pair(row, name, rm.Scene(node, camera, [SUN]), rm.Scene(naive, camera, [SUN]))


def far_away() -> Iterator[Pair]:
    def stays() -> AbstractContextManager[object]:
        return mock.patch("raymarch.plan.stages.origin_of", lambda view: np.zeros(3))

    yield Pair(4, "far from the origin", displaced(load(HELLO), (1e6, -1e6, 5e5)), unmended=stays)

    grid = rm.sphere(0.3).repeat((1.0, None, 1.0))
    fract = rm.glsl_node(
        "float grid(vec3 p) { return length(vec3(fract(p.x) - 0.5, p.y, fract(p.z) - 0.5)) - 0.3; }", "grid", "bound"
    )
    cells = rm.Camera((2e5 + 0.5, 1.0, 0.5), (2e5 + 2.5, 0.0, 3.5))
    yield Pair(18, "huge repetition index", rm.Scene(grid.translate((0.5, 0, 0.5)), cells), rm.Scene(fract, cells))

    @contextmanager
    def fixed() -> Iterator[None]:
        step = without(
            "normal/tetrahedron", "3.4526698e-4 * max(1.0e-12, max(abs(p.x), max(abs(p.y), abs(p.z))))", "1e-4"
        )
        with stays(), step():
            yield

    far = (1e4, 1e4, 1e4)
    solid = rm.Scene(rm.torus(0.8, 0.3), ABOVE, quality=rm.Quality(normals="tetrahedron"))
    yield Pair(5, "normals far away", displaced(solid, far), unmended=fixed)


def lit() -> Iterator[Pair]:
    ring = rm.Scene(rm.torus(0.8, 0.3) | rm.plane(offset=-0.5), ABOVE, [SUN])
    yield Pair(29, "secondary rays", ring, unmended=without("light/spawn_ray", "2.0 *", "0.0 *"))


def histories() -> Iterator[Pair]:
    still = rm.Quality(temporal="accumulate")
    here, there = rm.Camera((2, 1.5, 3), (0, 0, 0)), rm.Camera((-2, 1.0, 2.4), (0, 0.1, 0))
    node = rm.box(1.2) - rm.sphere(0.75)

    def after_a_cut(renderer: Renderer, scene: rm.Scene) -> rm.Frame:
        for _ in range(3):
            renderer.render(rm.Scene(node, there, [SUN], quality=still))
        return renderer.render(scene)

    scene = rm.Scene(node, here, [SUN], quality=still)
    yield Pair(
        43,
        "camera cut",
        scene,
        unmended=without("view/accumulate", "!u_keep || ", ""),
        draw=after_a_cut,
    )

    def after_a_nan(renderer: Renderer, scene: rm.Scene) -> rm.Frame:
        renderer.render(scene)
        pair = renderer.resources.pair("color history", renderer.size)
        for target in (pair.front, pair.back):
            texels = target.read()
            high, wide = texels.shape[:2]
            texels[high // 3 : high // 2, wide * 2 // 5 : wide * 3 // 5] = np.nan
            target.write(texels)
        return renderer.render(scene)

    blind = without("view/accumulate", "!u_keep || !finite(before)", "!u_keep")
    yield Pair(44, "one NaN in the history", scene, unmended=blind, draw=after_a_nan)


def without(module: str, code: str, text: str) -> Callable[[], AbstractContextManager[object]]:
    """A context in which a piece of code of a GLSL module is replaced by a text."""

    file = Path(glsl.__file__).parent / f"{module}.glsl"
    lines = file.read_text(encoding="utf-8").split("\n")
    number = next(i for i, found in enumerate(lines, 1) if code in found and not found.startswith("//"))
    return lambda: reads(file, number, lines[number - 1].replace(code, text))


def drawn(pair: Pair, size: tuple[int, int] = SIZE) -> tuple[Image.Image, Image.Image]:
    """The pictures without and with the remedy."""
    with pair.unmended(), np.errstate(all="ignore"):
        left = _frame(pair, pair.other or pair.scene, size)
    return left, _frame(pair, pair.scene, size)


def _frame(pair: Pair, scene: rm.Scene, size: tuple[int, int]) -> Image.Image:
    with Renderer(size) as renderer:
        return pair.draw(renderer, scene).image()


def file_of(pair: Pair) -> str:
    return f"hard-{pair.name.replace(' ', '-')}.png"


def section() -> list[str]:
    """The section of the page."""
    lines = [
        "## Pictures",
        "",
        "Left: without the remedy. Right: the present picture. Made by `python -m tests.hard.pictures`.",
        "",
    ]
    ordered = sorted(pairs(), key=lambda pair: pair.row)
    return lines + [f"{pair.row}. **{pair.name}**: ![{pair.name}](pictures/{file_of(pair)})" for pair in ordered]


def main() -> None:
    for pair in pairs():
        both = Image.new("RGB", (2 * SIZE[0] + 4, SIZE[1]), "white")
        for i, picture in enumerate(drawn(pair)):
            both.paste(picture, (i * (SIZE[0] + 4), 0))
        both.save(FOLDER / file_of(pair), optimize=True)


if __name__ == "__main__":
    main()
