"""Evaluations of soft shadows and ambient occlusion, for each tracer and penumbra.

python -m tests.lab.soft_steps                    # the examples that have them
python -m tests.lab.soft_steps --pairs 64         # the pairs of tests/lab/penumbras.py
python -m tests.lab.soft_steps --tracers bracketing advance --penumbras cone --scenes examples/papers/array.py

An evaluation is a call of a field, of how far it is free, or of its gradient, as `raymarch.cost.effects` counts them.
Those of an effect are the difference of the picture with it and without it, per pixel of the picture. "hard" is the
same light without a size.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.errors import RaymarchError
from raymarch.gpu import Renderer
from raymarch.scene import load
from raymarch.scene.light_kinds import hard
from tests.lab.penumbras import KINDS, drawn
from tests.lab.penumbras import SIZE as PAIR_SIZE

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = (160, 90)
TRACERS = ("plain", "relaxed", "enhanced", "auto_relaxed", "bracketing", "advance")
PENUMBRAS = ("hard", "cone", "triangulated", "two-sided")


def softened(scene: rm.Scene, penumbra: str, tracer: str) -> rm.Scene:
    """The scene with another penumbra, or with hard shadows, and another tracer."""
    lights = [
        light if not light.soft else hard(light) if penumbra == "hard" else light.replace(penumbra=penumbra)
        for light in scene.lights
    ]
    return scene.replace(lights=lights, quality=scene.quality.replace(tracer=tracer))


def unshadowed(scene: rm.Scene) -> rm.Scene:
    """The scene without shadows of its soft lights."""
    return scene.replace(lights=[hard(light).replace(shadow=False) if light.soft else light for light in scene.lights])


def of_shadows(scene: rm.Scene, renderer: Renderer, penumbra: str, tracer: str) -> float:
    """Evaluations of the shadow rays of soft lights, per pixel."""
    made = softened(scene, penumbra, tracer)
    bare = unshadowed(scene).replace(quality=made.quality)
    return evaluations_of(made, renderer) - evaluations_of(bare, renderer)


def of_occlusion(scene: rm.Scene, renderer: Renderer) -> float:
    """Evaluations of ambient occlusion, per pixel."""
    bare = unshadowed(scene)
    return evaluations_of(bare, renderer) - evaluations_of(bare.replace(occlusion=None), renderer)


def examples() -> Iterator[tuple[str, rm.Scene]]:
    """The examples with soft lights or ambient occlusion."""
    for file in sorted(EXAMPLES.rglob("*.py")):
        if file.parent.name == "large":
            continue
        scene = load(file)
        if scene.occlusion is not None or any(light.soft for light in scene.lights):
            yield file.stem, scene


def cells(scenes: list[rm.Scene], renderer: Renderer, penumbras: list[str], tracers: list[str]) -> None:
    """Print the rows of some scenes: their mean for each penumbra and tracer."""
    for penumbra in penumbras:
        row = []
        for tracer in tracers:
            try:
                row.append(f"{np.mean([of_shadows(s, renderer, penumbra, tracer) for s in scenes]):.2f}")
            except RaymarchError as error:
                row.append(type(error).__name__)
        print(f"| {penumbra} | {' | '.join(row)} |", flush=True)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tracers", nargs="+", choices=(*TRACERS, "auto"), default=list(TRACERS))
    parser.add_argument("--penumbras", nargs="+", choices=PENUMBRAS, default=list(PENUMBRAS))
    parser.add_argument("--scenes", nargs="+", type=Path, default=[])
    given = parser.parse_args(arguments)
    if given.pairs:
        rng = np.random.default_rng(given.seed)
        pairs = [drawn(rng, KINDS[i % len(KINDS)]).scene("cone") for i in range(given.pairs)]
        with Renderer(PAIR_SIZE) as renderer:
            print(f"{given.pairs} pairs\n| | {' | '.join(given.tracers)} |")
            cells(pairs, renderer, given.penumbras, given.tracers)
        return 0
    named = [(file.stem, load(file)) for file in given.scenes] or examples()
    with Renderer(SIZE) as renderer:
        for name, scene in named:
            dimmed = f", occlusion {of_occlusion(scene, renderer):.2f}" if scene.occlusion is not None else ""
            print(f"{name}{dimmed}\n| | {' | '.join(given.tracers)} |", flush=True)
            if any(light.soft for light in scene.lights):
                cells([scene], renderer, given.penumbras, given.tracers)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
