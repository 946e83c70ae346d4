"""Tori, spheres, boxes and cylinders on an infinite table, after the second scene of Bálint and Valasek (2018).

The camera looks down, so that every ray hits. `--set horizon=1` looks along the table, with grazing rays.
"""

import math

import raymarch as rm
from raymarch.expr.vocabulary import mix, vec3

horizon = rm.Param("horizon", 0.0, min=0.0, max=1.0)


def paint(red, green, blue, roughness=0.45, metalness=0.0):
    return rm.Material(albedo=(red, green, blue), roughness=roughness, metalness=metalness)


brick, sea, leaf, sun, plum = (
    paint(0.75, 0.16, 0.08),
    paint(0.04, 0.3, 0.55),
    paint(0.12, 0.42, 0.14),
    paint(0.85, 0.5, 0.06),
    paint(0.3, 0.1, 0.35),
)
ivory, brass = paint(0.75, 0.68, 0.55), paint(0.9, 0.62, 0.3, roughness=0.3, metalness=1.0)

ring = rm.torus(major=1.0, minor=0.28)
dice = rm.box((1.2, 1.2, 1.2)).round(0.06)
can = rm.cylinder(radius=0.5, height=1.8)

solids = [
    ring.translate((0, 0.28, 0)).material(brass),
    rm.sphere(0.62).translate((0, 0.86, 0)).material(ivory),
    ring.rotate(math.pi / 2, "x").rotate(0.7, "y").translate((-2.9, 1.28, -1.4)).material(sea),
    ring.scale(0.7).translate((2.2, 0.2, 1.9)).material(plum),
    dice.rotate(0.5, "y").translate((-2.3, 0.66, 1.3)).material(brick),
    dice.scale(0.7).rotate(-0.3, "y").translate((-2.25, 1.78, 1.35)).material(sun),
    dice.rotate(0.2, "y").translate((3.0, 0.66, -1.9)).material(leaf),
    can.translate((2.7, 0.9, 0.2)).material(sun),
    can.rotate(math.pi / 2, "x").rotate(1.1, "y").translate((-0.4, 0.5, 2.5)).material(leaf),
    can.scale((1.3, 0.6, 1.3)).translate((0.2, 0.54, -2.7)).material(brick),
    rm.sphere(0.8).translate((2.0, 0.8, -3.6)).material(sea),
    rm.sphere(0.45).translate((1.3, 0.45, 2.9)).material(brick),
    rm.sphere(0.45).translate((-1.5, 0.45, -0.2)).material(plum),
    rm.sphere(0.55).translate((-3.4, 0.55, 2.9)).material(ivory),
]
table = rm.plane().material(rm.Material(albedo=rm.checker((0.42, 0.4, 0.37), (0.3, 0.29, 0.28), 1.0), roughness=0.7))

scene = rm.Scene(
    rm.union(table, *solids),
    camera=rm.Camera(
        position=mix(vec3(2.8, 6.2, 7.2), vec3(3.6, 1.3, 7.6), horizon),
        target=mix(vec3(0, 0.2, -0.1), vec3(-0.1, 0.9, 0), horizon),
        fov=42,
    ),
    lights=[rm.Sun(sun_direction=(-1.2, 2, 0.9), color=(1, 0.94, 0.85), intensity=1.4, shadow=True)],
    sky=rm.GradientSky(light=True),
    fog=rm.Fog(density=0.004),
)
