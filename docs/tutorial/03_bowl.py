"""Cut and blend

`.shell(t)` keeps a wall of thickness t, `a - b` cuts b out of a, and `rm.union(a, b, k=0.15)` blends two solids over a
distance of about 0.15. Together they make a bowl with a foot.
"""

import raymarch as rm

wall = rm.sphere(1.0).shell(0.09).translate((0, 1.05, 0))
wall = wall - rm.box((3, 1.2, 3)).translate((0, 1.75, 0))
foot = rm.cylinder(0.4, 0.14).translate((0, 0.07, 0))
bowl = rm.union(wall, foot, k=0.15)
floor = rm.plane().material(rm.Material(color=(0.1, 0.2, 0.25)))

scene = rm.Scene(
    bowl | floor,
    camera=rm.Camera(position=(1.6, 3.0, 5.6), target=(0, 0.55, 0), fov=30),
)
