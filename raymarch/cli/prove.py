"""`raymarch prove`: proves the hits of a picture."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import Annotated, Literal

import typer

from raymarch.cli.common import (
    CommandError,
    OptionalTime,
    Output,
    SceneFile,
    Settings,
    parse_settings,
    parse_size,
)
from raymarch.cli.presets import Preset, with_preset
from raymarch.cli.progress import bar
from raymarch.files import check_apart, recorded, write
from raymarch.proof import prove
from raymarch.proof.search import CONTRADICTED, OPEN
from raymarch.scene.file import load

SIZE = "320x180"
"""Default size of the picture."""


def run(
    scene: SceneFile,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height in pixels.")] = SIZE,
    tolerance: Annotated[
        str, typer.Option(metavar="0.05px", help="Tolerance: a share of a pixel, or a length.")
    ] = "0.05px",
    time: OptionalTime = None,
    set_: Settings = None,
    quality: Preset = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.png", help="Write the verdict of each pixel.")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")] = None,
    whole: Annotated[bool, typer.Option("--whole", help="Also bound how much of each pixel is covered.")] = False,
    shadows: Annotated[bool, typer.Option("--shadows", help="Also prove the hard shadow of each light.")] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Exit with 2 if a pixel or a shadow is contradicted or open, or a fact is wrong."
        ),
    ] = False,
) -> None:
    for option, file, suffix in (("--output", output, ".png"), ("--json", json, ".json")):
        if file is not None and file.suffix.lower() != suffix:
            raise CommandError(f"{option} {file}", legal=f"a file that ends in {suffix}")
    params, shape = parse_settings(set_ or []), parse_size(size)
    pixels: Literal["center", "whole"] = "whole" if whole else "center"
    with bar("proof", 1.0) as progress:
        with recorded() as read:
            made = with_preset(load(scene), quality)
        check_apart(read, (output, json), CommandError)
        found = prove(
            made,
            size=shape,
            tolerance=tolerance,
            time=time,
            params=params,
            shadows=shadows,
            pixels=pixels,
            progress=progress,
        )
    if output is not None:
        write(output, lambda partial: found.image().save(partial, "PNG"))
    if json is not None:
        write(json, lambda partial: partial.write_text(json_format.dumps(found.as_dict(), indent=2) + "\n"))
    out = Output()
    out.print(str(found), markup=False)
    if shadows and not found.shadows:
        out.print("  no light has a hard shadow")
    for reason, count in found.reasons.items():
        out.print(f"  {count:,} open: {reason}", markup=False)
    for what in found.as_dict()["contradictions"][:10]:
        out.print(f"  contradicted: {_shown(what)}", markup=False)
    for fact in found.wrong_facts:
        out.print(f"  {fact}", markup=False)
    unproved = any(each.count(CONTRADICTED) + each.count(OPEN) for each in found.shadows)
    if strict and (found.share < 1.0 or found.wrong_facts or unproved):
        raise typer.Exit(2)


def _shown(what: dict[str, float | None]) -> str:
    """A contradicted pixel in words."""
    place = f"row {what['row']}, column {what['column']}"
    hit = "no hit" if what["hit"] is None else f"a hit at {what['hit']:.6g}"
    surface = what["surface_before"]
    if surface is None:
        return f"{place}: {hit}, but the ray is free to {what['free_to']:.6g}"
    return f"{place}: {hit}, but a surface lies before {surface:.6g}"
