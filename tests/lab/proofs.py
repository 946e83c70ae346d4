"""Proofs of the examples: `python -m tests.lab.proofs [SCENE.py ...] [--size 160x90] [--within 0.05px]`."""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import raymarch as rm
from raymarch.scene.file import load

EXAMPLES = Path(__file__).parents[2] / "examples"
SLOW = ("chess", "array", "blob", "city", "forest", "lamps", "molecule", "costly", "mandelbulb")
"""Examples that take minutes; ask for them by name."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--size", default="160x90")
    parser.add_argument("--within", default="0.05px")
    given = parser.parse_args()
    width, height = map(int, given.size.split("x"))
    scenes = given.scenes or sorted(f for f in EXAMPLES.rglob("*.py") if f.stem not in SLOW)
    for file in scenes:
        begun = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = rm.prove(load(file), size=(width, height), within=given.within)
        print(
            f"| {file.stem} | {100 * found.share:.3f} % | {found.contradicted} | {found.open} "
            f"| {found.evaluations.mean():.1f} |",
            f" {time.process_time() - begun:.1f} s CPU",
            flush=True,
        )


if __name__ == "__main__":
    main()
