"""A carpet

Data from outside becomes a field, too: `rm.heightmap` takes an array or a picture of heights. The array here holds rows
of tufts on a cloth with shallow folds. A value of a material may be a function of the point: `dyed` draws rings.
"""

import numpy as np

import raymarch as rm

enamel = rm.Material(albedo="#2f6f7f", roughness=0.25)
gold = rm.Material(albedo=(1.0, 0.78, 0.34), metalness=1, roughness=0.1)
coral = rm.Material(albedo="#d8543c", roughness=0.35)
light, dark = (0.3, 0.17, 0.09), (0.23, 0.13, 0.07)
wood = rm.Material(albedo=rm.stripes(light, dark, 0.5, "x"), roughness=0.6)
lift = rm.Param("lift", 0.0, 0.0, 1.0)


def dyed(p):
    """Albedo of the wool: rings of three colours about the y axis."""
    radius = rm.length(p.xz)
    rings = rm.smoothstep(-0.1, 0.1, rm.sin(9 * radius))
    return rm.mix(rm.vec3(0.34, 0.05, 0.05), rm.vec3(0.62, 0.45, 0.22), rings)


z, x = np.mgrid[0:400, 0:400] / 399 * 4.4 - 2.2
tufts = np.abs(np.sin(40 * x) * np.sin(40 * z)) ** 0.7
folds = 1 + np.sin(2.3 * x + 0.9 * z) * np.sin(1.1 * x - 2.7 * z)
height = 0.03 * tufts + 0.02 * folds
wool = rm.Material(albedo=dyed, roughness=0.95)
carpet = rm.heightmap(height, size=(4.4, 4.4), height=0.07, base=0.03).material(wool)

wall = rm.sphere(1.0).shell(0.09).translate((0, 1.05, 0))
wall = wall - rm.box((3, 1.2, 3)).translate((0, 1.75, 0))
foot = rm.cylinder(0.4, 0.14).translate((0, 0.07, 0))
bowl = rm.union(wall, foot, k=0.15).material(enamel)
ball = rm.sphere(0.5).translate((0, 0.72 + lift, 0)).material(gold)
bead = rm.sphere(0.13).translate((1.45, 0.13, 0)).material(coral)
beads = bead.polar(30).rotate(0.2 * rm.time, "y")
things = (bowl | ball | beads).translate((0, 0.05, 0))
warm = (1, 0.95, 0.86)
sun = rm.Sun((-1, 1.3, 0.7), color=warm, intensity=1.6, shadow=True, softness=0.06)

scene = rm.Scene(
    things | carpet | rm.plane(offset=-0.03).material(wood),
    camera=rm.Camera(position=(1.6, 3.0, 5.6), target=(0, 0.55, 0), fov=30),
    lights=[sun],
    sky=rm.GradientSky(light=True),
    occlusion=rm.AmbientOcclusion(reach=0.3),
    tone=rm.ToneMapping("aces", exposure=0.2),
)
