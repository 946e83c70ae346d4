"""Three carved lanterns at dusk: each is lit from inside and casts its pattern on the floor.

The patterns are a gyroid, rings of round holes, and twisted ribs, all cut out of thin shells.
"""

import math

import raymarch as rm

brass = rm.Material(albedo=(0.8, 0.5, 0.22), metalness=0.6, roughness=0.5)
clay = rm.Material(albedo=(0.62, 0.22, 0.12), roughness=0.7)
jade = rm.Material(albedo=(0.12, 0.42, 0.36), roughness=0.5)
floor = rm.Material(albedo=(0.5, 0.48, 0.47), roughness=0.6)
bulb = rm.Material(albedo=(0, 0, 0), emission=(9, 6, 3))

shell = rm.sphere(1.0).shell(0.06)
carved = (shell & rm.gyroid(period=0.6, thickness=0.08)).material(brass)
rings = [
    rm.capsule((0, 0, 0), (2 * math.cos(a), 2 * math.sin(a), 0), 0.16 * math.cos(a)).polar(count)
    for a, count in ((-0.9, 7), (-0.45, 10), (0, 11), (0.45, 10), (0.9, 7))
]
pierced = rm.difference(shell, *rings).material(clay)
ribbed = (shell - rm.box((0.2, 1.7, 2)).translate((0, 0, 1)).polar(10).twist(1.0)).material(jade)

lanterns, lights = [], []
for body, scale, (x, z), color, power in (
    (carved, 1.0, (-0.15, 0), (1, 0.58, 0.24), 7.0),
    (pierced, 0.72, (2.3, -1.1), (1, 0.45, 0.2), 4.5),
    (ribbed, 0.58, (-1.9, 1.0), (1, 0.72, 0.4), 2.5),
):
    centre = (x, 1.04 * scale, z)
    lanterns.append((body | rm.sphere(0.07).translate((0, -0.3, 0)).material(bulb)).scale(scale).translate(centre))
    lights.append(rm.PointLight(centre, color=color, intensity=power, shadow=True, radius=0.03))

dusk = rm.Sky(
    lambda d: rm.mix(rm.vec3(0.085, 0.05, 0.08), rm.vec3(0.02, 0.035, 0.09), rm.smoothstep(0.0, 0.4, d.y)), light=True
)
scene = rm.Scene(
    rm.union(*lanterns) | rm.plane().material(floor),
    camera=rm.Camera(position=(0.7, 2.9, 6.4), target=(0.15, 0.55, 0), fov=36),
    lights=lights,
    sky=dusk,
    fog=rm.Fog(density=0.05),
    tone=rm.ToneMapping("aces", exposure=0.3, dither=True),
)
