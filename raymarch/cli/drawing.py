"""The pictures of a job, drawn on this machine."""

from __future__ import annotations

import time as clock_time
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import cache, partial
from pathlib import Path
from typing import Any

import typer

from raymarch.cli.common import CommandError, errors
from raymarch.cli.job import Job
from raymarch.cli.progress import bar
from raymarch.cli.views import shown
from raymarch.errors import RenderWarning
from raymarch.export import behind
from raymarch.export.sequence import Contents, Item, Parts, join_film, join_tiles
from raymarch.export.stills import draw, encoder, is_whole, key_of
from raymarch.files import write
from raymarch.gpu.renderer import Renderer


def draw_here(job: Job) -> None:
    """Draw the pictures, write their files, and report each on stderr. A film and a picture of tiles are joined."""
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
            drawing = _Drawing(job, renderer, progress, parts, add, later)
            for i, item in enumerate(job.items):
                drawing.draw(i, item)
            drawn_at, key = clock_time.perf_counter(), None
            if job.large:
                key = key_of(Contents(drawing.scene, whole.shot).of(whole.items[0]), renderer.context.driver)
        if job.film and parts is not None:
            _report_joined(job.target, _length(len(job.items), job.fps), drawn_at, parts)
        elif parts is not None:
            join(job, parts.all(job.items), key, parts)


class _Drawing:
    """Draws one item after another, while others write what was drawn.

    progress : is told the number of items that are done. parts : the folder of a film or of tiles. add : adds a
    picture to a film. later : runs a job in a thread, in order.
    """

    def __init__(
        self,
        job: Job,
        renderer: Renderer,
        progress: Callable[[float], None],
        parts: Parts | None,
        add: Callable[[Any], None] | None,
        later: behind.Later,
    ) -> None:
        self.job, self.renderer, self.progress = job, renderer, progress
        self.parts, self.add, self.later = parts, add, later
        first = job.items[0]
        self.scene = job.scene.replace(quality=job.choose(job.scene, renderer, first.time, job.shot.params))
        self.contents = Contents(self.scene, job.shot, renderer)

    def draw(self, index: int, item: Item) -> None:
        start, renderer, shot = clock_time.perf_counter(), self.renderer, self.job.at(index)
        if renderer.size != item.size:
            renderer.resize(item.size)
        key = None
        if shot.suffix == ".png":
            content = self.contents.of(item, shot.params)
            key = key_of(content, renderer.context.driver)
            item = item if self.parts is None else self.parts.placed(item, content)
            if self._is_drawn(item, key):
                return
        tell = partial(lambda before, share: self.progress(before + share), index)
        frame, doubts = draw(renderer, self.scene, shot, item.time, item.part, tell)
        result = shown(renderer, frame, shot.view, self.scene, shot.params, tell)
        image = cache(result.image)
        writer = encoder(shot, frame, image, result.numbers, key, draft=self.parts is not None)
        if self.add is not None:
            self.add(image())
        tell_end: Callable[[], None] = partial(self.progress, index + 1)
        if not self.job.large:
            width, height = item.size
            by = f"{renderer.context.backend}: {renderer.context.driver.renderer}"
            words = f"{width}x{height}  {frame.milliseconds:.1f} ms to draw ({renderer.clock.kind})"
            tell_end = partial(_report, item.file, words, start, by, doubts, result.lines)
        self.later(partial(_save, item.file, writer, tell_end), writer.before)

    def _is_drawn(self, item: Item, key: str | None) -> bool:
        """True for a frame or a tile of an earlier command, which is kept."""
        if not (self.job.sequence or self.job.large) or key is None or not is_whole(item.file, [key]):
            return False
        if not self.job.large:
            self.later(partial(errors.print, f"{item.file}  is already drawn"))
        if self.add is not None:
            self.add(item.file)
        return True


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


def _save(file: Path, writer: Callable[[Path], None], tell_end: Callable[[], None]) -> None:
    write(file, writer, CommandError)
    tell_end()


def _report(file: Path, drawn: str, start: float, by: str, doubts: list[str], lines: Sequence[str]) -> None:
    spent = 1e3 * (clock_time.perf_counter() - start)
    errors.print(f"{file}  {drawn}, {spent:.0f} ms in all, {by}")
    for doubt in doubts:
        errors.print(f"raymarch: {doubt}")
    for line in lines:
        typer.echo(line)


def _report_joined(target: Path, what: str, start: float, parts: Parts) -> None:
    errors.print(f"{target}  {what}, {clock_time.perf_counter() - start:.1f} s to encode")
    if note := parts.finish():
        errors.print(f"raymarch: {note}")
