"""Four plates of rising roughness mirror four lamps of rising size, after Veach and Guibas (1995).

Points of a lamp are the better samples for small lamps and rough plates, directions of the reflection for large lamps
and smooth plates. Each highlight is the sum of both, weighted by their densities.
"""

import math

import raymarch as rm

eye, lamps_at = (0.0, 2.8, 8.0), (2.75, -1.7)  # height and depth of the lamps
plates, lamps, lights = [], [], []
for k, roughness in enumerate((0.1, 0.15, 0.23, 0.36)):
    y, z = (1.3, 0.75, 0.3, -0.05)[k], -0.5 + 0.95 * k
    to_lamps = math.atan2(lamps_at[0] - y, lamps_at[1] - z)
    to_eye = math.atan2(eye[1] - y, eye[2] - z)
    steel = rm.Material(albedo=(0.82, 0.84, 0.88), metalness=1, roughness=roughness)
    plate = rm.box((6.6, 0.05, 0.8)).round(0.02).material(steel)
    plates.append(plate.rotate(math.pi / 2 - (to_lamps + to_eye) / 2, "x").translate((0, y, z)))
for x, radius, color in (
    (-2.7, 0.04, (1.0, 0.45, 0.25)),
    (-1.2, 0.12, (1.0, 0.8, 0.4)),
    (0.4, 0.32, (0.45, 0.9, 0.6)),
    (2.3, 0.75, (0.4, 0.6, 1.0)),
):
    at = (x, *lamps_at)
    lights.append(rm.SphereLight(at, radius, color, 0.9, shadow=True, penumbra="sampled"))
    glow = rm.Material(emission=tuple(0.9 * c / radius**2 for c in color))
    lamps.append(rm.sphere(radius).material(glow).translate(at).visible(shadow=False))
floor = rm.plane(offset=-0.5).material(rm.Material(albedo=(0.5, 0.5, 0.5), roughness=0.9))

scene = rm.Scene(
    rm.union(*plates, *lamps, floor),
    camera=rm.Camera(eye, (0, 1.05, 0), fov=36),
    lights=lights,
    sky=(0, 0, 0),
    tone=rm.ToneMapping("agx"),
    quality=rm.Quality(samples=16),
)
