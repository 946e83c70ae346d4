"""`raymarch render`: renders a scene to picture files."""

from __future__ import annotations

import time as clock_time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from raymarch.cli.choice import choose_quality
from raymarch.cli.common import SIZE, CommandError, SceneFile, errors, parse_settings, parse_size, written
from raymarch.cli.views import CHOICES, check_view, shown
from raymarch.errors import RenderError, RenderWarning
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
        typer.Option(metavar="A:B", help="Render frames A to B-1; the output name needs a field such as {:04d}."),
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
    instants = _instants(target, time, frames, fps)
    if alpha:
        _check_alpha(target, view)
    with (
        Renderer((width, height), backend, device) as renderer,
        _progress(len(instants)) as progress,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", RenderWarning)  # printed below, one on each line
        found = found.replace(quality=chooser(found, renderer, instants[0][0], params))
        for i, (instant, file) in enumerate(instants):
            start = clock_time.perf_counter()
            tell = partial(_later, progress, i)
            frame = renderer.render(found, instant, params, CHOICES[view], tell, cut=cut)
            doubts = frame.doubts(steps=True) if view == "final" else list(frame.warnings)
            if strict and doubts:
                raise RenderError(doubts)
            view_result = shown(renderer, frame, view, found, params, tell)
            with written(file) as unfinished:
                if file.suffix.lower() == ".exr":
                    write_exr(unfinished, view_result.numbers())
                else:
                    picture = frame.image(alpha=True) if alpha else view_result.image()
                    picture.save(unfinished, FORMATS[file.suffix.lower()])
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


def _check_alpha(target: Path, view: str) -> None:
    """Refuse --alpha for files that cannot hold it."""
    if view != "final":
        raise CommandError(f"--alpha with --view {view}", legal="the final picture")
    if target.suffix.lower() not in (".png", ".webp", ".tif", ".tiff"):
        raise CommandError(f"--alpha with the output '{target}'", legal="a file ending in .png, .webp, .tif or .tiff")


def _later(progress: Callable[[float], None], before: int, share: float) -> None:
    progress(before + share)


def _instants(target: Path, time: float | None, frames: str | None, fps: float) -> list[tuple[float, Path]]:
    """The times to render, each with its output file."""
    if target.suffix.lower() not in (*FORMATS, ".exr"):
        raise CommandError(f"cannot write '{target}'", legal=f"a file ending in {', '.join((*FORMATS, '.exr'))}")
    if target.suffix.lower() == ".exr":
        exr_package(target)
    if frames is None:
        return [(0.0 if time is None else time, target)]
    if time is not None:
        raise CommandError("--time together with --frames", legal="one of them")
    first, colon, last = frames.partition(":")
    if not colon or not first.isdecimal() or not last.isdecimal() or int(first) >= int(last):
        raise CommandError(f"--frames {frames}", legal="A:B with 0 <= A < B, such as 0:90")
    if not 0 < fps < float("inf"):
        raise CommandError(f"--fps {fps}", legal="a number > 0")
    files = []
    for i in range(int(first), int(last)):
        try:
            name = target.name.format(i)
        except (IndexError, KeyError, ValueError):
            name = target.name
        if name == target.name:
            raise CommandError(
                f"--frames with the output '{target}'", legal="a field for the frame number: frame-{:04d}.png"
            )
        files.append((i / fps, target.with_name(name)))
    return files


@contextmanager
def _progress(frames: int) -> Iterator[Callable[[float], None]]:
    """A progress bar on the error stream, if that is a terminal; it appears after one second of drawing."""
    start = clock_time.perf_counter()
    with ExitStack() as stack:
        update: Callable[[float], None] | None = None

        def report(done: float) -> None:
            nonlocal update
            slow = clock_time.perf_counter() - start > 1.0 and done < frames
            if update is None and slow and errors.is_interactive:
                update = stack.enter_context(_bar(frames))
            if update is not None:
                update(done)

        yield report


@contextmanager
def _bar(frames: int) -> Iterator[Callable[[float], None]]:
    from rich.progress import Progress, TextColumn  # takes time, and most pictures are drawn before it is needed

    columns = (*Progress.get_default_columns()[:-1], TextColumn("{task.elapsed:.0f} s"))
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task("drawing", total=frames)
        yield lambda done: bar.update(task, completed=done)
