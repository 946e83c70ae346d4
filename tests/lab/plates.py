"""Multiple importance sampling against points of the lights alone, at equal time, on examples/showcase/plates.py.

python -m tests.lab.plates [--picture docs/pictures/plates.png]

Prints CPU times of a picture in turns, and how many times smaller the mean squared error of each plate is.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from unittest import mock

import numpy as np
from PIL import Image

import raymarch as rm
from raymarch.scene import load
from raymarch.scene.material import Material

EXAMPLE = Path(__file__).parents[2] / "examples" / "showcase" / "plates.py"
SIZE = (320, 180)
SAMPLES, TURNS, KNOWN = 4, 7, 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="write both pictures side by side")
    given = parser.parse_args()
    base = load(EXAMPLE)

    def of(samples: int) -> rm.Scene:
        return base.replace(quality=rm.Quality(samples=samples))

    with rm.Renderer(SIZE) as both, rm.Renderer(SIZE) as points:
        known = both.render(of(KNOWN)).color.astype(float)
        index = both.render(of(1)).material

        def alone(samples: int) -> rm.Frame:
            with mock.patch.object(Material, "glossy", False):
                frame = points.render(of(samples))
                _ = frame.color
            return frame

        def combined(samples: int) -> rm.Frame:
            frame = both.render(of(samples))
            _ = frame.color
            return frame

        spent: dict[str, list[float]] = {"points": [], "both": []}
        for turn in range(TURNS + 1):
            for name, draw in (("points", alone), ("both", combined)):
                begun = time.process_time()
                draw(SAMPLES)
                if turn:
                    spent[name].append(time.process_time() - begun)
        ratio = float(np.median(spent["both"]) / np.median(spent["points"]))
        more = round(SAMPLES * ratio)
        print(f"time of both / points alone, {SAMPLES} samples each: {ratio:.2f}; equal time: {more} samples of points")
        right, equal, same = combined(SAMPLES), alone(more), alone(SAMPLES)
        rows, columns = index.shape
        inner = np.zeros_like(index, bool)
        near = [index[i : i + rows - 2, j : j + columns - 2] == index[1:-1, 1:-1] for i in range(3) for j in range(3)]
        inner[1:-1, 1:-1] = np.all(near, axis=0)
        for i, material in enumerate(base.materials):
            if not material.metallic:
                continue
            seen = inner & (index == i)
            error = [float(np.mean((f.color[seen] - known[seen]) ** 2)) for f in (same, equal, right)]
            print(
                f"roughness {float(material.roughness.data):.2f}: {error[0] / error[2]:.1f} times smaller at equal "
                f"samples, {error[1] / error[2]:.1f} at equal time"
            )
        if given.picture is not None:
            picture = Image.new("RGB", (2 * SIZE[0], SIZE[1]))
            picture.paste(equal.image(), (0, 0))
            picture.paste(right.image(), (SIZE[0], 0))
            picture.save(given.picture)


if __name__ == "__main__":
    main()
