"""Constructive solid geometry: the intersection of a rounded box and a sphere, minus three cylinders."""

import math

import raymarch as rm

body = rm.box((1.3, 1.3, 1.3)).round(0.1) & rm.sphere(1.0)
bar = rm.cylinder(radius=0.45, height=4)
bars = bar | bar.rotate(math.pi / 2, "x") | bar.rotate(math.pi / 2, "z")

red, green = rm.Material(color=(0.85, 0.15, 0.1), shininess=80), rm.Material(color=(0.2, 0.65, 0.25))
scene = rm.Scene(
    body.material(red) - bars.material(green),
    camera=rm.Camera(position=(2.2, 1.8, 2.8), target=(0, 0, 0)),
    lights=[rm.Sun(sun_direction=(1, 2, 1.5)), rm.PointLight(position=(-3, 2, 4), intensity=8)],
    sky=(0.93, 0.94, 0.96),
)
