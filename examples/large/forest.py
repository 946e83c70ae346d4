"""A forest: 6,000 firs, 3,000 broad-leaved trees and 3,000 rocks, as rows of a texture."""

import numpy as np

import raymarch as rm

SIDE = 240.0
random = np.random.default_rng(7)


def places(n, low, high):
    """n positions on the ground, each with a turn about y and a scale: (n, 3, 4) matrices for column vectors."""
    at = random.uniform(-SIDE / 2, SIDE / 2, (n, 2))
    turn, scale = random.uniform(0.0, 2.0 * np.pi, n), random.uniform(low, high, n)
    c, s, zero, one = np.cos(turn), np.sin(turn), np.zeros(n), np.ones(n)
    rotation = np.moveaxis(np.array([[c, zero, s], [zero, one, zero], [-s, zero, c]]), -1, 0)
    offset = np.stack([at[:, 0], zero, at[:, 1]], axis=1)
    return np.concatenate([scale[:, None, None] * rotation, offset[:, :, None]], axis=2)


def shades(color, spread, n=12):
    """Materials around a colour."""
    return [
        rm.Material(color=np.clip(np.array(color) * random.uniform(1 - spread, 1 + spread, 3), 0, 1)) for _ in range(n)
    ]


def chosen(palette, n):
    return palette, random.integers(0, len(palette), n)


bark = rm.Material(color=(0.25, 0.16, 0.1))
trunk = rm.cylinder(0.12, 1.2).translate((0, 0.6, 0)).material(bark)
fir = trunk | rm.cone(0.9, 1.8).translate((0, 1.6, 0)) | rm.cone(0.65, 1.5).translate((0, 2.6, 0))
crown = rm.sphere(0.9).translate((0, 2.0, 0)) | rm.sphere(0.6).translate((0.6, 1.6, 0.2))
broad = trunk.scale(1.3) | crown
rock = rm.box((0.7, 0.5, 0.6)).round(0.1)

firs = rm.instances(fir, places(6000, 0.7, 1.5), chosen(shades((0.1, 0.28, 0.13), 0.35), 6000))
broads = rm.instances(broad, places(3000, 0.7, 1.4), chosen(shades((0.3, 0.42, 0.12), 0.35), 3000))
rocks = rm.instances(rock, places(3000, 0.4, 1.1), chosen(shades((0.45, 0.43, 0.4), 0.2), 3000))
ground = rm.plane().material(rm.Material(color=(0.3, 0.33, 0.18), specular=0.0))

scene = rm.Scene(
    ground | firs | broads | rocks,
    camera=rm.Camera(position=(0, 9, 60), target=(0, 1, 25)),
    lights=[rm.Sun(sun_direction=(0.5, 0.6, 0.4), shadow=True)],
    sky=rm.GradientSky(),
    fog=rm.Fog(density=0.003),
)
