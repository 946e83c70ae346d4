"""Many from one

`.polar(n)` repeats a solid n times about the y axis, and `.repeat(spacing, count)` along the axes. A repetition
evaluates only the nearest copies, so thirty beads cost about as much as two.
"""

import raymarch as rm

enamel = rm.Material(albedo="#2f6f7f", roughness=0.25)
gold = rm.Material(albedo=(1.0, 0.78, 0.34), metalness=1, roughness=0.1)
coral = rm.Material(albedo="#d8543c", roughness=0.35)
light, dark = (0.3, 0.17, 0.09), (0.23, 0.13, 0.07)
wood = rm.Material(albedo=rm.stripes(light, dark, 0.5, "x"), roughness=0.6)

wall = rm.sphere(1.0).shell(0.09).translate((0, 1.05, 0))
wall = wall - rm.box((3, 1.2, 3)).translate((0, 1.75, 0))
foot = rm.cylinder(0.4, 0.14).translate((0, 0.07, 0))
bowl = rm.union(wall, foot, k=0.15).material(enamel)
ball = rm.sphere(0.5).translate((0, 0.72, 0)).material(gold)
bead = rm.sphere(0.13).translate((1.45, 0.13, 0)).material(coral)
beads = bead.polar(30)
sun = rm.Sun((-1, 1.3, 0.7), color=(1, 0.95, 0.86), intensity=1.6, shadow=True)

scene = rm.Scene(
    bowl | ball | beads | rm.plane().material(wood),
    camera=rm.Camera(position=(1.6, 3.0, 5.6), target=(0, 0.55, 0), fov=30),
    lights=[sun],
    sky=rm.GradientSky(light=True),
)
