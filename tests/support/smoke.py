"""The commands on tiny pictures, in one process, for interpreters and versions of packages; see `tests.interpreters`.

Needs the dependencies of raymarch alone. What an extra adds is tried where its package is installed.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
import tempfile
import warnings
from importlib.util import find_spec
from pathlib import Path

with warnings.catch_warnings():
    warnings.simplefilter("ignore", SyntaxWarning)  # of pyrr, where it is compiled first
    import pyrr  # noqa: F401

import raymarch
from raymarch.cli import main

SCENE = """
import raymarch as rm

ball = rm.sphere(rm.Param("radius", 0.8, 0.5, 1.0)).material(rm.Material(albedo=(0.8, 0.2, 0.1), roughness=0.4))
scene = rm.Scene(ball | rm.plane(offset=-1), lights=[rm.Sun((1, 2, 1), shadow=True)], sky=rm.GradientSky(light=True))
"""
EXTRAS = {
    "av": ["render SCENE -o film.mp4 --size 16x16 --frames 0:2"],
    "OpenEXR": ["render SCENE -o picture.exr --size 8x5"],
    "trimesh": ["export SCENE -o mesh.ply --cells 8 --box=-1,-1,-1:1,1,1"],
    "matplotlib": [
        "cost SCENE --size 8x5 --repeats 1 --reference-samples 1 --cross epsilon --axis epsilon=.5 --plot cost.png"
    ],
}
"""Commands that need a package, by its name."""

COMMANDS = [
    "--help",
    *(f"{command} --help" for command in ("render", "view", "explain", "cost", "export", "doctor")),
    "render SCENE -o picture.png --size 8x5 --set radius=.7",
    "render SCENE -o film.gif --size 8x5 --frames 0:2",
    "explain SCENE --json",
    "export SCENE -o scene.glsl",
    "export SCENE -o scene.wgsl",
    "export SCENE -o scene.html",
    "cost SCENE --size 8x5 --repeats 1 --reference-samples 1 --cross epsilon --axis epsilon=.5 --json cost.json",
]


def faults() -> list[str]:
    """A sentence for each module and command that fails."""
    found = []
    for module in pkgutil.walk_packages(raymarch.__path__, "raymarch."):
        try:
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)
        except ModuleNotFoundError as fault:
            if fault.name is None or fault.name.startswith("raymarch"):
                found.append(f"{module.name}: {fault}")
    for command in [*COMMANDS, *(c for package, more in EXTRAS.items() if find_spec(package) for c in more)]:
        given = command.split()
        try:
            main(["scene.py" if word == "SCENE" else word for word in given])
        except SystemExit as stop:
            if stop.code:
                found.append(f"raymarch {command}: exit status {stop.code}")
        except Exception as fault:
            found.append(f"raymarch {command}: {type(fault).__name__}: {fault}")
        if "-o" in given and not Path(given[given.index("-o") + 1]).exists():
            found.append(f"raymarch {command}: no file")
    return found


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("scene.py").write_text(SCENE)
        lines = faults()
    print("\n".join(lines), file=sys.stderr)
    sys.exit(bool(lines))
