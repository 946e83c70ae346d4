"""Materials

`.material(...)` paints a solid. `color` alone is a cheap Phong material; `albedo`, `roughness` and `metalness` select
physical ones. A colour is linear RGB, a name of CSS, or a string such as `"#c86432"`. Metals reflect their
surroundings: `GradientSky(light=True)` is a sky that they reflect, and that lights all surfaces.
"""

import raymarch as rm

enamel = rm.Material(albedo="#2f6f7f", roughness=0.25)
gold = rm.Material(albedo=(1.0, 0.78, 0.34), metalness=1, roughness=0.1)
light, dark = (0.3, 0.17, 0.09), (0.23, 0.13, 0.07)
wood = rm.Material(albedo=rm.stripes(light, dark, 0.5, "x"), roughness=0.6)

wall = rm.sphere(1.0).shell(0.09).translate((0, 1.05, 0))
wall = wall - rm.box((3, 1.2, 3)).translate((0, 1.75, 0))
foot = rm.cylinder(0.4, 0.14).translate((0, 0.07, 0))
bowl = rm.union(wall, foot, k=0.15).material(enamel)
ball = rm.sphere(0.5).translate((0, 0.72, 0)).material(gold)

scene = rm.Scene(
    bowl | ball | rm.plane().material(wood),
    camera=rm.Camera(position=(1.6, 3.0, 5.6), target=(0, 0.55, 0), fov=30),
    sky=rm.GradientSky(light=True),
)
