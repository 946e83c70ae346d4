"""What a command line of `raymarch render` asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from raymarch.cli.common import CommandError, Sweep, errors
from raymarch.cli.progress import watched
from raymarch.export import png
from raymarch.export.film import FILMS
from raymarch.export.sequence import EDGE, LARGE, LONG, Item, check_suffix, frames_of, is_large, tiles_of
from raymarch.export.stills import FORMATS, Shot
from raymarch.files import import_optional
from raymarch.gpu.renderer import Renderer
from raymarch.scene.parameter import set_values
from raymarch.scene.quality import PRESETS, Quality
from raymarch.scene.scene import Scene

Chooser: TypeAlias = Callable[[Scene, Renderer, float, Mapping[str, Any]], Quality]
"""A function that returns the quality for a scene, a renderer, a time and parameters."""


@dataclass(frozen=True, slots=True)
class Job:
    """Pictures to draw, with all options checked.

    scene : with the samples that are asked for. target : the picture, the film, or the name of a sequence.
    items : the pictures, or the tiles of one. shot : what they show. sequence : True for --frames.
    choose : the quality, by the first picture. sweep : None if no parameter moves.
    backend, device : where it is drawn, if not on a cluster.
    """

    scene: Scene
    target: Path
    items: list[Item]
    shot: Shot
    fps: float
    sequence: bool
    choose: Chooser
    sweep: Sweep | None
    backend: str
    device: int | None

    @property
    def film(self) -> bool:
        return self.target.suffix.lower() in FILMS

    @property
    def size(self) -> tuple[int, int]:
        """Of the whole picture."""
        return self.shot.size

    @property
    def large(self) -> bool:
        """True for one picture that is drawn in tiles."""
        named = self.target.suffix.lower() in FORMATS
        return not self.sequence and self.shot.view == "final" and named and is_large(self.size)

    def tiled(self, edge: int | None = None) -> Job:
        """The job whose items are the tiles of the picture. CommandError if its file cannot be written in tiles."""
        if self.target.suffix.lower() in (".tif", ".tiff") and is_large(self.size):
            import_optional(f"a large '{self.target}'", "tifffile", "tiff")
        tiles = tiles_of(self.target, self.items[0].time, self.size, edge or EDGE, CommandError)
        return replace(self, items=tiles, shot=replace(self.shot, suffix=".png", level=png.DRAFT))

    def at(self, index: int) -> Shot:
        """The shot of an item, with the parameters of its neighbours."""
        if self.sweep is None:
            return self.shot
        last, sweep = max(1, len(self.items) - 1), self.sweep
        before, now, after = (
            {**self.shot.params, **sweep(min(max(i, 0), last) / last)} for i in (index - 1, index, index + 1)
        )
        return replace(self.shot, params=now, neighbours=(before, after))


TRANSPARENT = (".png", ".webp", ".tif", ".tiff", ".exr")
"""Suffixes of files with an alpha channel."""


def check_outputs(target: Path, view: str, alpha: bool, layers: bool, mattes: bool) -> None:
    """CommandError for options that the file cannot hold."""
    suffix = target.suffix.lower()
    if alpha and view != "final":
        raise CommandError(f"--alpha with --view {view}", legal="the final picture")
    if alpha and suffix not in TRANSPARENT:
        raise CommandError(f"--alpha with the output '{target}'", legal=f"a file ending in {', '.join(TRANSPARENT)}")
    for option in ("--layers",) * layers + ("--cryptomatte",) * mattes:
        if suffix != ".exr":
            raise CommandError(f"{option} with the output '{target}'", legal="a file ending in .exr")
    if (layers or mattes or suffix == ".npz") and view != "final":
        raise CommandError(f"--view {view} with all arrays", legal="no --view")


def check_sweep(
    sweep: Sweep | None, scene: Scene, params: dict[str, Any], frames: str | None, cluster: str | None
) -> dict[str, Any]:
    """The parameters of the first picture. Both ends of a sweep are checked: what lies between is legal too."""
    if sweep is None:
        return params
    if frames is None or cluster is not None:
        wrong = "without --frames" if frames is None else "with --cluster"
        raise CommandError(f"--set NAME=A:B {wrong}", legal="--frames A:B, on this machine; or NAME=VALUE")
    set_values(scene.parameters, params | sweep(1.0), where=scene.where)
    return params | sweep(0.0)


def parse_items(target: Path, time: float | None, frames: str | None, fps: float, size: tuple[int, int]) -> list[Item]:
    """The pictures of --time or --frames."""
    check_suffix(target, CommandError)
    if not 0 < fps < float("inf"):
        raise CommandError(f"--fps {fps}", legal="a number > 0")
    if frames is None:
        if target.suffix.lower() in FILMS:
            raise CommandError(f"a film '{target}' without --frames", legal="--frames A:B, such as 0:90")
        if target.suffix.lower() == ".exr":
            import_optional(f"'{target}'", "OpenEXR", "exr")
        return [Item("the picture", 0.0 if time is None else time, target, size)]
    if time is not None:
        raise CommandError("--time together with --frames", legal="one of them")
    first, colon, last = frames.partition(":")
    if not colon or not first.isdecimal() or not last.isdecimal() or int(first) >= int(last):
        raise CommandError(f"--frames {frames}", legal="A:B with 0 <= A < B, such as 0:90")
    return frames_of(target, range(int(first), int(last)), fps, size, "--frames", CommandError)


def parse_quality(preset: str | None, error: str | None, within: str | None) -> Chooser:
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


def check_measured(error: str | None, within: str | None, cluster: bool, job: Job) -> None:
    """CommandError where a quality cannot be found by measurement."""
    if error is None and within is None:
        return
    if cluster:
        raise CommandError("--error or --within with --cluster", legal="--quality, or a quality in the scene")
    if job.large:
        width, height = job.size
        raise CommandError(
            f"--error or --within with {width}x{height} pixels", legal=f"up to {LARGE} pixels and edges of {LONG}"
        )


def _found(
    search: Callable[..., Any], target: str, scene: Scene, renderer: Renderer, time: float, params: Mapping[str, Any]
) -> Quality:
    with watched() as tell:
        found = search(scene, target, renderer.size, time, params, renderer=renderer, progress=tell)
    errors.print(f"{target}: {found.words}")
    return found.quality
