"""Pictures of a sequence: each PNG file holds a key of all that it shows, so a rerun draws only what is missing."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, PngImagePlugin, UnidentifiedImageError

import raymarch
from raymarch.gpu.prepare import frame_uniforms
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.slices import Slice
from raymarch.plan import lights
from raymarch.scene.parameter import ParamValue, set_values
from raymarch.scene.scene import Scene

ENTRY = "raymarch"
"""The name of the text in a PNG file that holds the key."""


def key_of(
    renderer: Renderer,
    scene: Scene,
    time: float,
    params: Mapping[str, ParamValue],
    outputs: Sequence[str],
    cut: Slice | None,
    view: str,
) -> str | None:
    """The key of a picture: a hash of the shader, all values, the size and the driver.

    None if the picture also depends on earlier frames.
    """
    if scene.quality.temporal != "off":
        return None
    ready = renderer.prepared(scene, outputs)
    values = set_values(ready.plan.parameters, params, time, scene.where)
    uniforms = frame_uniforms(ready, values, renderer.size, None, cut)
    if ready.plan.lights_as_data:
        uniforms["u_lights"] = lights.rows(ready.plan.scene, values)
    made = hashlib.sha256()
    driver = renderer.context.driver
    for part in (raymarch.__version__, driver.renderer, driver.version, view, scene.quality, scene.tone, renderer.size):
        made.update(repr(part).encode() + b"\0")
    for name, text in sorted(ready.texts.items()):  # textures are named by their content
        made.update(f"{name}\0{text}\0".encode())
    for name, value in sorted(uniforms.items()):
        made.update(name.encode() + b"\0" + np.asarray(getattr(value, "values", value), np.float64).tobytes())
    return made.hexdigest()


def is_whole(file: Path, key: str | None) -> bool:
    """True if a file holds the picture with this key, and all of it."""
    if key is None:
        return False
    try:
        with Image.open(file) as found:
            found.load()
            return getattr(found, "text", {}).get(ENTRY) == key
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError):
        return False


def with_key(key: str | None) -> dict[str, Any]:
    """Arguments of `Image.save` that write the key into a PNG file."""
    if key is None:
        return {}
    entries = PngImagePlugin.PngInfo()
    entries.add_text(ENTRY, key)
    return {"pnginfo": entries}
