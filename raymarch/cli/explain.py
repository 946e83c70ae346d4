"""`raymarch explain`: shows the plan of a scene."""

from __future__ import annotations

import json as json_format
import sys
from contextlib import suppress
from typing import Annotated

import numpy as np
import typer

from raymarch.cli.common import (
    SIZE,
    CommandError,
    NoMeasured,
    OptionalTime,
    Output,
    SceneFile,
    Settings,
    output_to_errors,
    parse_settings,
    parse_size,
)
from raymarch.cli.presets import Preset, with_preset
from raymarch.errors import DeviceError
from raymarch.gpu.context import open_context
from raymarch.gpu.measured_prices import are_kept
from raymarch.plan import explain, plan
from raymarch.plan.device import DeviceClass, of_name
from raymarch.scene.file import load
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.shader import assemble


def run(
    scene: SceneFile,
    size: Annotated[
        str, typer.Option(metavar="WxH", help="Width and height of the picture, which the plan depends on.")
    ] = SIZE,
    time: OptionalTime = None,
    set_: Settings = None,
    quality: Preset = None,
    device: Annotated[
        str | None, typer.Option("--device-class", metavar="NAME", help="Plan for software (default) or hardware.")
    ] = None,
    no_measured: NoMeasured = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    glsl: Annotated[bool, typer.Option("--glsl", help="Print the GLSL of the fragment shader.")] = False,
) -> None:
    pixels = parse_size(size)
    if json and glsl:
        raise CommandError("--json together with --glsl", legal="one of them; the JSON holds the GLSL as well")
    with output_to_errors():  # for what the scene prints
        found = with_preset(load(scene), quality)
        made = plan(found, size=pixels, device=_planned_for(device))
    values = set_values(found.parameters, parse_settings(set_ or []), time or 0.0, found.where)
    frame = _frame(found, values, pixels[0] / pixels[1])
    shader = assemble(made)
    if glsl:
        sys.stdout.write(shader.text())
    elif json:
        typer.echo(
            json_format.dumps(
                {**explain.as_dict(made, shader.modules), "frame": frame, "glsl": shader.text()}, indent=2
            )
        )
    else:
        out = Output()
        explain.show(made, shader.modules, len(shader.text().encode()), out)
        out.print("\n[bold]Frame (the plan is the same for all values of parameters and time)[/bold]")
        for name, value in frame.items():
            out.print(f"  {name:<{explain.WIDTH}}  {_shown(value)}", markup=False)


def _planned_for(name: str | None) -> DeviceClass | None:
    """The class of a name, or the driver of this machine if its prices were measured; None for the usual class."""
    if name or not are_kept():
        return of_name(name) if name else None
    with suppress(DeviceError), open_context() as context:
        found = context.driver.device_class
        return found if found.measured else None
    return None


def _frame(scene: Scene, values: Values, aspect: float) -> dict[str, float | list[float]]:
    """What a frame depends on beside the plan: time, parameters, the camera, and where its rays end."""
    pose = scene.pose(values, aspect)
    given = {name: np.asarray(value, np.float64).tolist() for name, value in values.params.items()}
    place = {"camera position": pose.position.tolist(), "camera direction": pose.view.tolist()}
    return {"time": values.time, **given, **place, "rays end at": scene.far(pose, values)}


def _shown(value: float | list[float]) -> str:
    return ", ".join(f"{v:.4g}" for v in value) if isinstance(value, list) else f"{value:.4g}"
