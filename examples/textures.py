"""Texture maps: a tiled floor up to the horizon, a brick block, a dented metal ball, and relief from a function.

The images are generated here, so no files are needed. A file name may replace any array.
"""

import numpy as np

import raymarch as rm
from raymarch.expr.vocabulary import sin

SIDE = 256
y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) / SIDE
rng = np.random.default_rng(1)


def clouds(octaves=4):
    """Smooth tileable noise from 0 to 1."""
    total = np.zeros((SIDE, SIDE))
    for _ in range(12 * octaves):
        u, v = rng.integers(-(2**octaves), 2**octaves + 1, 2)
        total += np.sin(2 * np.pi * (u * x + v * y + rng.uniform())) / (1 + np.hypot(u, v))
    return (total - total.min()) / np.ptp(total)


def bricks(rows=8, columns=4, joint=0.06):
    """The height of a wall, 0 in the joints and 1 on the bricks, and a random number per brick."""
    row = np.floor(y * rows)
    across = x * columns + 0.5 * (row % 2)
    edge = np.minimum(0.5 - np.abs(across % 1 - 0.5), (0.5 - np.abs(y * rows % 1 - 0.5)) * columns / rows)
    shade = np.sin(12.9 * np.floor(across % columns) + 78.2 * row) * 43758.5 % 1
    return np.clip(edge / joint, 0, 1), shade


flat, shade = bricks()
rough = clouds()
stone = (0.75 + 0.25 * rough)[..., None]
red = (0.35 + 0.25 * shade)[..., None] * np.array([1.0, 0.45, 0.3])
wall = {
    "albedo": np.where(flat[..., None] > 0.5, red, 0.5) * stone,
    "height": 0.8 * flat + 0.2 * rough,
    "occlusion": 0.4 + 0.6 * flat,
    "roughness": 0.95 - 0.2 * flat,
}
brick = rm.Material(**{name: rm.triplanar(picture, size=1.6) for name, picture in wall.items()}, height_scale=0.035)

squares = (np.floor(x * 2) + np.floor(y * 2)) % 2
tiles = np.stack([0.15 + 0.65 * squares, 0.2 + 0.55 * squares, 0.25 + 0.45 * squares], axis=-1) * stone
floor = rm.Material(albedo=rm.planar(tiles, 1.0, "y"), roughness=rm.planar(0.15 + 0.4 * rough, 1.0, "y"))

dents = rm.triplanar(clouds(3), size=1.3, hardness=8)
metal = rm.Material(albedo=(0.95, 0.75, 0.4), metalness=1, roughness=0.25, height=dents, height_scale=0.06)
ripples = rm.Material(albedo=(0.2, 0.45, 0.6), roughness=0.3, height=lambda p: sin(70 * p.x), height_scale=0.008)

scene = rm.Scene(
    rm.plane().material(floor)
    | rm.box((1.3, 1.3, 1.3)).round(0.04).material(brick).rotate(0.5, "y").translate((-0.9, 0.69, -0.6))
    | rm.sphere(0.6).material(metal).translate((0.75, 0.6, 0.1))
    | rm.torus(0.3, 0.12).material(ripples).rotate(0.4, "x").translate((-0.25, 0.24, 0.9)),
    camera=rm.Camera((0.3, 1.2, 3.6), (-0.05, 0.55, 0), fov=42),
    lights=[rm.Sun((0.7, 0.9, 0.5), shadow=True, softness=0.03)],
    sky=rm.GradientSky(light=True),
)
