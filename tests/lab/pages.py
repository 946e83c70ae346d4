"""Exported pages in a headless Chromium: their pictures against the renderer's, sizes, and screenshots.

    python -m tests.lab.pages [NAME ...] [--out FOLDER]

A pixel is off if it differs by more than 2 of 255. Pixels on edges may be: a ray of float32 falls on either side. Each
page is drawn at 1280x720 and 390x844 and saved as a screenshot.
"""

from __future__ import annotations

import argparse
import sys
import time as clock_time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.scene import load
from tests.support.chromium import Browser, find

EXAMPLES = Path(rm.__file__).parents[1] / "examples"
SIZE = (320, 180)


def on_edges(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels that differ by more than 12 of 255 from one of their 8 neighbours."""
    height, width, _ = picture.shape
    around = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    shifted = [around[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.max([np.abs(s - picture).max(axis=2) for s in shifted], axis=0) > 12


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--out", type=Path, default=Path("pages"))
    given = parser.parse_args()
    if find() is None:
        print("no Chromium is installed: install the package chromium")
        return 2
    given.out.mkdir(parents=True, exist_ok=True)
    scenes = sorted([*EXAMPLES.glob("*.py"), *EXAMPLES.glob("papers/*.py")])
    worst = 0
    print("page                     kB  compile s   off   off, not on edges   of pixels")
    with Browser() as browser, rm.Renderer(SIZE) as renderer:
        for file in scenes:
            name = f"{file.parent.name}-{file.stem}" if file.parent != EXAMPLES else file.stem
            if given.names and name not in given.names:
                continue
            target = given.out / f"{name}.html"
            try:
                scene = load(file)
                rm.export(scene, target)
            except RaymarchError as fault:
                print(f"{name:20} refused: {fault}")
                continue
            start = clock_time.perf_counter()
            browser.open(target)
            spent = clock_time.perf_counter() - start
            browser.run("raymarch.play(false), raymarch.state.time = 0, raymarch.change()")
            found = browser.picture(*SIZE, samples=scene.quality.samples).astype(int)
            renderer.forget()
            wanted = np.asarray(renderer.render(scene).image()).astype(int)
            off = np.abs(found - wanted).max(axis=2) > 2
            inner = int((off & ~on_edges(wanted)).sum())
            worst = max(worst, inner)
            size = target.stat().st_size / 1e3
            print(f"{name:20} {size:7.0f} {spent:10.1f} {off.sum():5} {inner:19} {off.size:11}", flush=True)
            for width, height in ((1280, 720), (390, 844)):
                browser.resize(width, height, mobile=width < 700)
                wait = "new Promise((done) => { const end = Date.now() + 20000; const look = () => "
                wait += "raymarch.progress() > 0 || Date.now() > end ? done() : setTimeout(look, 100); "
                browser.run("new Promise((done) => setTimeout(done, 500))")
                browser.run(wait + "look(); })")
                browser.screenshot(given.out / f"{name}-{width}x{height}.png")
            browser.resize(1280, 720)
            for message in browser.messages:
                print(message)
            browser.messages.clear()
    return 1 if worst else 0


if __name__ == "__main__":
    sys.exit(main())
