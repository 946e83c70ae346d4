"""Glass, a mirror and a diffuse ball on a checkered floor under a gradient sky.

After the section on reflection and refraction of Huang, Chen and Cheng, "Signed Distance Field in Real-time Rendering"
(2020), with the exact Fresnel equations, total internal reflection and absorption; one random path per sample.
"""

import raymarch as rm

clear = rm.Material(transmission=1, ior=1.5)
green = rm.Material(transmission=1, ior=1.5, absorption=(1.6, 0.25, 0.9))
mirror = rm.Material(albedo=(0.95, 0.93, 0.9), metalness=1, roughness=0.05)
clay = rm.Material(albedo=(0.75, 0.25, 0.12), roughness=0.6)
tiles = rm.Material(albedo=rm.checker((0.75, 0.75, 0.72), (0.25, 0.27, 0.3), 0.7), roughness=0.35)

solids = [
    rm.sphere(0.6).translate((-0.5, 0.6, 0.6)).material(clear),
    rm.box((0.8, 1.0, 0.8)).round(0.05).rotate(0.5, "y").translate((0.85, 0.55, 0.5)).material(green),
    rm.sphere(0.75).translate((0.2, 0.75, -1.2)).material(mirror),
    rm.sphere(0.4).translate((-1.6, 0.4, -0.4)).material(clay),
]

scene = rm.Scene(
    rm.union(*solids) | rm.plane().material(tiles),
    camera=rm.Camera(position=(0.4, 1.9, 4.6), target=(-0.1, 0.45, 0), fov=38),
    lights=[rm.Sun(sun_direction=(-0.5, 1, 0.6), shadow=True)],
    sky=rm.GradientSky(),
    bounces=8,
    quality=rm.Quality(samples=64),
)
