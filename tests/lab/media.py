"""Light that a medium scatters once, against Mitsuba 3's volumetric path tracer of depth 2.

python -m tests.lab.media [WIDTH [SAMPLES]]

Needs `pip install mitsuba`. A box of even matter, and of random numbers on a grid, lit by a lamp or a sun, before a
black sky. Printed are the relative error of the mean light with many steps, the median over lit pixels of the
difference over the mean light, the standard error of Mitsuba's mean, and the error of the mean light with the steps by
default.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm

LOW, HIGH = np.array((-1.0, -0.5, -0.8)), np.array((1.0, 0.6, 0.9))
EYE, TARGET, FOV = (1.2, 1.0, 4.5), (0.0, 0.0, 0.0), 32.0
LAMP, TO_SUN = (0.9, 1.6, 0.8), (0.4, 0.8, 0.3)
ALBEDO = (0.9, 0.6, 0.3)
LIGHTS = ("lamp", "sun")
FINE = {"steps": 200, "light_steps": 50}
GRID: NDArray[np.float64] = 6.0 * np.random.default_rng(4).random((5, 4, 6)) ** 2
"""Densities at points (x, y, z); the outermost lie on the faces of the box."""


@dataclass(frozen=True)
class Case:
    """A medium: density is None for the grid. g : anisotropy. light : one of LIGHTS."""

    density: float | None
    g: float
    light: str

    def __str__(self) -> str:
        return f"{'grid' if self.density is None else self.density:>7} {self.g:>4} {self.light:>6}"


def cases() -> Iterator[Case]:
    """Even matter and the grid, three anisotropies, both lights."""
    for density in (0.5, 4.0, None):
        for g in (-0.5, 0.0, 0.7):
            yield from (Case(density, g, light) for light in LIGHTS)


def ours(case: Case, **steps: int) -> rm.Scene:
    """The scene for us."""
    density = case.density if case.density is not None else rm.sampled(GRID, HIGH - LOW, 0.5 * (LOW + HIGH))
    medium = rm.Medium(density, (tuple(LOW), tuple(HIGH)), ALBEDO, case.g, **steps)
    light = rm.PointLight(LAMP, intensity=3.0) if case.light == "lamp" else rm.Sun(TO_SUN, intensity=2.0)
    black = rm.plane(offset=-100).material(rm.Material((0, 0, 0), specular=0))
    return rm.Scene(black, rm.Camera(EYE, TARGET, fov=FOV), [light], (0, 0, 0), medium, rm.Quality(samples=16))


def theirs(mi: Any, case: Case, size: tuple[int, int], samples: int, seed: int = 0) -> NDArray[np.float64]:
    """Mitsuba's picture, (H, W, 3), of light that is scattered once."""
    to_world = mi.ScalarTransform4f()
    scene = {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": 2, "rr_depth": 100},
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "y",
            "to_world": to_world.look_at(list(EYE), list(TARGET), [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": samples},
        },
        "box": {
            "type": "cube",
            "to_world": to_world.translate((0.5 * (LOW + HIGH)).tolist()).scale((0.5 * (HIGH - LOW)).tolist()),
            "skin": {"type": "null"},
            "interior": _medium(mi, case),
        },
        "light": _light(case),
    }
    return np.asarray(mi.render(mi.load_dict(scene), seed=seed), np.float64)[..., :3]


def _light(case: Case) -> dict[str, Any]:
    if case.light == "sun":
        way = [-x for x in TO_SUN]
        return {"type": "directional", "direction": way, "irradiance": {"type": "rgb", "value": [2.0 * math.pi] * 3}}
    return {"type": "point", "position": list(LAMP), "intensity": {"type": "rgb", "value": [3.0 * math.pi] * 3}}


def _medium(mi: Any, case: Case) -> dict[str, Any]:
    albedo, phase = {"type": "rgb", "value": list(ALBEDO)}, {"type": "hg", "g": case.g}
    if case.density is not None:
        return {"type": "homogeneous", "albedo": albedo, "sigma_t": case.density, "phase": phase}
    # Its samples lie in the middles of cells: the grid is larger than the box by half a cell on each side.
    cell = (HIGH - LOW) / (np.array(GRID.shape) - 1)
    corner, whole = LOW - 0.5 * cell, cell * np.array(GRID.shape)
    volume = {
        "type": "gridvolume",
        "grid": mi.VolumeGrid(np.ascontiguousarray(GRID.transpose(2, 1, 0)[..., None], np.float32)),
        "to_world": mi.ScalarTransform4f().translate(corner.tolist()).scale(whole.tolist()),
        "wrap_mode": "clamp",
    }
    return {"type": "heterogeneous", "albedo": albedo, "sigma_t": volume, "phase": phase}


@dataclass(frozen=True)
class Error:
    """mean : of the light of the picture, relative. median : of pixels, over the mean light. sigmas : of the mean."""

    mean: float
    median: float
    sigmas: float


def known(mi: Any, case: Case, size: tuple[int, int], samples: int) -> NDArray[np.float64]:
    """Eight independent pictures of theirs, (8, H, W, 3). samples : rays a pixel, of all of them."""
    return np.stack([theirs(mi, case, size, max(samples // 8, 1), seed) for seed in range(8)])


def compared(frame: rm.Frame, batches: NDArray[np.float64]) -> Error:
    """Our picture against the mean of theirs."""
    truth, means = batches.mean(axis=0), batches.mean(axis=(1, 2, 3))
    mine, noise = frame.color.astype(float), float(means.std(ddof=1) / math.sqrt(len(means)))
    off, difference = np.abs(mine - truth).mean(axis=-1) / truth.mean(), float(mine.mean() - truth.mean())
    return Error(difference / float(truth.mean()), float(np.median(off[truth.mean(axis=-1) > 0])), difference / noise)


def main() -> None:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    width, samples = (int(v) for v in (*sys.argv[1:], *("32", "4096")[len(sys.argv) - 1 :]))
    heads = ("mean", "median", "noise", "default")
    print("density    g  light" + "".join(f"{head:>10}" for head in heads))
    with rm.Renderer((width, width * 3 // 4)) as renderer:
        for case in cases():
            batches = known(mi, case, renderer.size, samples)
            fine, plain = (compared(renderer.render(ours(case, **steps)), batches) for steps in (FINE, {}))
            noise = abs(fine.mean / fine.sigmas)
            print(f"{case!s}" + "".join(f"{x:>10.3%}" for x in (fine.mean, fine.median, noise, plain.mean)), flush=True)


if __name__ == "__main__":
    main()
