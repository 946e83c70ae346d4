"""Whether loops over constants draw what folds draw: `python -m tests.lab.rolled SCENE.py ... [--size 16x9]`.

Draws each scene with the text for hardware, written out and rolled (`raymarch/expr/rolled.py`), on softpipe, whose
loops have no limit of turns, and prints how many pixels differ. Exits with 1 if a depth differs, or a colour by more
than 1 of 255. It takes about a minute for each scene: softpipe is an interpreter.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from raymarch.gpu.context import open_context
from raymarch.gpu.renderer import Renderer
from raymarch.plan.device import HARDWARE
from raymarch.scene.file import load
from raymarch.scene.scene import as_scene

NAMES = "showcase/chess", "showcase/lanterns", "village", "papers/array"
EXAMPLES = [f"examples/{name}.py" for name in NAMES]


def drawn(file: str, size: tuple[int, int], rolls: bool) -> tuple[np.ndarray, np.ndarray]:
    """The picture, 0 to 255, and the depths."""
    with open_context("egl") as context:
        assert context.driver.renderer.startswith("softpipe"), context.driver
        context.device = replace(HARDWARE, rolls=rolls)
        with Renderer(size, context=context) as renderer:
            frame = renderer.render(as_scene("rolled", load(Path(file))))
            return np.asarray(frame.image()).astype(int), frame.depth.copy()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=EXAMPLES)
    parser.add_argument("--size", default="16x9")
    asked = parser.parse_args()
    os.environ["GALLIUM_DRIVER"] = "softpipe"
    width, height = map(int, asked.size.split("x"))
    code = 0
    for file in asked.scenes:
        (a, near), (b, far) = (drawn(file, (width, height), rolls) for rolls in (False, True))
        apart, moved = np.abs(a - b).max(axis=-1), ~((near == far) | (np.isnan(near) & np.isnan(far)))
        print(
            f"{file}: {np.count_nonzero(apart)} of {apart.size} colours differ, by {apart.max()} of 255 at most; ",
            end="",
        )
        print(f"{np.count_nonzero(moved)} depths differ")
        code |= int(apart.max() > 1 or moved.any())
    sys.exit(code)


if __name__ == "__main__":
    main()
