"""The pictures of a job, drawn on this machine."""

from __future__ import annotations

import time as clock_time
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import typer

from raymarch.cli.common import CommandError, errors
from raymarch.cli.job import Job
from raymarch.cli.progress import bar
from raymarch.cli.report import Report
from raymarch.cli.views import shown
from raymarch.errors import RenderError, RenderWarning
from raymarch.export import behind
from raymarch.export.sequence import Contents, Item, Parts, Picture, Runner, join_film, join_tiles
from raymarch.export.stills import key_of
from raymarch.files import write
from raymarch.gpu.renderer import Renderer

QUICK = 100.0
"""Milliseconds of a frame of a film below which the next one is drawn at once, and its parts are not reported."""


def draw_here(job: Job, report: Report) -> None:
    """Draw the pictures, write their files, and tell of each on stderr. A film and a picture of tiles are joined."""
    whole, joined = job, job.film or job.large
    if job.large:
        job = job.tiled()
    folder = job.items[0].file.parent
    with Parts(job.items, job.target, CommandError) if joined else nullcontext() as parts:
        with (
            Renderer(job.items[0].size, job.backend, job.device) as renderer,
            bar("drawing", len(job.items)) as progress,
            warnings.catch_warnings(),
            behind.film(job.target, folder, job.fps, CommandError) if job.film else nullcontext() as add,
            behind.in_order() as later,
        ):
            warnings.simplefilter("ignore", RenderWarning)  # printed below, one on each line
            scene = job.scene.replace(quality=job.choose(job.scene, renderer, job.items[0].time, job.shot.params))
            reuse = job.sequence or job.large
            runner = Runner(renderer, scene, job.shot, parts, shown, reuse, report.asked)
            report.by(renderer)
            quick = False
            for i, item in enumerate(job.items):
                start = clock_time.perf_counter()
                progress(i)
                tell = partial(lambda before, share: progress(before + share), i)
                item, made = _drawn(job, runner, item, i, None if quick else tell)
                report.drawn(item, made, clock_time.perf_counter() - start)
                if made is None:
                    if not job.large:
                        later(partial(errors.print, f"{item.file}  is already drawn"))
                else:
                    end = partial(progress, i + 1) if job.large else partial(_report, item, made, renderer, start)
                    later(partial(_save, item.file, made.writer, end, report), made.writer.before)
                if add is not None:
                    add(item.file if made is None else made.view.image())
                quick = job.sequence and made is not None and made.milliseconds < QUICK
                del made  # the next frame then reads no arrays of this one
            drawn_at, key = clock_time.perf_counter(), None
            if job.large:
                key = key_of(Contents(scene, whole.shot).of(whole.items[0]), renderer.context.driver)
        if job.film and parts is not None:
            _report_joined(job.target, _length(len(job.items), job.fps), drawn_at, parts)
        elif parts is not None:
            join(job, parts.all(job.items), key, parts)
        if joined:
            report.files.append(job.target)


def join(job: Job, items: Sequence[Item], key: str | None, parts: Parts) -> None:
    """Write a film of its frames, or a picture of its tiles, and remove them. key : of the picture."""
    start = clock_time.perf_counter()
    if job.film:
        join_film(job.target, items, job.fps, CommandError)
        what = _length(len(items), job.fps)
    else:
        join_tiles(job.target, items, key, CommandError)
        width, height = job.size
        what = f"{width}x{height}, {len(items)} tiles"
    _report_joined(job.target, what, start, parts)


def _length(count: int, fps: float) -> str:
    return f"{count} frames, {count / fps:g} s"


def _drawn(
    job: Job, runner: Runner, item: Item, number: int, tell: Callable[[float], None] | None
) -> tuple[Item, Picture | None]:
    """`Runner.picture`; an error of --strict names the frame."""
    try:
        return runner.picture(item, job.at(number), tell)
    except RenderError as fault:
        if not job.sequence:
            raise
        raise CommandError(f"{item.name}, at time {item.time:g}: {fault}") from None


def _save(file: Path, writer: Callable[[Path], None], tell_end: Callable[[], None], report: Report) -> None:
    write(file, writer, CommandError)
    report.files.append(file)
    tell_end()


def _report(item: Item, made: Picture, renderer: Renderer, start: float) -> None:
    spent, (width, height) = 1e3 * (clock_time.perf_counter() - start), item.size
    errors.print(
        f"{item.file}  {width}x{height}  {made.milliseconds:.1f} ms to draw ({renderer.clock.kind}), "
        f"{spent:.0f} ms in all, {renderer.context.backend}: {renderer.context.driver.renderer}"
    )
    errors.say(*made.doubts)
    for line in made.view.lines:
        typer.echo(line)


def _report_joined(target: Path, what: str, start: float, parts: Parts) -> None:
    errors.print(f"{target}  {what}, {clock_time.perf_counter() - start:.1f} s to encode")
    if note := parts.finish():
        errors.say(note)
