"""A carpet: a plane displaced by a height map of folds, rows of tufts and a pattern cut into the pile.

After figure 4 of Hadji-Kyriacou and Arandjelovic, "Raymarching Distance Fields with CUDA" (2021). The light is
low, so the folds and the pile cast shadows on the carpet.
"""

import numpy as np

import raymarch as rm
from raymarch.expr.vocabulary import abs, length, max, min, mix, smoothstep, vec2, vec3

SIDE, ROWS, n = 4.0, 110, 770


def ornament(x, z, absolute=abs, largest=max, smallest=min, hypot=lambda x, z: length(vec2(x, z))):
    """Distance to the pattern's lines: a border, a medallion and a lozenge around it. Takes arrays or expressions."""
    edge = largest(absolute(x), absolute(z))
    border = absolute(absolute(edge - 1.62) - 0.12)
    lozenge = absolute(absolute(x) + absolute(z) - 1.25) * 0.7
    return smallest(smallest(border, lozenge), absolute(absolute(hypot(x, z) - 0.42) - 0.12))


# The tufts have random heights, on cloth with shallow folds.
random = np.random.default_rng(4)
z, x = np.mgrid[0:n, 0:n] / (n - 1) * SIDE - SIDE / 2
tufts = np.abs(np.sin(np.pi * ROWS * x / SIDE) * np.sin(np.pi * ROWS * z / SIDE)) ** 0.7
uneven = np.kron(random.uniform(0.65, 1.0, (ROWS, ROWS)), np.ones((n // ROWS, n // ROWS)))
cut = 0.5 + 0.5 * np.clip(ornament(x, z, np.abs, np.maximum, np.minimum, np.hypot) / 0.02 - 0.5, 0, 1)
folds = 0.5 + 0.3 * np.sin(2.3 * x + 0.9 * z + 0.6) + 0.2 * np.sin(1.1 * x - 2.7 * z)
height = 0.19 * folds + 0.03 * tufts * uneven * cut


def dyed(p):
    """Albedo of the wool: lines, field and ground of the same pattern."""
    line = 1 - smoothstep(0.03, 0.05, ornament(p.x, p.z))
    inner = 1 - smoothstep(1.23, 1.27, abs(p.x) + abs(p.z))
    ground = mix(vec3(0.1, 0.04, 0.13), vec3(0.42, 0.05, 0.04), inner)
    return mix(ground, vec3(0.62, 0.42, 0.16), line)


wool = rm.Material(albedo=dyed, roughness=0.95)
boards = rm.Material(albedo=rm.stripes((0.4, 0.26, 0.15), (0.33, 0.2, 0.11), 0.35, "x"), roughness=0.5)
clay = rm.Material(albedo=(0.85, 0.8, 0.7), roughness=0.35)

carpet = rm.heightmap(height / height.max(), size=(SIDE, SIDE), height=float(height.max()), base=0.03).material(wool)
floor = rm.plane(offset=-0.03).material(boards)
ball = rm.sphere(0.3).translate((0.75, 0.4, -0.55)).material(clay)

scene = rm.Scene(
    carpet | floor | ball,
    camera=rm.Camera(position=(1.7, 1.5, 2.9), target=(0.05, 0, 0.1), fov=42),
    lights=[rm.Sun(sun_direction=(-1, 0.6, 0.3), color=(1, 0.93, 0.8), intensity=1.6, shadow=True, softness=0.03)],
    sky=rm.GradientSky(light=True),
    occlusion=rm.AmbientOcclusion(reach=0.08),
    quality=rm.Quality(samples=4),
)
