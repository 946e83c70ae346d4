"""A carpet: a plane displaced by a height map, lit from low so that its tufts shade each other.

After figure 4 of Hadji-Kyriacou and Arandjelovic, "Raymarching Distance Fields with CUDA" (2021).
"""

import numpy as np

import raymarch as rm

# Tufts on a woven grid, each a little out of place, with a border worked lower.
n = 320
y, x = np.mgrid[0:n, 0:n] / n
drift = 0.35 * np.sin(13 * x + 7 * y) + 0.3 * np.sin(29 * y - 11 * x)
loops = np.sin(np.pi * 32 * x + drift) ** 2 * np.sin(np.pi * 32 * y + drift) ** 2
edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
pile = 0.45 + 0.55 * np.clip(np.abs(edge - 0.1) / 0.015 - 1, 0, 1)
height = loops * pile

wool = rm.Material(albedo=rm.noise((0.35, 0.05, 0.04), (0.6, 0.16, 0.08), 0.25, octaves=2), roughness=0.9)
boards = rm.Material(albedo=rm.stripes((0.4, 0.26, 0.15), (0.33, 0.2, 0.11), 0.35, "x"), roughness=0.5)

carpet = rm.heightmap(height, size=(4, 4), height=0.07, base=0.03).material(wool)
floor = rm.plane(offset=-0.03).material(boards)
ball = rm.sphere(0.35).translate((0.6, 0.4, 0.2)).material(rm.Material(albedo=(0.9, 0.85, 0.7), roughness=0.2))

scene = rm.Scene(
    carpet | floor | ball,
    camera=rm.Camera(position=(1.6, 1.1, 2.6), target=(0.2, 0, 0.2), fov=42),
    lights=[rm.Sun(direction=(-1, 0.7, 0.3), color=(1, 0.93, 0.8), intensity=2.2, shadow=True, softness=0.03)],
    sky=rm.GradientSky(light=True),
    occlusion=rm.Occlusion(reach=0.12),
    tone=rm.Tone("agx", exposure=0.4),
)
