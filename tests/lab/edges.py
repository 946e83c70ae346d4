"""Edges by distance against 1, 4 and 16 samples: errors against 1,024 samples, and evaluations.

python -m tests.lab.edges [--picture docs/pictures/edges.png]

Errors are of sRGB values from 0 to 1. Edge pixels are those in which the depth jumps, at four by four rays a pixel.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.cost.flip import flip
from raymarch.scene import load

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE, KNOWN, FINE = (240, 160), 1024, 4
PART = (112, 46, 48, 32)
"""Corner and size of the part of hello.py that the picture shows."""


def wire() -> rm.Scene:
    """A wire of .35 pixels across the picture."""
    solid = rm.capsule((-2, -0.7, 0), (2, 0.9, 0), 0.004).material(rm.Material(color=(0.9, 0.8, 0.3)))
    camera = rm.Camera(position=(0, 0, 5), target=(0, 0, 0), fov=40)
    return rm.Scene(solid, camera=camera, lights=[rm.Sun()], sky=(0.1, 0.2, 0.4))


def encoded(color: NDArray[np.float32]) -> NDArray[np.float64]:
    light = np.clip(color.astype(float), 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def at_edges(scene: rm.Scene, renderer: rm.Renderer) -> NDArray[np.bool_]:
    """The pixels in which neighbouring rays end so far apart that the surface between them would be seen at less than
    seven degrees."""
    width, height = SIZE
    with rm.Renderer((FINE * width, FINE * height), context=renderer.context) as fine:
        depth = np.minimum(fine.render(scene, outputs=("depth",)).depth.astype(float), 1e9)
    step = 2 * np.tan(np.radians(float(scene.camera.fov.data)) / 2) / (FINE * height)
    jumps = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        following = np.roll(depth, -1, axis)
        jump = np.abs(following - depth) > 8 * step * np.minimum(following, depth)
        np.moveaxis(jump, axis, 0)[-1] = False  # nothing follows the last one
        jumps |= jump | np.roll(jump, 1, axis)
    return jumps.reshape(height, FINE, width, FINE).any((1, 3))


def measure(name: str, scene: rm.Scene) -> dict[str, NDArray[np.float64]]:
    """Prints a row for each way, and returns the pictures."""
    pictures = {}
    with rm.Renderer(SIZE) as renderer:
        edge = at_edges(scene, renderer)
        known = encoded(renderer.render(scene.replace(quality=rm.Quality(samples=KNOWN))).color)
        print(f"{name}: edges in {edge.mean():.1%} of the pixels")
        for label, quality in (
            ("1 sample", rm.Quality()),
            ("4 samples", rm.Quality(samples=4)),
            ("16 samples", rm.Quality(samples=16)),
            ("distance", rm.Quality(edges="distance")),
        ):
            made = scene.replace(quality=quality)
            found = pictures[label] = encoded(renderer.render(made).color)
            off = found - known
            seen = flip(known.astype("f4"), found.astype("f4"))
            print(
                f"  {label:<10} edges: rms {np.sqrt((off[edge] ** 2).mean()):.4f}"
                f", largest {np.abs(off[edge]).max():.2f}"
                f"; all: rms {np.sqrt((off**2).mean()):.4f}, FLIP {seen.mean():.4f}"
                f"; {evaluations_of(made, renderer) * quality.samples:.1f} evaluations"
            )
    return {**pictures, "known": known}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="write a part of hello.py: 1 sample, by distance, 1,024 samples")
    given = parser.parse_args()
    scenes = {name: load(EXAMPLES / f"{name}.py") for name in ("hello", "village", "csg", "columns")}
    for name, scene in {**scenes, "wire": wire()}.items():
        pictures = measure(name, scene.replace(post=[]))
        if name == "hello" and given.picture is not None:
            x, y, width, height = PART
            parts = [pictures[k][y : y + height, x : x + width] for k in ("1 sample", "distance", "known")]
            row = np.rint(255 * np.hstack(parts)).astype("u1").repeat(5, 0).repeat(5, 1)
            Image.fromarray(row).save(given.picture)


if __name__ == "__main__":
    main()
