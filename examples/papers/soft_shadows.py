"""Spheres and a box under a large light: shadows are sharp at the contact and wide farther away.

After figure 7 of Hadji-Kyriacou and Arandjelovic, "Raymarching Distance Fields with CUDA" (2021), with the two-sided
penumbra in place of the paper's, which is already dark where half of the light is visible.
"""

import raymarch as rm

softness = rm.Param("softness", 0.12, min=0.005, max=0.4)

pole = rm.rounded_cylinder(0.12, 2.4, 0.04).translate((-1.1, 1.2, 0))
solids = (
    pole | rm.sphere(0.7).translate((0.3, 0.9, 0)) | rm.box((0.8, 0.8, 0.8)).round(0.05).translate((1.7, 0.4, -0.3))
)
white = rm.Material(albedo=(0.8, 0.78, 0.74), roughness=0.7)

scene = rm.Scene(
    (solids | rm.plane()).material(white),
    camera=rm.Camera(position=(0.5, 4, 5.4), target=(0.2, 0.5, 0), fov=40),
    lights=[
        rm.Sun(sun_direction=(1.2, 1.6, 0.9), color=(1, 0.95, 0.88), intensity=0.9, shadow=True, softness=softness)
    ],
    sky=rm.Sky((0.12, 0.15, 0.2), light=True),
    occlusion=rm.AmbientOcclusion(reach=0.5),
    fog=rm.Fog((0.4, 0.42, 0.45), 0.02),
)
