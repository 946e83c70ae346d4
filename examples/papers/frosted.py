"""Frosted glass after Walter et al. (2007): the same ball and pane with roughness increasing from left to right."""

import raymarch as rm

tiles = rm.Material(albedo=rm.checker((0.75, 0.7, 0.62), (0.13, 0.16, 0.2), 0.5), roughness=0.7)
copper = rm.Material(albedo=(0.95, 0.56, 0.4), metalness=1, roughness=0.25)

solids = [rm.plane(offset=-0.8).material(tiles)]
for i, roughness in enumerate((0.0, 0.2, 0.35, 0.55)):
    glass = rm.Material(transmission=1, ior=1.5, roughness=roughness, absorption=(0.25, 0.05, 0.08))
    x = 1.8 * (i - 1.5)
    solids += [
        rm.sphere(0.75).translate((x, -0.05, 0.9)).material(glass),
        rm.rounded_box((1.3, 1.9, 0.08), 0.03).translate((x, 0.2, -0.9)).material(glass),
        rm.torus(0.4, 0.12).rotate(1.2, "x").translate((x, 0.1, -1.7)).material(copper),
    ]

scene = rm.Scene(
    rm.union(*solids),
    camera=rm.Camera((0.0, 1.5, 6.5), (0, 0.05, 0), fov=42),
    lights=[rm.Sun((0.5, 1.0, 0.6), shadow=True)],
    sky=rm.GradientSky(),
    bounces=8,
    quality=rm.Quality(samples=8),
)
