"""Registers, waves, spills, scratch, code and compile time of all passes, as AMD's compiler reports them.

python -m tests.lab.gpu_compiler                   # every example, RDNA 2, Vega and Polaris
python -m tests.lab.gpu_compiler hello village     # some
python -m tests.lab.gpu_compiler --nodes           # every node sample, too
python -m tests.lab.gpu_compiler --family navi21   # one chip
python -m tests.lab.gpu_compiler plates --tracer bracketing     # with a tracer in place of that of the scene
python -m tests.lab.gpu_compiler --loops           # the loops of hello beside those of a tracer written by hand

No GPU is needed: Mesa's RADV compiles for chips that are not there. How long a frame takes it cannot say. Registers
limit how many waves hide latency; spills and scratch are memory traffic; code beyond 32 kB leaves RDNA 2's cache.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import raymarch as rm
from raymarch.gpu.prepare import prepare
from raymarch.plan.device import DeviceClass, device_class
from raymarch.scene import load
from tests.bench import basic
from tests.support import node_samples
from tests.support.gpu_compiler import FAMILIES, Compiler, Statistics, missing

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = (1920, 1080)
BY_HAND = "#version 330 core\n#extension GL_ARB_explicit_attrib_location : enable\n" + basic.TEXT
"""A tracer written by hand, of the scene of hello. Its camera is constant."""


def scenes(names: list[str], nodes: bool) -> Iterator[tuple[str, Callable[[], Any]]]:
    """The scenes by name, each with the function that makes it."""
    for file in sorted(EXAMPLES.rglob("*.py")):
        if not names or file.stem in names:
            yield file.relative_to(EXAMPLES).with_suffix("").as_posix(), lambda file=file: load(file)
    for sample in node_samples.samples() if nodes else ():
        yield f"node {sample.id}", lambda sample=sample: _scene(sample.build())


def _scene(node: rm.Node) -> rm.Scene:
    return rm.Scene(node.extrude(1.0) if node.dimension == 2 else node)


def passes_of(
    scene: rm.Scene, compiler: Compiler, family: str, device: DeviceClass | None = None
) -> dict[str, Statistics]:
    """The statistics of each pass of a picture with one ray per pixel. device : hardware, unless the environment names
    another class."""
    return {name: compiler.statistics(text, family) for name, text in texts_of(scene, device).items()}


def texts_of(scene: rm.Scene, device: DeviceClass | None = None) -> Mapping[str, str]:
    """The text of each pass of a picture with one ray per pixel."""
    single = scene.replace(quality=scene.quality.replace(samples=1))
    return prepare(single, ("color",), SIZE, device or device_class(is_software=False)).texts


def show_loops(compiler: Compiler, family: str) -> None:
    """Prints the instructions of each loop of hello and of the tracer of `tests/bench`: march, then shadow."""
    texts = texts_of(load(EXAMPLES / "hello.py"))
    print("instructions of a turn of each loop: of the shortest way, and of all blocks")
    for name, text in {"by hand": BY_HAND, **{f"hello {name}": text for name, text in texts.items()}}.items():
        print(f"{name:16} {family:9} " + "; ".join(f"{least}, {most}" for least, most in compiler.loops(text, family)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="names of examples")
    parser.add_argument("--nodes", action="store_true", help="also the samples of all nodes")
    parser.add_argument("--loops", action="store_true", help="instructions of the loops of hello and of one by hand")
    parser.add_argument("--family", choices=FAMILIES, help="one chip")
    parser.add_argument("--tracer", help="of all scenes")
    given = parser.parse_args()
    if lacking := missing():
        print(f"missing: {lacking}")
        return 2
    warnings.simplefilter("ignore")
    total, bad = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        compiler = Compiler(Path(folder))
        if given.loops:
            for family in [given.family] if given.family else FAMILIES:
                show_loops(compiler, family)
            return 0
        print(f"{'pass':40} {'chip':9} {'ms':>6} registers waves spilled scratch {'kB':>6} instructions latency")
        for name, build in scenes(given.names, given.nodes):
            for family in [given.family] if given.family else FAMILIES:
                try:
                    scene = build()
                    if given.tracer:
                        scene = scene.replace(quality=scene.quality.replace(tracer=given.tracer))
                    found = passes_of(scene, compiler, family)
                except (rm.RaymarchError, RuntimeError) as fault:
                    print(f"{name:40} {family:9} refused: {str(fault)[:200]}", flush=True)
                    continue
                for chosen, s in found.items():
                    total, bad = total + s.milliseconds, bad + bool(s.spilled or s.scratch)
                    print(
                        f"{name + ' ' + chosen:40} {family:9} {s.milliseconds:6.0f} {s.registers:9} {s.waves:5} "
                        f"{s.spilled:7} {s.scratch:7} {s.code / 1024:6.1f} {s.instructions:12} {s.latency:7}",
                        flush=True,
                    )
    print(f"{total / 1e3:.1f} s to compile; {bad} passes spill or use scratch")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
