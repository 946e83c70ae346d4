"""Parameters and time

A `Param` is a number with a name and a range. It is a uniform of the shader, so `raymarch view` moves its slider
without a recompile, and `raymarch render --set lift=0.6` sets it. `rm.time` is the time in seconds: `--time 2` draws
one moment, and `-o film.mp4 --frames 0:90` draws a film.
"""

import raymarch as rm

enamel = rm.Material(albedo="#2f6f7f", roughness=0.25)
gold = rm.Material(albedo=(1.0, 0.78, 0.34), metalness=1, roughness=0.1)
coral = rm.Material(albedo="#d8543c", roughness=0.35)
light, dark = (0.3, 0.17, 0.09), (0.23, 0.13, 0.07)
wood = rm.Material(albedo=rm.stripes(light, dark, 0.5, "x"), roughness=0.6)
lift = rm.Param("lift", 0.35, 0.0, 1.0)

wall = rm.sphere(1.0).shell(0.09).translate((0, 1.05, 0))
wall = wall - rm.box((3, 1.2, 3)).translate((0, 1.75, 0))
foot = rm.cylinder(0.4, 0.14).translate((0, 0.07, 0))
bowl = rm.union(wall, foot, k=0.15).material(enamel)
ball = rm.sphere(0.5).translate((0, 0.72 + lift, 0)).material(gold)
bead = rm.sphere(0.13).translate((1.45, 0.13, 0)).material(coral)
beads = bead.polar(30).rotate(0.2 * rm.time, "y")
warm = (1, 0.95, 0.86)
sun = rm.Sun((-1, 1.3, 0.7), color=warm, intensity=1.6, shadow=True, softness=0.06)

scene = rm.Scene(
    bowl | ball | beads | rm.plane().material(wood),
    camera=rm.Camera(position=(1.6, 3.0, 5.6), target=(0, 0.55, 0), fov=30),
    lights=[sun],
    sky=rm.GradientSky(light=True),
    occlusion=rm.AmbientOcclusion(reach=0.3),
    tone=rm.ToneMapping("aces", exposure=0.2),
)
