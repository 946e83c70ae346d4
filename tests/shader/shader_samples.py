"""Scenes that between them call for every part of the shader."""

from __future__ import annotations

import raymarch as rm
from raymarch.scene.quality import NORMALS, TRACERS

RED, BLUE = rm.Material((1, 0, 0)), rm.Material((0, 0, 1), shininess=80)
GAP, TINT = rm.Param("gap", 1.0, 0.5, 2.0), rm.Param("tint", (0.2, 0.4, 0.6), 0, 1)


def solid() -> rm.Node:
    body = rm.union(rm.box().round(0.1), rm.torus().translate((0, 0.5, 0)), k=0.3).material(RED)
    return body - rm.cylinder(0.2, 3).rotate(0.5, "x").material(BLUE)


def scenes() -> dict[str, rm.Scene]:
    """By name. Built anew at each call."""
    made = {
        "plain": rm.Scene(rm.sphere()),
        "unlit": rm.Scene(rm.sphere(), lights=[]),
        "no end": rm.Scene(rm.plane((1, 2, 3)) | rm.sphere()),
        "half a box": rm.Scene(rm.plane() | rm.sphere()),
        "empty": rm.Scene(rm.sphere() & rm.sphere().translate((5, 0, 0))),
        "materials": rm.Scene(solid()),
        "shadows": rm.Scene(
            solid(), lights=[rm.Sun(shadow=True), rm.PointLight((0, 3, 0), shadow=True), rm.PointLight((3, 0, 0))]
        ),
        "everything": rm.Scene(
            rm.union(solid().translate((GAP, 0, 0)), rm.sphere(0.5).scale((1, 2, 3)).repeat((8, None, None), 3), k=0.2),
            camera=rm.Camera((GAP, 2, 9), (0, rm.time, 0), fov=40 + GAP),
            lights=[rm.Sun((rm.time, 1, 0), TINT, GAP, shadow=True), rm.PointLight((0, GAP, 3), shadow=True)],
            sky=TINT,
            fog=rm.Fog(TINT, 0.1 * GAP),
        ),
        "repeated": rm.Scene((solid() | rm.capsule()).repeat(5).mirror((1, 1, 0)).shell(0.05)),
    }
    turned = rm.box().rotate(0.3, "z").repeat((3, None, None), 2)  # asked at two places, so a function of its own
    made["copies beside a material"] = rm.Scene(turned | rm.plane().material(RED))
    made |= {f"{n} normals": rm.Scene(solid(), quality=rm.Quality(normals=n)) for n in NORMALS}
    made |= {f"{t} tracer": rm.Scene(solid(), quality=rm.Quality(tracer=t)) for t in TRACERS}
    return made


PASSES = (("color",), ("geometry",), ("color", "geometry"))
