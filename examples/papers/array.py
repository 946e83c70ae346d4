"""Twenty solids with costly fields, in four rows.

After figure 8 of Hadji-Kyriacou and Arandjelovic, "Raymarching Distance Fields with CUDA" (2021).
"""

import colorsys

import raymarch as rm

costly = [
    rm.menger(0.75),
    rm.gyroid(0.45, 0.06) & rm.sphere(0.45),
    rm.torus(0.32, 0.12).twist(3),
    rm.box((0.7, 0.7, 0.7)).displace_by_noise(0.05, 6),
    rm.helix(0.3, 0.08, 0.25, 3),
    rm.icosahedron(0.42) - rm.sphere(0.36),
    rm.schwarz_p(0.35, 0.05) & rm.box((0.75, 0.75, 0.75)),
    rm.octahedron(0.48).round(0.03).twist(1.5),
    rm.sierpinski(0.8),
    rm.link(0.25, 0.2, 0.08) | rm.link(0.25, 0.2, 0.08).rotate(1.57, "y"),
]


def at(k):
    """The k-th solid, at its place and with its colour."""
    skin = rm.Material(albedo=colorsys.hsv_to_rgb(k / 20, 0.5, 0.85), roughness=0.35)
    place = (1.2 * (k % 5 - 2), 0.5, 1.3 * (k // 5 - 1.5))
    return costly[k % 10].rotate(0.4 + k, "y").translate(place).material(skin)


scene = rm.Scene(
    rm.union(*(at(k) for k in range(20))) | rm.plane().material(rm.Material(albedo=(0.5, 0.5, 0.52), roughness=0.8)),
    camera=rm.Camera(position=(0, 4.6, 7.6), target=(0, 0.25, 0.15), fov=27),
    lights=[rm.Sun(sun_direction=(-0.6, 1.4, 0.8), shadow=True)],
    sky=rm.GradientSky(light=True),
    occlusion=rm.AmbientOcclusion(reach=0.3),
    fog=rm.Fog(density=0.01),
)
