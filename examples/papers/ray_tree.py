"""Glass and mirrors in one frame without noise: Whitted ray tracing of the reflected and the refracted ray.

After the section on reflection and refraction of Huang, Chen and Cheng, "Signed Distance Field in Real-time Rendering"
(2020): up to four bounces and thirty-one rays per pixel, fewer where the throughput is negligible.
"""

import raymarch as rm

clear = rm.Material(transmission=1, ior=1.5)
amber = rm.Material(transmission=1, ior=1.5, absorption=(0.15, 0.7, 2.4))
silver = rm.Material(albedo=(0.95, 0.94, 0.92), metalness=1, roughness=0)
copper = rm.Material(albedo=(0.95, 0.6, 0.45), metalness=1, roughness=0.05)
clay = rm.Material(albedo=(0.7, 0.2, 0.1), roughness=0.6)
stone = rm.Material(albedo=rm.checker((0.7, 0.68, 0.64), (0.16, 0.19, 0.24), 0.8), roughness=0.05)

solids = [
    rm.sphere(0.6).translate((-0.55, 0.6, 0.75)).material(clear),
    rm.box((0.9, 0.9, 0.9)).rotate(0.6, "y").translate((1.0, 0.45, 0.35)).material(amber),
    rm.sphere(0.85).translate((0.15, 0.85, -1.3)).material(silver),
    rm.torus(0.45, 0.16).rotate(1.2, "x").translate((-1.75, 0.55, -0.5)).material(copper),
    rm.sphere(0.3).translate((0.25, 0.3, 1.35)).material(clay),
]

scene = rm.Scene(
    rm.union(*solids) | rm.plane().material(stone),
    camera=rm.Camera(position=(0.2, 2.1, 4.8), target=(-0.15, 0.4, 0), fov=36),
    lights=[rm.Sun(sun_direction=(-0.5, 1, 0.6), shadow=True)],
    sky=rm.GradientSky(light=True),
    fog=rm.Fog(density=0.015),
    bounces=4,
    quality=rm.Quality(integrator="whitted", samples=4),
)
