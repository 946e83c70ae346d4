"""A red ball melting into a blue cube: the smooth blend interpolates the materials with the weights of the surface.

After the figure on smoothing of Huang, Chen and Cheng, "Signed Distance Field in Real-time Rendering" (2020).
"""

import raymarch as rm

k = rm.Param("k", 0.6, min=0.01, max=1.2)

ball = rm.sphere(0.6).translate((0.1, 0.75, 0.1)).material(rm.Material(albedo=(0.85, 0.1, 0.08), roughness=0.3))
cube = rm.box((1.3, 1.0, 1.3)).round(0.03).material(rm.Material(albedo=(0.1, 0.25, 0.8), roughness=0.3))
floor = rm.plane(offset=-0.5).material(rm.Material(albedo=(0.55, 0.55, 0.5), roughness=0.8))

scene = rm.Scene(
    rm.union(ball, cube, k=k) | floor,
    camera=rm.Camera(position=(2.2, 1.9, 2.8), target=(0, 0.15, 0), fov=40),
    lights=[rm.Sun(sun_direction=(0.4, 1.2, 0.9), shadow=True, softness=0.06)],
    sky=rm.GradientSky(light=True),
    occlusion=rm.AmbientOcclusion(reach=0.4),
)
