"""A Mandelbulb of power 4.

After figure 5 of Hadji-Kyriacou and Arandjelovic, "Raymarching Distance Fields with CUDA" (2021).
"""

import raymarch as rm

bronze = rm.Material(albedo=(0.72, 0.5, 0.3), metalness=0.6, roughness=0.45)
bulb = rm.mandelbulb(power=4).rotate(0.5, "y").rotate(0.35, "x").material(bronze)

scene = rm.Scene(
    bulb,
    camera=rm.Camera(position=(0, 0.5, 2.9), target=(0, 0, 0), fov=45),
    lights=[rm.Sun(sun_direction=(1, 1.2, 0.8), color=(1, 0.95, 0.85), intensity=2, shadow=True)],
    sky=rm.GradientSky(light=True),
    occlusion=rm.AmbientOcclusion(steps=6, reach=0.3),
)
