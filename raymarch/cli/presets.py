"""The option --quality of the commands that draw, explain and export."""

from __future__ import annotations

from typing import Annotated

import typer

from raymarch.cli.common import CommandError, among
from raymarch.scene.quality import PRESETS
from raymarch.scene.scene import Scene

Preset = Annotated[
    str | None,
    typer.Option(
        "--quality",
        metavar="NAME",
        help=f"Quality preset for marching: {', '.join(PRESETS)}.",
        autocompletion=among(*PRESETS),
    ),
]


def check_preset(preset: str | None) -> None:
    """CommandError for a name that no preset has."""
    if preset is not None and preset not in PRESETS:
        raise CommandError(f"--quality {preset}", legal=", ".join(PRESETS))


def with_preset(scene: Scene, preset: str | None) -> Scene:
    """The scene with the quality of a preset; itself for None."""
    check_preset(preset)
    return scene if preset is None else scene.replace(quality=scene.quality.to_preset(preset))
