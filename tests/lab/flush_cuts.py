"""Cuts that are flush with a face: no membrane of no thickness is drawn, and thin skins and shells are.

python -m tests.lab.flush_cuts [--random 40] [--size 160x90] [NAME...]

Each picture of the shader and of the reference is compared with the reference of the same solid, cut by a longer tool
that is flush with nothing. Of each, it prints the pixels that differ in whether they hit, in depth and in colour.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

import numpy as np

import raymarch as rm

PLATE = (40.0, 10.0, 40.0)
FLOOR = rm.plane(offset=-20)
SUN = rm.Sun(sun_direction=(1, 2, 1.5), shadow=True)
MIRROR = rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1, roughness=0)
GLASS = rm.Material(transmission=1.0, roughness=0)
TREE = rm.Quality(integrator="whitted")
PIXEL = 0.46
"""Width of a pixel at the plate in a picture 90 pixels high."""


def camera(moved: tuple[float, float, float] = (0, 0, 0), **given: object) -> rm.Camera:
    return rm.Camera(position=tuple(np.add((30, 60, 40), moved)), target=moved, **given)


def drilled(height: float = 10.0) -> rm.Node:
    """A plate with a hole; at a height of 10, the drill is as long as the plate is thick."""
    return rm.box(PLATE) - rm.cylinder(8, height)


def beside(make: Callable[[rm.Node], rm.Node]) -> tuple[rm.Node, rm.Node]:
    return make(drilled()), make(drilled(12))


def turned(node: rm.Node) -> rm.Node:
    return node.rotate(0.7, (1, 2, 3))


def far(node: rm.Node) -> rm.Node:
    return node.translate((1e4, 0, 0))


def blind(height: float) -> rm.Node:
    return rm.box(PLATE) - rm.cylinder(8, height).translate((0, height / 2, 0))


def corner(size: float) -> rm.Node:
    return rm.box(PLATE) - rm.box((size, size / 2, size)).translate((size / 2, 0, size / 2))


def dome(height: float) -> rm.Node:
    return (rm.sphere(20) & rm.plane()) - rm.cylinder(8, height).translate((0, height / 2 - 10, 0))


def pond(height: float) -> rm.Node:
    return rm.plane() - rm.box((10, height, 20)).translate((0, height / 2 - 6, 0))


CASES: dict[str, tuple[rm.Node, rm.Node, dict[str, object]]] = {
    "plate": (drilled(), drilled(12), {}),
    "plate .001": (drilled(10.001), drilled(12), {}),
    "blind hole": (blind(5), blind(5) - rm.cylinder(8, 2).translate((0, 5, 0)), {}),
    "corner": (corner(20), corner(23), {}),
    "turned": (*beside(turned), {}),
    "each turned": (turned(rm.box(PLATE)) - turned(rm.cylinder(8, 10)), turned(drilled(12)), {}),
    "scaled": (*beside(lambda n: n.scale((1, 2, 0.7))), {}),
    "each scaled": (rm.box(PLATE).scale(1.3) - rm.cylinder(8, 10).scale(1.3), drilled(12).scale(1.3), {}),
    "far": (*beside(far), {"camera": camera((1e4, 0, 0))}),
    "each far": (far(rm.box(PLATE)) - far(rm.cylinder(8, 10)), far(drilled(12)), {"camera": camera((1e4, 0, 0))}),
    "dome": (dome(10), dome(12), {}),
    "pond": (pond(6), pond(8), {}),
    "itself": (rm.sphere(20) - rm.sphere(20) | FLOOR, FLOOR, {}),
    "xor": (rm.box(PLATE) ^ rm.cylinder(8, 10), drilled(12), {}),
    "xor of itself": ((rm.sphere(20) ^ rm.sphere(20)) | FLOOR, FLOOR, {"lights": []}),
    "complement of a union": ((rm.box(PLATE).complement() | rm.cylinder(8, 10)).complement(), drilled(12), {}),
    "touching": (rm.box(20) & rm.box(20).translate((20, 0, 0)) | FLOOR, FLOOR, {}),
    "smooth": (
        rm.difference(rm.box(PLATE), rm.cylinder(8, 10), k=0.5),
        rm.difference(rm.box(PLATE), rm.cylinder(8, 12), k=0.5),
        {},
    ),
    "extruded": (
        *(
            (rm.rectangle((40, 40)) - rm.rectangle((w, 2 * w)).translate((w / 2, 0))).extrude(10).rotate(-1.57, "x")
            for w in (20, 22)
        ),
        {},
    ),
    "orthographic": (*beside(lambda n: n), {"camera": camera(projection="orthographic")}),
    "shadow": (*beside(lambda n: n | FLOOR), {"lights": [SUN]}),
    "glass": (*beside(lambda n: n.material(GLASS) | FLOOR), {"lights": [SUN], "bounces": 4, "quality": TREE}),
    "mirror": (
        *beside(lambda n: n.translate((0, 10, 0)) | FLOOR.material(MIRROR)),
        {
            "camera": rm.Camera(position=(50, 10, 60), target=(0, -10, 0)),
            "lights": [SUN],
            "bounces": 1,
            "quality": TREE,
        },
    ),
}


HALF = rm.box((10, 20, 20))
CELLS = rm.box(10).repeat(10, 2), rm.box(20)
"""Copies that touch, and the solid that they make."""
ALL_GLASS = {"lights": [SUN], "bounces": 4, "quality": TREE}


def of_glass(node: rm.Node) -> rm.Node:
    return node.material(GLASS) | FLOOR.material(rm.Material(color=rm.checker((0.9, 0.9, 0.9), (0.1, 0.1, 0.1), 8)))


CASES |= {
    "touching glass": (
        of_glass(HALF.translate((-5, 0, 0)) | HALF.translate((5, 0, 0))),
        of_glass(rm.box(20)),
        ALL_GLASS,
    ),
    "touching glass of many": (
        *(
            rm.union(*(rm.box(8).translate((14 * i - 140, -20, -60)) for i in range(20)), of_glass(node))
            for node in (HALF.translate((-5, 0, 0)) | HALF.translate((5, 0, 0)), rm.box(20))
        ),
        ALL_GLASS,
    ),
    "glass instances": (
        of_glass(rm.instances(HALF, [(-5, 0, 0), (5, 0, 0)])),
        of_glass(rm.box(20)),
        ALL_GLASS,
    ),
    "glass cells": (of_glass(CELLS[0]), of_glass(CELLS[1]), ALL_GLASS),
    "endless glass cells": (
        of_glass(rm.box((10, 4, 10)).repeat((10, None, 10))),
        of_glass(rm.slab(thickness=4)),
        ALL_GLASS,
    ),
    "far glass": (
        *(of_glass(node).scale(1e3).translate((1e6, 0, 0)) for node in CELLS),
        {"camera": rm.Camera((1e6 + 3e4, 6e4, 4e4), (1e6, 0, 0)), **ALL_GLASS},
    ),
}


def shells(pixels: float) -> dict[str, rm.Node]:
    """Solids that are so thin, in pixels of a picture 90 pixels high."""
    t = pixels * PIXEL
    return {
        "sphere": rm.sphere(20) - rm.sphere(20 - t),
        "box": rm.box(40) - rm.box(40 - 2 * t),
        "skin": rm.box(40) - rm.box((20, 40, 20)).translate((0, -t, 0)),
        "sheet": rm.box(40) & rm.box(40).translate((0, 40 - t, 0)),
        "turned sheet": turned(rm.box(40) & rm.box(40).translate((0, 40 - t, 0))),
    }


def random_case(seed: int) -> tuple[rm.Node, rm.Node, dict[str, object]]:
    """A box with one to three tools through faces, moved, turned and scaled; the tools of the second are longer."""
    random = np.random.default_rng(seed)
    size = random.uniform(15, 40, 3)
    solids = [rm.box(tuple(size)), rm.box(tuple(size))]
    tools: list[list[rm.Node]] = [[], []]
    for _ in range(random.integers(1, 4)):
        depth, wide, place = size[1] * random.uniform(0.3, 1), random.uniform(3, 8, 2), random.uniform(-0.3, 0.3, 2)
        side = 1.0 if random.random() < 0.5 else -1.0
        kind = random.integers(3)
        for i, more in enumerate((0.0, 2.0)):
            height = depth + more
            tool = (rm.box((wide[0], height, wide[1])), rm.cylinder(wide[0], height), rm.cone(wide[0], height, wide[0]))
            at = (place[0] * size[0], side * (0.5 * size[1] - 0.5 * depth + 0.5 * more), place[1] * size[2])
            tools[i].append(tool[kind].translate(at))
    axis, angle, factor = tuple(random.normal(size=3)), random.uniform(0, 6), random.choice([1.0, 0.6, 1.3])
    moved = tuple(random.choice([0.0, 1.0, 300.0], 3) * random.normal(size=3))

    def place(node: rm.Node) -> rm.Node:
        return node.rotate(angle, axis).scale(factor).translate(moved)

    flush = rm.difference(*(place(n) for n in (solids[0], *tools[0])))  # each operand by itself: rounding differs
    return flush, place(rm.difference(solids[1], *tools[1])), {"camera": camera(moved), "lights": [SUN]}


def differences(
    renderer: rm.Renderer, flush: rm.Node, clear: rm.Node, **given: object
) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Pixels that differ in hit, depth and colour from the solid cut clear: of the shader and of the reference."""
    given = {"camera": camera(), **given}
    right = rm.truth(rm.Scene(clear, **given), size=renderer.size, outputs=("color",))
    frame = renderer.render(rm.Scene(flush, **given), outputs=("depth", "color"))
    truth = rm.truth(rm.Scene(flush, **given), size=renderer.size, outputs=("color",))
    found = []
    for depth, color in ((frame.depth, frame.color), (truth.depth, truth.color)):
        both = np.isfinite(depth) & right.hit
        apart = np.abs(depth[both] - right.depth[both]) > 2e-3 * right.depth[both]
        colored = np.abs(color - right.color).max(axis=-1) > 0.02
        found.append((int((np.isfinite(depth) != right.hit).sum()), int(apart.sum()), int(colored.sum())))
    return found[0], found[1]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--random", type=int, default=40)
    parser.add_argument("--size", default="160x90")
    given = parser.parse_args(arguments)
    width, height = map(int, given.size.split("x"))
    cases = CASES | {f"random {seed}": random_case(seed) for seed in range(given.random)}
    with rm.Renderer((width, height)) as renderer:
        for name in given.names or cases:
            flush, clear, more = cases[name]
            shader, truth = differences(renderer, flush, clear, **more)
            print(f"{name}: shader {shader}, reference {truth}: hits, depths, colours that differ", flush=True)
        for pixels in (0.1, 0.01, 0.001, 0.0003):
            for name, node in shells(pixels).items() if not given.names else ():
                shader, truth = differences(renderer, node, node)
                print(f"{name}, {pixels:g} pixels thick: shader {shader} of {width * height}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
