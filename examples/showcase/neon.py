"""A neon sign on a wall. The tubes are many times brighter than white, and `Bloom` spreads a share of their light."""

import math

import raymarch as rm

pink, blue = (1.0, 0.12, 0.35), (0.1, 0.45, 1.0)


def neon(tube, color):
    return tube.material(rm.Material(albedo=(0, 0, 0), emission=tuple(9 * c for c in color)))


moon = rm.capped_torus(1.15, 0.045, 4.4).rotate(math.pi / 2, "x").rotate(2.8, "z")
turns = [((0.55, 0.16)[k % 2], math.pi / 4 * k) for k in range(9)]
star = rm.polyline_tube([(r * math.cos(a), r * math.sin(a), 0) for r, a in turns], 0.04)
stars = star.translate((0.3, 0, 0)) | star.scale(0.4).translate((1.35, 1.0, 0))

tiles = rm.grid_lines((0.5, 0.36, 0.32), (0.1, 0.08, 0.08), 0.5, 0.03, axis="z")
wall = rm.plane(normal=(0, 0, 1), offset=-0.25).material(rm.Material(albedo=tiles, roughness=0.8))
floor = rm.plane(offset=-1.6).material(rm.Material(albedo=(0.25, 0.25, 0.28), roughness=0.4))

around = [(1.15 * math.cos(a), 1.15 * math.sin(a), 0.25) for a in (1.4, 2.8, 4.2)]
scene = rm.Scene(
    neon(moon, blue) | neon(stars, pink) | wall | floor,
    camera=rm.Camera(position=(-1.6, 0.1, 5.2), target=(0.15, -0.1, 0), fov=40),
    lights=[
        *(rm.PointLight(place, color=blue, intensity=0.35) for place in around),
        rm.PointLight((0.3, 0, 0.4), color=pink, intensity=0.7),
    ],
    sky=(0, 0, 0),
    tone=rm.ToneMapping("aces"),
    quality=rm.Quality(samples=4),
    post=[rm.Bloom(strength=rm.Param("bloom", 0.25, 0, 1), radius=0.12)],
)
