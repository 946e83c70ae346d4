"""A scene as one HTML page that draws it by WebGL 2, without a network."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Iterator, Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from raymarch.export.inputs import Text, alone, is_own, light_rows, sky_light
from raymarch.expr.function import Function
from raymarch.expr.glsl import TIME, print_functions
from raymarch.expr.samples import Samples
from raymarch.expr.srgb import srgb_glsl
from raymarch.expr.tables import Table
from raymarch.expr.texels import Texels
from raymarch.files import valid
from raymarch.gpu.display import HIGH, HIT, LOW, VALUE, VECTOR
from raymarch.gpu.views import ALL
from raymarch.plan import Plan, plan
from raymarch.plan.lights import padded
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.shader import Shader, assemble


def text_of(scene: Scene, values: Values, still: bytes = b"") -> Text:
    """The page. Raises PlanError for many lights or a sky light that change.

    still : a picture of the scene as JPEG, for browsers without WebGL 2.
    """
    made = plan(alone(scene), ("samples", "geometry"), standalone=True)
    shader = assemble(made)
    lines = {name: f"{kind.partition('[')[0]} {name};" for name, kind in shader.uniforms.items() if is_own(name)}
    lines.pop("u_sample", None)  # the page sets it
    lines |= sky_light(made)
    pose = scene.pose(values)
    views, maps = _views()
    text = _short(shader.text("samples", "300 es", lines))
    data = {
        "shader": _text(text),
        "previewed": len(text) > PREVIEWED,
        "display": _text(
            _file("page.glsl").replace("TONED", f"{srgb_glsl()}\n{scene.tone.glsl()}").replace("VIEWS", views)
        ),
        "params": _params(made, shader, values),
        "time": values.time if TIME in shader.uniforms else None,
        "elevation": _elevation(scene, values),
        "tan_half_fov": pose.tan_half_fov if pose.half_height is None else pose.half_height / _distance(scene, values),
        "textures": list(_textures(made, shader, values)),
        "maps": [_numbers(name, table) for name, table in maps.items()],
        "source": _source(scene),
    }
    file = Path(scene.where.file) if scene.where else None
    name = valid(file.stem) if file and file.exists() else "raymarch"  # a notebook's cell is no file
    content = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    page, _, end = _file("page.html").partition("DATA")
    data_text = content.replace("<", "\\u003c")  # no markup can end the script early
    picture = f"data:image/jpeg;base64,{base64.b64encode(still).decode()}" if still else "#"
    return Text(page.replace("TITLE", escape(name)).replace("STILL", picture, 1) + data_text + end)


def _file(name: str) -> str:
    return files("raymarch.export").joinpath(name).read_text(encoding="utf-8")


def _short(text: str) -> str:
    """The text without indents, empty lines and lines of comments."""
    lines = map(str.strip, text.split("\n"))
    return "\n".join(line for line in lines if line and not line.startswith("//")) + "\n"


LONG = 2_000
"""Length of a text in bytes above which a page holds it compressed."""

PREVIEWED = 24_000
"""Length of a shader in bytes above which a page shows shapes while it is compiled."""


def _text(text: str) -> str | dict[str, str]:
    """The text, or its compressed bytes if it is long."""
    content = text.encode()
    return text if len(content) < LONG else {"bytes": base64.b64encode(zlib.compress(content, 9)).decode("ascii")}


def _params(made: Plan, shader: Shader, values: Values) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "uniform": shader.parameters[name],
            "value": values.params[name],
            "min": spec.min,
            "max": spec.max,
        }
        for name, spec in made.parameters.items()
        if shader.parameters.get(name) in shader.uniforms
    ]


def _distance(scene: Scene, values: Values) -> float:
    return float(np.linalg.norm(scene.pose(values).position - scene.target(values)))


def _elevation(scene: Scene, values: Values) -> float:
    """The angle of the camera above the horizon of its target, in radians."""
    pose = scene.pose(values)
    up = values.of(scene.camera.up)
    away = pose.frame[:, 2]
    return math.asin(float(np.clip(away @ up / np.linalg.norm(up), -1.0, 1.0)))


def _source(scene: Scene) -> str:
    """The text of the user's file; "" if it cannot be read."""
    try:
        return Path(scene.where.file).read_text(encoding="utf-8") if scene.where else ""
    except (OSError, UnicodeDecodeError):
        return ""


def _textures(made: Plan, shader: Shader, values: Values) -> Iterator[dict[str, Any]]:
    for name, data in shader.samples.items():
        if isinstance(data, Texels):  # WebGL computes the sizes of the levels
            content = b"".join(level.tobytes() for level in data.levels)
            yield _texture(name, content, data.size, data.channels, len(data.levels), data.wrap == "repeat", "half")
        else:
            yield _numbers(name, data)
    if made.lights_as_data:
        rows = padded(light_rows(made, values))
        yield _texture("u_lights", rows.tobytes(), rows.shape[1::-1], rows.shape[2])


def _numbers(name: str, data: Samples | Table) -> dict[str, Any]:
    size, channels, content = data.texture()
    return _texture(name, content, size, channels)


def _texture(
    name: str,
    content: bytes,
    size: tuple[int, ...],
    channels: int,
    levels: int = 1,
    repeat: bool = False,
    type: str = "float",
) -> dict[str, Any]:
    packed = base64.b64encode(zlib.compress(content, 9)).decode("ascii")
    found = {"name": name, "bytes": packed, "size": list(size), "channels": channels}
    return {**found, "levels": levels, "repeat": repeat, "type": type}


def _views() -> tuple[str, Mapping[str, Any]]:
    """The functions that colour views, as GLSL text, and their tables: the same as on the desktop."""
    shown = {"depth": VALUE, "evaluations": VALUE, "normal": VECTOR}
    roots = []
    for name, value in shown.items():
        color = ALL[name].color
        assert color is not None
        roots.append(Function(f"{name}_color", (value, HIT, LOW, HIGH), color))
    printed = print_functions(roots)
    samplers = [f"uniform sampler2D {name};" for name in printed.samples]
    return "\n".join([*samplers, *(line.text for line in printed.lines())]), printed.samples
