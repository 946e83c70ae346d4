"""What each effect costs in its example: evaluations of the field a pixel and milliseconds, with it and without.

python -m tests.lab.effects [WIDTH]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.cost.effects import ablations
from raymarch.plan import lights
from raymarch.scene import load
from raymarch.scene.light_kinds import hard
from raymarch.scene.parameter import set_values
from tests.lab.evaluation_counts import count_evaluations

ROUNDS = 15
FOLDER = Path(__file__).parents[2] / "examples" / "papers"


def with_lights(scene: rm.Scene, change: Callable[[Any], Any], count: int | None = None) -> rm.Scene:
    """The scene with its lights changed, or only the first of them."""
    return scene.replace(lights=tuple(change(light) for light in scene.lights[:count]))


def _shadowless(light: Any) -> Any:
    return light.replace(shadow=False)


def _as(penumbra: str) -> Callable[[Any], Any]:
    return lambda light: light.replace(penumbra=penumbra)


def _same(light: Any) -> Any:
    return light


def pairs() -> Iterator[tuple[str, str, rm.Scene, rm.Scene]]:
    """Effect, example, the scene with it and without."""
    soft = load(FOLDER / "soft_shadows.py")
    bare = with_lights(soft, _shadowless)
    yield "hard shadow", "soft_shadows", with_lights(soft, hard), bare
    for penumbra in ("cone", "triangulated", "two-sided"):
        yield f"{penumbra} shadow", "soft_shadows", with_lights(soft, _as(penumbra)), bare
    yield "occlusion", "soft_shadows", soft, soft.replace(occlusion=None)
    yield "sky light", "soft_shadows", soft, soft.replace(sky=rm.Sky((0.25, 0.3, 0.4)), occlusion=None)
    yield "fog", "soft_shadows", soft, soft.replace(fog=None)
    smooth = load(FOLDER / "smoothing.py")
    plain = rm.Scene(rm.union(rm.sphere(0.6).translate((0.1, 0.75, 0.1)), rm.box((1.3, 1, 1.3)).round(0.03), k=0.6))
    yield "microfacets, mixed", "smoothing", smooth, smooth.replace(node=plain.node | rm.plane(offset=-0.5))
    carpet = load(FOLDER / "carpet.py")
    yield "shadow of a height map", "carpet", carpet, with_lights(carpet, _shadowless)
    bulb = load(FOLDER / "mandelbulb.py")
    yield "shadow of a fractal", "mandelbulb", bulb, with_lights(bulb, _shadowless)
    glass = load(FOLDER / "glass.py").replace(quality=rm.Quality())
    yield "8 bounces, a sample", "glass", glass, glass.replace(bounces=0)
    yield "1 bounce, a sample", "glass", glass.replace(bounces=1), glass.replace(bounces=0)
    tree = load(FOLDER / "ray_tree.py")
    yield "tree of 4 bounces", "ray_tree", tree, tree.replace(bounces=0)
    one = tree.replace(quality=rm.Quality(), bounces=4)
    yield "4 bounces, a sample", "ray_tree", one, one.replace(bounces=0)
    many = load(FOLDER / "lights.py")
    yield "64 lights for 1", "lights", many, with_lights(many, _same, 1)
    yield "64 lights for 1, no shadows", "lights", with_lights(many, _shadowless), with_lights(many, _shadowless, 1)
    yield "64 shadows", "lights", many, with_lights(many, _shadowless)

    maps = load(FOLDER.parent / "textures.py")
    yield "13 maps", "textures", maps, dict(ablations(maps))["maps"]


def times(renderer: rm.Renderer, one: rm.Scene, other: rm.Scene) -> NDArray[np.float64]:
    """Milliseconds of frames of both, in turns, (ROUNDS, 2)."""
    for scene in (one, other, one, other):
        renderer.render(scene)
    found = [[renderer.render(scene).milliseconds for scene in (one, other)] for _ in range(ROUNDS)]
    return np.array(found)


def row(renderer: rm.Renderer, one: rm.Scene, other: rm.Scene) -> str:
    """Evaluations a pixel after the hit, medians of the times, and quartiles of the ratios of neighbours in time."""
    asked, less = (float(count_evaluations(renderer, scene).shading.mean()) for scene in (one, other))
    taken = times(renderer, one, other)
    spent, sooner = np.median(taken, axis=0)
    low, middle, high = np.percentile(taken[:, 0] / taken[:, 1], (25, 50, 75))
    return f"{asked:>12.1f}{less:>9.1f}{spent:>9.2f}{sooner:>9.2f}{middle:>7.2f} [{low:.2f}, {high:.2f}]"


def main() -> None:
    width = int(sys.argv[1]) if len(sys.argv) > 1 else 320
    size = (width, width * 9 // 16)
    print(f"{size[0]} x {size[1]} pixels; evaluations of the field a pixel after the hit; milliseconds a frame")
    print(
        f"{'effect':<28}{'example':<14}{'evaluations':>12}{'without':>9}{'ms':>9}{'without':>9}{'ratio':>7} quartiles"
    )
    with rm.Renderer(size) as renderer:
        for effect, example, one, other in pairs():
            print(f"{effect:<28}{example:<14}{row(renderer, one, other)}", flush=True)
    scene = load(FOLDER / "lights.py")
    rows = lights.rows(scene, set_values(scene.parameters, {}))
    each = rows.nbytes // len(rows)
    print(f"64 lights: {rows.nbytes} bytes, {each} each, in a texture of {rows.shape[1]} x {len(rows)}")


if __name__ == "__main__":
    main()
