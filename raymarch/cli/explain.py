"""`raymarch explain`: shows the plan of a scene."""

from __future__ import annotations

import json as json_format
import sys
from typing import Annotated

import typer

from raymarch.cli.common import SIZE, CommandError, Output, SceneFile, output_to_errors, parse_size
from raymarch.plan import explain, plan
from raymarch.scene.file import load
from raymarch.shader import assemble


def run(
    scene: SceneFile,
    size: Annotated[
        str, typer.Option(metavar="WxH", help="Width and height of the picture, which the plan depends on.")
    ] = SIZE,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    glsl: Annotated[bool, typer.Option("--glsl", help="Print the GLSL of the fragment shader.")] = False,
) -> None:
    pixels = parse_size(size)
    if json and glsl:
        raise CommandError("--json together with --glsl", legal="one of them; the JSON holds the GLSL as well")
    with output_to_errors():  # for what the scene prints
        made = plan(load(scene), size=pixels)
    shader = assemble(made)
    if glsl:
        sys.stdout.write(shader.text())
    elif json:
        typer.echo(json_format.dumps({**explain.as_dict(made, shader.modules), "glsl": shader.text()}, indent=2))
    else:
        explain.show(made, shader.modules, len(shader.text().encode()), Output())
