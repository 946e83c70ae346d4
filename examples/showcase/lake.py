"""Mountains around a lake in the morning: a height map from NumPy arrays, reflected in still water.

The heights are octaves of noise whose ridges are sharp. Height and noise choose between grass, rock and snow.
"""

import numpy as np

import raymarch as rm

random = np.random.default_rng(9)


def value_noise(n, cells):
    """Cubic B-splines over random values in -1..1: `cells` cells along each side of an n x n grid."""
    values = random.uniform(-1, 1, (cells + 3, cells + 3))
    at = np.linspace(0, cells, n)
    i, f = at.astype(int), at % 1
    weights = np.stack([(1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3]) / 6
    rows = sum(weights[k][:, None] * values[np.minimum(i + k, cells + 2)] for k in range(4))
    return sum(weights[k] * rows[:, np.minimum(i + k, cells + 2)] for k in range(4))


def ridges(n, octaves=7):
    """Heights in 0..1. Each octave is weighted by the one before it, so that valleys stay smooth."""
    heights, weight = np.zeros((n, n)), 1.0
    for octave in range(octaves):
        ridge = np.clip(1 - np.abs(2 * value_noise(n, 4 << octave)), 0, 1) ** 2
        heights += 0.5**octave * weight * ridge
        weight = ridge
    return heights / heights.max()


x, z = np.meshgrid(np.linspace(-1, 1, 512), np.linspace(-1, 1, 512))
shore = np.hypot(x / 0.9, (z - 0.75) / 1.6) + 0.06 * np.sin(7 * x + 3 * z)
rise = np.clip((shore - 0.28) / 0.75, 0, 1) ** 1.3
heights = ridges(512) * rise + 0.02 * np.clip(8 * rise, 0, 1)

grass, rock, snow = rm.vec3(0.035, 0.055, 0.016), rm.vec3(0.16, 0.125, 0.1), rm.vec3(0.62, 0.66, 0.74)
patches = rm.noise(-0.7, 0.7, scale=0.5, octaves=4)


def cover(p):
    height = p.y + patches(p)
    return rm.mix(rm.mix(grass, rock, rm.smoothstep(0.4, 1.1, height)), snow, rm.smoothstep(1.9, 2.3, height))


land = rm.heightmap(heights, size=(20, 20), height=5.5, base=0.5).translate((0, -0.3, 0))
water = rm.Material(albedo=(0.01, 0.03, 0.04), roughness=0.0, f0=0.02)
zenith, horizon = rm.vec3(0.16, 0.3, 0.56), rm.vec3(0.85, 0.62, 0.48)

scene = rm.Scene(
    land.material(rm.Material(albedo=cover, roughness=0.95)) | rm.plane().material(water),
    camera=rm.Camera(position=(0.3, 0.5, 8.5), target=(-0.2, 1.0, 0), fov=48),
    lights=[rm.Sun(sun_direction=(-0.8, 0.42, 0.35), color=(1, 0.72, 0.46), intensity=3.4, shadow=True)],
    sky=rm.Sky(lambda d: rm.mix(horizon, zenith, rm.smoothstep(-0.05, 0.45, d.y)), light=True),
    fog=rm.Fog(density=0.02),
    bounces=1,
    quality=rm.Quality(integrator="whitted"),
    tone=rm.ToneMapping("aces"),
)
