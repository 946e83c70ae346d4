"""The Mandelbulb of power 8 (White and Nylander 2009), a distance estimate without a guarantee against missed hits.

The camera is so close that every ray hits. `--set horizon=1` moves it back and shows the floor up to the horizon.
"""

import raymarch as rm
from raymarch.expr.vocabulary import clamp, length, max, mix, vec3

horizon = rm.Param("horizon", 0.0, min=0.0, max=1.0)
haze = vec3(0.85, 0.9, 1.0)


def depths(p):
    """Albedo by depth: dark red inside the bulb, sand on its outside."""
    return mix(vec3(0.35, 0.04, 0.02), vec3(0.85, 0.6, 0.35), clamp((length(p) - 0.75) / 0.4, 0, 1))


bulb = rm.mandelbulb(power=8).rotate(0.5, "y").material(rm.Material(albedo=depths, roughness=0.6))
floor = rm.plane(offset=-1.2).material(rm.Material(albedo=(0.16, 0.17, 0.2), roughness=0.6))

scene = rm.Scene(
    bulb | floor,
    camera=rm.Camera(
        position=mix(vec3(0.7, 1.15, 1.25), vec3(2.0, 0.6, 3.6), horizon),
        target=mix(vec3(0, -0.05, 0), vec3(0, -0.15, 0), horizon),
        fov=45,
    ),
    lights=[rm.Sun(sun_direction=(1.5, 2, 0.4), color=(1, 0.95, 0.88), intensity=1.8, shadow=True)],
    sky=rm.Sky(lambda d: 0.6 * mix(haze, vec3(0.3, 0.5, 0.9), max(d.y, 0.0)), light=True),
    fog=rm.Fog(color=0.6 * haze, density=0.008),
)
