"""The scene that these tests measure."""

from __future__ import annotations

import raymarch as rm

SIZE = (64, 36)


def make_scene() -> rm.Scene:
    solid = (rm.box((1.5, 1, 1)).rotate(0.5) | rm.sphere(0.6).translate((0.9, 0.3, 0.4))) | rm.plane(offset=-0.6)
    return rm.Scene(solid, camera=rm.Camera(position=(1.5, 1.2, 4), target=(0, 0.5, 0)), lights=[rm.Sun(shadow=True)])
