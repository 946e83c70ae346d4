"""`raymarch render`: renders a scene to picture files."""

from __future__ import annotations

import shutil
import time as clock_time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from PIL import Image

from raymarch.cli.choice import choose_quality
from raymarch.cli.common import SIZE, CommandError, SceneFile, errors, parse_settings, parse_size, written
from raymarch.cli.progress import bar
from raymarch.cli.views import CHOICES, check_view, shown
from raymarch.errors import RenderError, RenderWarning
from raymarch.export import stills
from raymarch.export.film import FILMS, check_film, write_film
from raymarch.export.layers import write_layers, write_npz
from raymarch.gpu.renderer import Renderer
from raymarch.scene.file import load
from raymarch.scene.images import exr_package, write_exr
from raymarch.scene.quality import PRESETS

FORMATS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".webp": "WEBP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".bmp": "BMP",
}


def run(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Picture to write; the suffix selects the format.", show_default="SCENE.png"
        ),
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height in pixels.")] = SIZE,
    time: Annotated[float | None, typer.Option(help="Value of `time` in seconds.", show_default="0")] = None,
    frames: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Render frames A to B-1: to a film, or to names with a field such as {:04d}."),
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames per second, with --frames.")] = 30.0,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Value of a Param; may be repeated.")
    ] = None,
    view: Annotated[str, typer.Option(help=f"What to show: {', '.join(CHOICES)}.")] = "final",
    slice_: Annotated[
        str | None,
        typer.Option(
            "--slice", metavar="y=0", help="Plane of --view slice.", show_default="axis plane facing the camera"
        ),
    ] = None,
    quality: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"Quality preset for marching: {', '.join(PRESETS)}.")
    ] = None,
    error: Annotated[
        str | None, typer.Option(metavar="0.5px|flip:X", help="Use the fastest quality with at most this error.")
    ] = None,
    within: Annotated[
        str | None, typer.Option(metavar="16ms", help="Use the most accurate quality within this time.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="N", help="Rays per pixel, against aliasing and noise.")
    ] = None,
    alpha: Annotated[bool, typer.Option("--alpha", help="Make the sky transparent, in .png, .webp or .tif.")] = False,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="If a picture may be wrong, write no file and exit with code 2 and the reason."),
    ] = False,
    layers: Annotated[
        bool, typer.Option("--layers", help=".exr: also write depth, normals and the other arrays, as named layers.")
    ] = False,
    backend: Annotated[str, typer.Option(help="auto, egl, osmesa or window.")] = "auto",
    device: Annotated[
        int | None, typer.Option(help="Index of the EGL device; no other backend is tried.", show_default="0")
    ] = None,
) -> None:
    cut = check_view(view, slice_)
    width, height = parse_size(size)
    chooser = choose_quality(quality, error, within)
    found = load(scene)
    if samples is not None:  # before a quality is chosen by measurement
        found = found.replace(quality=found.quality.replace(samples=samples))
    params = parse_settings(set_ or [])
    target = output if output is not None else Path(scene.with_suffix(".png").name)
    if alpha:
        _check_alpha(target, view)
    instants = _instants(target, time, frames, fps, (width, height))
    suffix = target.suffix.lower()
    if layers and suffix != ".exr":
        raise CommandError(f"--layers with the output '{target}'", legal="a file ending in .exr")
    if (layers or suffix == ".npz") and view != "final":
        raise CommandError(f"--view {view} with all arrays", legal="no --view")
    sequence = frames is not None
    if target.suffix.lower() in FILMS:
        instants[0][1].parent.mkdir(exist_ok=True)
    with (
        Renderer((width, height), backend, device) as renderer,
        bar("drawing", len(instants)) as progress,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", RenderWarning)  # printed below, one on each line
        found = found.replace(quality=chooser(found, renderer, instants[0][0], params))
        for i, (instant, file) in enumerate(instants):
            start = clock_time.perf_counter()
            tell = partial(_later, progress, i)
            key = None
            if file.suffix.lower() == ".png":
                key = stills.key_of(renderer, found, instant, params, CHOICES[view], cut, f"{view} {alpha}")
                if sequence and stills.is_whole(file, key):
                    errors.print(f"{file}  is already drawn", markup=False)
                    continue
            frame = renderer.render(found, instant, params, CHOICES[view], tell, cut=cut)
            doubts = frame.doubts(steps=True) if view == "final" else list(frame.warnings)
            if strict and doubts:
                raise RenderError(doubts)
            view_result = shown(renderer, frame, view, found, params, tell)
            with written(file) as unfinished:
                if file.suffix.lower() == ".npz":
                    write_npz(unfinished, frame)
                elif layers:
                    write_layers(unfinished, frame)
                elif file.suffix.lower() == ".exr":
                    write_exr(unfinished, view_result.numbers())
                else:
                    picture = frame.image(alpha=True) if alpha else view_result.image()
                    picture.save(unfinished, FORMATS[file.suffix.lower()], **stills.with_key(key))
            spent = 1e3 * (clock_time.perf_counter() - start)
            errors.print(
                f"{file}  {width}x{height}  {frame.milliseconds:.1f} ms to draw ({renderer.clock.kind}), "
                f"{spent:.0f} ms in all, {renderer.context.backend}: {renderer.context.driver.renderer}",
                markup=False,
            )
            for doubt in doubts:
                errors.print(f"raymarch: {doubt}", markup=False)
            for line in view_result.lines:
                typer.echo(line)
    if target.suffix.lower() in FILMS:
        _join(target, [file for _, file in instants], fps)


def _join(target: Path, pictures: Sequence[Path], fps: float) -> None:
    """Write a film of pictures, and remove the pictures."""
    start = clock_time.perf_counter()
    with written(target) as unfinished:
        write_film(unfinished, target.suffix.lower(), map(Image.open, pictures), fps)
    shutil.rmtree(pictures[0].parent)
    spent = clock_time.perf_counter() - start
    errors.print(f"{target}  {len(pictures)} frames, {len(pictures) / fps:g} s, {spent:.1f} s to encode", markup=False)


def _check_alpha(target: Path, view: str) -> None:
    """Refuse --alpha for files that cannot hold it."""
    if view != "final":
        raise CommandError(f"--alpha with --view {view}", legal="the final picture")
    if target.suffix.lower() not in (".png", ".webp", ".tif", ".tiff"):
        raise CommandError(f"--alpha with the output '{target}'", legal="a file ending in .png, .webp, .tif or .tiff")


def _later(progress: Callable[[float], None], before: int, share: float) -> None:
    progress(before + share)


def _instants(
    target: Path, time: float | None, frames: str | None, fps: float, size: tuple[int, int]
) -> list[tuple[float, Path]]:
    """The times to render, each with its output file. The pictures of a film are in a folder beside it."""
    film = target.suffix.lower() in FILMS
    if not film and target.suffix.lower() not in (*FORMATS, ".exr", ".npz"):
        known = ", ".join((*FORMATS, ".exr", ".npz", *FILMS))
        raise CommandError(f"cannot write '{target}'", legal=f"a file ending in {known}")
    if target.suffix.lower() == ".exr":
        exr_package(target)
    if frames is None:
        if film:
            raise CommandError(f"a film '{target}' without --frames", legal="--frames A:B, such as 0:90")
        return [(0.0 if time is None else time, target)]
    if time is not None:
        raise CommandError("--time together with --frames", legal="one of them")
    first, colon, last = frames.partition(":")
    if not colon or not first.isdecimal() or not last.isdecimal() or int(first) >= int(last):
        raise CommandError(f"--frames {frames}", legal="A:B with 0 <= A < B, such as 0:90")
    if not 0 < fps < float("inf"):
        raise CommandError(f"--fps {fps}", legal="a number > 0")
    numbers = range(int(first), int(last))
    if film:
        check_film(target, size, fps)
        if not target.parent.is_dir():
            raise CommandError(f"cannot write '{target}': no such folder", legal="a writable folder")
        folder = target.with_name(f"{target.name}.frames")
        return [(i / fps, folder / f"frame_{i:06d}.png") for i in numbers]
    return [(i / fps, target.with_name(_numbered(target, i))) for i in numbers]


def _numbered(target: Path, number: int) -> str:
    """The file name of a frame: with a field of `str.format` or of `%`."""
    name = target.name
    with suppress(IndexError, KeyError, ValueError):
        name = target.name.format(number)
    if name == target.name:
        with suppress(TypeError, ValueError):
            name = target.name % number
    if name == target.name:
        raise CommandError(
            f"--frames with the output '{target}'",
            legal="a film (.mp4, .webm, .gif), or a field for the frame number: frame-{:04d}.png",
        )
    return name
