"""Exported shaders of every example, every scene of the shader tests and every node sample, given to compilers.

`python -m tests.lab.compilers [WORD ...]` compiles .wgsl by naga and, if there is a Chromium, by Tint; and .glsl by
glslang. With words, only samples whose names contain one of them. The exit status is 1 if a compiler refuses one.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import raymarch as rm
from raymarch.errors import RaymarchError, SceneWarning
from raymarch.scene import load
from tests.support import chromium, node_samples, shader_samples
from tests.support.wgsl_device import Device

EXAMPLES = Path(rm.__file__).parents[1] / "examples"


def scenes() -> Iterator[tuple[str, Callable[[], Any]]]:
    """All samples by name."""
    for file in sorted(EXAMPLES.rglob("*.py")):
        yield str(file.relative_to(EXAMPLES)), lambda file=file: load(file)
    for name, scene in shader_samples.scenes().items():
        yield f"scene {name}", lambda scene=scene: scene
    for sample in node_samples.samples():
        yield f"node {sample.id}", lambda sample=sample: solid(sample.build())


def solid(node: rm.Node) -> rm.Scene:
    """A scene of a node."""
    return rm.Scene(node.extrude(1.0) if node.dimension == 2 else node)


def refused_by_glslang(file: Path) -> str:
    done = subprocess.run(["glslangValidator", "-S", "frag", str(file)], capture_output=True, text=True)
    return done.stdout if done.returncode else ""


def main(words: list[str]) -> int:
    found: Counter[str] = Counter()
    warnings.simplefilter("ignore", SceneWarning)
    with tempfile.TemporaryDirectory() as folder, Device() as naga:
        tint = chromium.Tint() if chromium.find() else None
        for name, build in scenes():
            if words and not any(word in name for word in words):
                continue
            for suffix in ("wgsl", "glsl"):
                file = Path(folder, f"made.{suffix}")
                try:
                    rm.export(build(), file)
                except RaymarchError as fault:
                    found[f".{suffix} not exported"] += 1
                    if not name.startswith("node "):
                        print(f"{name}: .{suffix}: not exported: {fault}", flush=True)
                    continue
                compilers = {"glslang": lambda file=file: refused_by_glslang(file)}
                if suffix == "wgsl":
                    code = file.read_text()
                    compilers = {"naga": lambda code=code: naga.refused(code)}
                    if tint is not None:
                        compilers["Tint"] = lambda code=code: tint.refused(code)
                for compiler, refused in compilers.items():
                    message = refused()
                    found[f"{compiler} {'refuses' if message else 'takes'}"] += 1
                    if message:
                        print(f"{name}: {compiler}: {message}", flush=True)
        if tint is not None:
            tint.close()
    for what, count in sorted(found.items()):
        print(f"{count:5d} {what}")
    return int(any("refuses" in what for what in found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
