"""`raymarch export`: writes a scene to a file for other programs."""

from __future__ import annotations

import time as clock_time
from pathlib import Path
from typing import Annotated

import typer

from raymarch.cli.common import CommandError, SceneFile, Settings, errors, parse_settings
from raymarch.cli.presets import Preset, with_preset
from raymarch.cli.progress import bar
from raymarch.export.forms import CELLS, GLSL, SUFFIXES, TEXTURES, export
from raymarch.files import check_apart, folders_of, recorded
from raymarch.scene.file import load


def run(
    scene: SceneFile,
    output: Annotated[
        Path, typer.Option("-o", "--output", help=f"File to write; the suffix selects the form: {' '.join(SUFFIXES)}.")
    ],
    time: Annotated[float, typer.Option(help="Value of `time` in seconds.")] = 0.0,
    set_: Settings = None,
    quality: Preset = None,
    shadertoy: Annotated[bool, typer.Option("--shadertoy", help=".glsl: write a shader for Shadertoy.")] = False,
    cells: Annotated[
        int | None,
        typer.Option(metavar="N", help="Meshes: cells along the longest edge of the box.", show_default=str(CELLS)),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(metavar="LENGTH", help="Meshes: as many cells as keep the mesh so near to the surface."),
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z:X,Y,Z", help="Meshes: clip the solid to this box.", show_default="bounds of the solid"
        ),
    ] = None,
) -> None:
    start, began = clock_time.perf_counter(), clock_time.time()
    with recorded() as read:
        loaded = load(scene)
    found, params, corners = with_preset(loaded, quality), parse_settings(set_ or []), parse_box(box)
    check_apart(read, (output, output.with_suffix(TEXTURES)), CommandError)
    with folders_of(output, CommandError), bar("exporting", 1.0) as progress:
        made = export(
            found,
            output,
            time=time,
            params=params,
            shadertoy=shadertoy,
            cells=cells,
            tolerance=tolerance,
            box=corners,
            progress=progress,
        )
    spent = clock_time.perf_counter() - start
    errors.print(f"{output}  {output.stat().st_size / 1e3:,.0f} kB  {spent:.1f} s")
    if made is not None:
        errors.print(
            f"{len(made.faces):,} triangles, off the surface by up to {made.deviation:.2g}; "
            f"volume {made.volume:.6g}, area {made.area:.6g}"
        )
    beside = output.with_suffix(TEXTURES)
    if output.suffix.lower() in GLSL and beside.exists() and beside.stat().st_mtime >= began:
        errors.print(f"{beside}  {beside.stat().st_size / 1e3:,.0f} kB  its textures")


Corner = tuple[float, float, float]


def parse_box(text: str | None) -> tuple[Corner, Corner] | None:
    """Parse two corners, X,Y,Z:X,Y,Z."""
    if text is None:
        return None
    try:
        (a, b, c), (d, e, f) = ([float(part) for part in corner.split(",")] for corner in text.split(":"))
    except ValueError:
        raise CommandError(f"--box {text}", legal="two corners, X,Y,Z:X,Y,Z, such as -1,-1,-1:1,1,1") from None
    return (a, b, c), (d, e, f)
