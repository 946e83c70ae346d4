"""The quality of `raymarch render`: the scene's, a preset, or one found by measurement."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeAlias

from raymarch.cli.common import CommandError, errors
from raymarch.cli.progress import logged
from raymarch.gpu.renderer import Renderer
from raymarch.scene.quality import PRESETS, Quality
from raymarch.scene.scene import Scene

Chooser: TypeAlias = Callable[[Scene, Renderer, float, Mapping[str, Any]], Quality]
"""A function that returns the quality for a scene, a renderer, a time and parameters."""


def choose_quality(preset: str | None, error: str | None, within: str | None) -> Chooser:
    """The chooser for --quality, --error and --within. CommandError for invalid options, before anything is drawn."""
    given = [name for name, value in (("--quality", preset), ("--error", error), ("--within", within)) if value]
    if len(given) > 1:
        raise CommandError(" together with ".join(given), legal="one of them")
    if preset is not None:
        if preset not in PRESETS:
            raise CommandError(f"--quality {preset}", legal=", ".join(PRESETS))
        return lambda scene, *_: scene.quality.to_preset(preset)
    if error is None and within is None:
        return lambda scene, *_: scene.quality
    from raymarch.cost import search  # only a search uses the reference

    if error is not None:
        search.parse_error(error)
        return lambda *where: _found(search.for_error, error, *where)
    search.parse_time(str(within))
    return lambda *where: _found(search.for_time, str(within), *where)


def _found(
    search: Callable[..., Any], target: str, scene: Scene, renderer: Renderer, time: float, params: Mapping[str, Any]
) -> Quality:
    with watched() as tell:
        found = search(scene, target, renderer.size, time, params, renderer=renderer, progress=tell)
    errors.print(f"{target}: {found.words}", markup=False)
    return found.quality


@contextmanager
def watched() -> Iterator[Callable[[str, float], None]]:
    """A transient progress bar with a description of the current step; lines where the error stream is no terminal."""
    if not errors.is_interactive:
        yield logged()
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    percent, step = TextColumn("{task.percentage:>3.0f} %"), TextColumn("{task.fields[what]}")
    with Progress(BarColumn(), percent, TimeElapsedColumn(), step, console=errors, transient=True) as bar:
        task = bar.add_task("", total=1.0, what="")

        def tell(what: str, share: float) -> None:
            bar.update(task, completed=share, what=what)

        yield tell
