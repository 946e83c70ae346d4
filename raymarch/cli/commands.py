"""The commands.

Exit codes: 0 done, also if the reader of a pipe closes it early; 1 an internal error; 2 bad input, with one message
that names file and line; 130 Ctrl+C.
"""

from __future__ import annotations

import json as json_format
import sys
import time as clock_time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress, TextColumn

import raymarch
from raymarch import interrupt
from raymarch.cli.choice import choose_quality
from raymarch.cli.common import CommandError, Output, SceneFile, errors, parse_settings, parse_size, piped, written
from raymarch.cli.views import CHOICES, check_view, shown
from raymarch.errors import RaymarchError, RenderError, RenderWarning
from raymarch.gpu.doctor import examine
from raymarch.gpu.renderer import Renderer
from raymarch.plan import explain, plan
from raymarch.scene.file import load
from raymarch.scene.images import exr_package, write_exr
from raymarch.scene.quality import PRESETS
from raymarch.shader import assemble

app = typer.Typer(
    help="Signed-distance scenes in Python, compiled to one GLSL fragment shader.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
FORMATS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".webp": "WEBP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".bmp": "BMP",
}


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and exit. Typer reports wrong usage, also with code 2."""
    interrupt.watch_no_more()
    with piped():
        try:
            app(args=args, prog_name="raymarch")
        except RaymarchError as fault:
            errors.print(f"raymarch: {fault}", markup=False)
            sys.exit(2)
        except KeyboardInterrupt:
            sys.exit(interrupt.INTERRUPTED)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(raymarch.__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def render(
    scene: SceneFile,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Picture to write; the suffix selects the format. [SCENE.png]")
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height in pixels.")] = "640x360",
    time: Annotated[float | None, typer.Option(help="Value of `time` in seconds. [0]")] = None,
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
        str | None, typer.Option("--slice", metavar="y=0", help="Plane of --view slice. [axis plane facing the camera]")
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
    strict: Annotated[
        bool,
        typer.Option("--strict", help="If a picture may be wrong, write no file and exit with code 2 and the reason."),
    ] = False,
    backend: Annotated[str, typer.Option(help="auto, egl, osmesa or window.")] = "auto",
    device: Annotated[int | None, typer.Option(help="Index of the EGL device; no other backend is tried. [0]")] = None,
) -> None:
    """Render a scene to a picture file, without a screen."""
    cut = check_view(view, slice_)
    width, height = parse_size(size)
    chooser = choose_quality(quality, error, within)
    found = load(scene)
    if samples is not None:  # before a quality is chosen by measurement
        found = found.replace(quality=found.quality.replace(samples=samples))
    params = parse_settings(set_ or [])
    target = output if output is not None else Path(scene.with_suffix(".png").name)
    instants = _instants(target, time, frames, fps)
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
                    view_result.image().save(unfinished, FORMATS[file.suffix.lower()])
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
    """A progress bar on the error stream; it appears after one second of drawing."""
    bar = Progress(
        *Progress.get_default_columns()[:-1], TextColumn("{task.elapsed:.0f} s"), console=errors, transient=True
    )
    task = bar.add_task("drawing", total=frames)
    start = clock_time.perf_counter()
    shown = False

    def report(done: float) -> None:
        nonlocal shown
        bar.update(task, completed=done)
        if not shown and clock_time.perf_counter() - start > 1.0 and done < frames:
            bar.start()
            shown = True

    try:
        yield report
    finally:
        if shown:
            bar.stop()


@app.command(name="explain")
def explain_command(
    scene: SceneFile,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    glsl: Annotated[bool, typer.Option("--glsl", help="Print the GLSL of the fragment shader.")] = False,
) -> None:
    """Show the plan of a scene: facts, passes, modules and effects, each used or left out for a stated reason."""
    if json and glsl:
        raise CommandError("--json together with --glsl", legal="one of them; the JSON holds the GLSL as well")
    made = plan(load(scene))
    shader = assemble(made)
    if glsl:
        sys.stdout.write(shader.text())
    elif json:
        typer.echo(json_format.dumps({**explain.as_dict(made), "glsl": shader.text()}, indent=2))
    else:
        explain.show(made, len(shader.text().encode()), Output())


@app.command()
def doctor(json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    """Show which OpenGL backends work here, with driver, limits and clock, and the packages to install for the
    others."""
    reports = examine()
    if json:
        typer.echo(json_format.dumps([report.to_dict() for report in reports], indent=2))
    else:
        for report in reports:
            _show_report(report)
    if not any(report.works for report in reports):
        raise CommandError("no OpenGL context works here", legal="install one of the packages above")


def _show_report(report: Any) -> None:
    out = Output()
    out.print(f"[bold]{report.backend}[/bold]  {'works' if report.works else 'does not work'}")
    rows: list[tuple[str, Any]] = []
    if report.works:
        limits = report.limits
        rows = [
            ("driver", f"{report.driver.renderer}, {report.driver.vendor}"),
            ("version", report.driver.version),
            ("runs on", "the CPU" if report.driver.is_software else "the GPU"),
            ("largest picture", "{}x{}".format(*limits.picture)),
            ("texture size", limits.texture_size),
            ("uniform components", limits.fragment_uniform_components),
            ("loops", report.loops.words),
            ("clock", report.clock.verdict),
        ]
    else:
        rows = [("fault", report.error), ("cure", report.cure)]
    for name, value in rows:
        out.print(f"  {name:<20}{value}", markup=False)
    out.print()
