"""The scene as the window draws it: one sample a frame, gathered while nothing moves."""

from __future__ import annotations

from raymarch.scene.scene import Scene


def live(scene: Scene) -> Scene:
    """A scene that looks the same in its first frame, and from which a still window goes on to a smooth picture.

    One plan and one program serve moving and still pictures.
    """
    quality = scene.quality
    temporal = "accumulate" if quality.temporal == "off" else quality.temporal
    if quality.samples == 1 and temporal == quality.temporal:
        return scene
    return scene.replace(quality=quality.replace(samples=1, temporal=temporal))
