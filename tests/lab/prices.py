"""Whether measured prices choose well: scenes that they were not measured on, with each choice forced.

python -m tests.lab.prices [NAME...] [--size 640x360] [--rounds 7] [--class-alone]

Measures the driver, then draws 12 scenes by the prices found, by those of the class, and with one choice forced after
the other; draws take turns. A cost is what a frame takes and a twentieth of the first, in CPU time on a driver that
draws with the CPU. Prints the cost of "auto" as a multiple of the least, by medians, with the interval of the rounds
but for the lowest and the highest. Ends with code 1 if a median is above 1.05. GALLIUM_DRIVER=softpipe draws with
softpipe: --size 64x36 then.
"""

from __future__ import annotations

import os

os.environ.update(MESA_SHADER_CACHE_DISABLE="true", MESA_GLSL_CACHE_DISABLE="true", RAYMARCH_MEASURED="off")
os.environ.pop("GALLIVM_PERF", None)

import argparse
import datetime
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

import raymarch as rm
from raymarch.cost.prices import Bench, measure
from raymarch.gpu.context import open_context
from raymarch.gpu.measured_prices import replaced
from raymarch.plan import plan
from raymarch.prices import NEVER, Prices

BAR = 1.05
SUN = rm.Sun(sun_direction=(0.6, 1, 0.5), shadow=True)
SOFT = rm.Sun(sun_direction=(0.6, 1, 0.5), shadow=True, softness=0.05)
RANDOM = np.random.default_rng(7)


def seen(node: rm.Node, far: float = 4.0, light: rm.Sun = SUN) -> rm.Scene:
    """A scene of a solid on a floor."""
    floor = rm.plane(offset=-0.7).material(rm.Material("white"))
    camera = rm.Camera(position=(0.5 * far, 0.6 * far, far), target=(0, 0, 0), fov=45)
    return rm.Scene(node | floor, camera, [light])


def scattered(forms: Sequence[Callable[[float], rm.Node]], count: int, half: float) -> rm.Node:
    """Solids of random sizes at random places."""
    places = RANDOM.uniform(-half, half, (count, 3)) * (1.0, 0.4, 1.0)
    sizes = RANDOM.uniform(0.15, 0.35, count)
    return rm.union(*(forms[i % len(forms)](float(sizes[i])).translate(places[i]) for i in range(count)))


def terrain() -> rm.Node:
    x, y = np.meshgrid(np.linspace(-3, 3, 64), np.linspace(-3, 3, 64))
    return rm.heightmap(0.3 * np.sin(2 * x) * np.cos(1.5 * y), size=(6, 6))


SCENES: dict[str, Callable[[], rm.Scene]] = {
    "few": lambda: seen(rm.sphere(0.5) | rm.box(0.7).translate((1, 0, 0)) | rm.torus(0.5, 0.15).translate((-1, 0, 0))),
    "balls 20": lambda: seen(scattered([rm.sphere], 20, 1.5)),
    "mixed 60": lambda: seen(
        scattered([rm.sphere, lambda s: rm.box(1.5 * s).round(0.02), lambda s: rm.torus(s, 0.06)], 60, 2.0)
    ),
    "rings 90": lambda: seen(scattered([lambda s: rm.torus(s, 0.05).rotate(1.0, "x")], 90, 2.0)),
    "boxes 160": lambda: seen(scattered([lambda s: rm.box(s).rotate(0.4, "y")], 160, 2.5)),
    "helices 6": lambda: seen(
        rm.union(*(rm.helix(0.3, 0.05 + 0.01 * i, 0.2, 2.0).translate((0.9 * i - 2.2, 0, 0)) for i in range(6)))
    ),
    "knots 8": lambda: seen(
        rm.union(
            *(
                rm.union(rm.truncated_icosahedron(0.4), rm.icosidodecahedron(0.4).rotate(0.3 + i, "x"), k=0.1)
                .twist(0.3)
                .translate((i % 4 - 1.5, 0, -1.2 * (i // 4)))
                for i in range(8)
            )
        )
    ),
    "blob": lambda: seen(
        rm.union(*(rm.sphere(0.3).translate((np.cos(2 * i), 0.1 * i - 0.4, np.sin(2 * i))) for i in range(12)), k=0.2)
    ),
    "columns": lambda: rm.Scene(
        rm.union(rm.cylinder(0.25, 6).round(0.03), rm.box((0.8, 0.2, 0.8)), k=0.1).repeat((2.0, None, 2.0))
        | rm.plane(offset=-0.2),
        rm.Camera((1, 1.5, 5), (0, 1, 0), fov=60),
        [SUN],
    ),
    "csg": lambda: seen(
        rm.union(
            *(
                ((rm.box(0.8) & rm.sphere(0.52)) - rm.cylinder(0.2, 2).rotate(0.2 * i, "x")).translate(
                    (1.1 * i - 1.6, 0, 0)
                )
                for i in range(4)
            )
        ),
        light=SOFT,
    ),
    "terrain": lambda: rm.Scene(terrain(), rm.Camera((0, 2, 4), (0, 0, 0), fov=50), [SUN]),
    "sponges 5": lambda: seen(
        rm.union(*(rm.menger(0.8, 5).rotate(0.3 * i, "y").translate((1.1 * i - 2.2, 0, 0)) for i in range(5)))
    ),
}


def forced(prices: Prices) -> dict[str, Prices]:
    """Prices that force one choice each."""
    each = {
        "boxes": {"skip": 0.0, "operands": 1},
        "no boxes": {"skip": NEVER},
        "rows": {"look_up": 0.0},
        "text": {"look_up": NEVER, "costly_objects": NEVER, "slow_text": NEVER},
        "closed forms": {"closed_form": 1e-9},
        "no closed forms": {"closed_form": NEVER},
        "cones": {"draw": 1e-9},
        "no cones": {"draw": NEVER},
        "advance": {"advance": NEVER, "patience": 10.0},
        "no advance": {"advance": 0.0},
    }
    return {name: replaced(prices, values) for name, values in each.items()}


def signature(scene: rm.Scene, bench: Bench, prices: Prices, size: tuple[int, int]) -> tuple[object, ...]:
    """What the prices choose for a scene: equal for equal shaders."""
    from raymarch.shader import assemble

    made = plan(scene, size=size, device=replace(bench.device, prices=prices))
    return tuple(p.name for p in made.passes), assemble(made).text()


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--class-alone", action="store_true")
    given = parser.parse_args(arguments)
    width, height = (int(n) for n in given.size.split("x"))
    warnings.simplefilter("ignore")
    worst = 0.0
    with open_context() as context:
        bench = Bench(context, context.driver.class_alone)
        prices = bench.device.prices
        if not given.class_alone:
            made, found = measure(bench, datetime.date.today().isoformat())
            prices = replaced(prices, made.prices)
            for each in found:
                interval = f"{each.low:.3g} to {each.high:.3g}, class {each.standard:g}"
                print(f"{each.name:16}{each.value:10.3g}  {interval}  {each.kept}", flush=True)
        print(f"{context.driver.renderer}, {given.size}: cost of the least = 1 (frames alone in brackets)")
        for name, make in SCENES.items():
            if given.names and name not in given.names:
                continue
            scene, size = make(), (width, height)
            sides = {"auto": prices, "class": bench.device.prices, **forced(prices)}
            same: dict[tuple[object, ...], str] = {}
            labels = {side: same.setdefault(signature(scene, bench, p, size), side) for side, p in sides.items()}
            drawn = list(same.values())
            times = bench.times(scene, [sides[side] for side in drawn], size, given.rounds)
            costs, frames = times.costs, times.frames
            median = dict(zip(drawn, np.median(costs, axis=0), strict=True))
            alone = dict(zip(drawn, np.median(frames, axis=0), strict=True))
            best = min(median, key=lambda side: median[side])
            ratios = np.sort(costs[:, 0] / costs[:, drawn.index(best)])
            fastest = min(alone.values())
            ratio, of_class = median["auto"] / median[best], median[labels["class"]] / median[best]
            worst = max(worst, ratio)
            print(
                f"  {name:12} auto {ratio:.3f} ({ratios[1]:.3f} to {ratios[-2]:.3f}; {alone['auto'] / fastest:.3f}), "
                f"class {of_class:.3f} ({alone[labels['class']] / fastest:.3f}), least: {best}, "
                f"{median[best]:.1f} ms; " + ", ".join(f"{side} {median[side] / median[best]:.2f}" for side in drawn),
                flush=True,
            )
    print(f"worst {worst:.3f}, bar {BAR}")
    return int(worst > BAR)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
