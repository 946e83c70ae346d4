"""The quality of `raymarch render`: the scene's, a preset, or one found by measurement."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from raymarch.cli.common import CommandError, errors
from raymarch.cli.progress import watched
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
    errors.print(f"{target}: {found.words}")
    return found.quality
