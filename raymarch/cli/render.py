"""`raymarch render`: renders a scene to picture files."""

from __future__ import annotations

import time as clock_time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from raymarch.cli.common import (
    SIZE,
    Backend,
    CommandError,
    Device,
    OptionalTime,
    SceneFile,
    errors,
    parse_size,
    parse_sweeps,
)
from raymarch.cli.presets import Preset
from raymarch.cli.progress import bar, watched
from raymarch.cli.views import CHOICES, check_view, shown
from raymarch.cluster.source import of_file
from raymarch.errors import RenderWarning
from raymarch.export import behind
from raymarch.export.film import FILMS
from raymarch.export.sequence import (
    EDGE,
    LARGE,
    LONG,
    Contents,
    Item,
    Parts,
    check_suffix,
    frames_of,
    is_large,
    join_film,
    join_tiles,
    tiles_of,
)
from raymarch.export.stills import FORMATS, Shot, draw, encoder, is_whole, key_of
from raymarch.files import import_optional, write
from raymarch.gpu.renderer import Renderer
from raymarch.scene.file import load
from raymarch.scene.parameter import set_values
from raymarch.scene.quality import PRESETS, Quality
from raymarch.scene.scene import Scene
from raymarch.scene.studio import staged


def run(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Picture to write; the suffix selects the format.", show_default="SCENE.png"
        ),
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height in pixels.")] = SIZE,
    time: OptionalTime = None,
    frames: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Render frames A to B-1: to a film, or to names with a field such as {:04d}."),
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames per second, with --frames.")] = 30.0,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Value of a Param; may be repeated. With --frames also NAME=A:B, from A to B.",
        ),
    ] = None,
    view: Annotated[str, typer.Option(help=f"What to show: {', '.join(CHOICES)}.")] = "final",
    slice_: Annotated[
        str | None,
        typer.Option(
            "--slice", metavar="y=0", help="Plane of --view slice.", show_default="axis plane facing the camera"
        ),
    ] = None,
    quality: Preset = None,
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
    explain_time: Annotated[
        bool,
        typer.Option(
            "--explain-time", help="First print the three dearest effects, and what each would save, measured small."
        ),
    ] = False,
    layers: Annotated[
        bool, typer.Option("--layers", help=".exr: also write depth, normals and the other arrays, as named layers.")
    ] = False,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT|local[:N]", help="Draw on the workers of a Dask cluster."),
    ] = None,
    workers: Annotated[
        str | None,
        typer.Option(metavar="NAME=N", help="--cluster: use workers with this Dask resource, such as GPU=1."),
    ] = None,
    mixed_drivers: Annotated[
        bool,
        typer.Option("--mixed-drivers", help="--cluster: accept workers whose drivers may differ in the last bit."),
    ] = False,
    split_samples: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="--cluster: split the samples of a pixel into N tasks.", show_default="1"
        ),
    ] = None,
    batch: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="--cluster: pictures of one task.", show_default="as many as take 0.2 s"),
    ] = None,
    task_timeout: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", min=1, help="--cluster: end a worker whose task takes longer.", show_default="900"
        ),
    ] = None,
    backend: Backend = "auto",
    device: Device = None,
) -> None:
    outputs = check_view(view, slice_)
    width, height = parse_size(size)
    chooser = choose_quality(quality, error, within)
    on_cluster = {
        "--workers": workers,
        "--split-samples": split_samples,
        "--batch": batch,
        "--task-timeout": task_timeout,
    }
    given = [
        name for name, value in (*on_cluster.items(), ("--mixed-drivers", mixed_drivers or None)) if value is not None
    ]
    if cluster is None and given:
        raise CommandError(f"{given[0]} without --cluster", legal="--cluster tcp://HOST:PORT or local:N")
    source, found = (None, load(scene)) if cluster is None else of_file(scene)  # read once: it may be a pipe
    found = staged(found)
    if samples is not None:  # before a quality is chosen by measurement
        found = found.replace(quality=found.quality.replace(samples=samples))
    params, sweep = parse_sweeps(set_ or [])
    if sweep is not None:
        if frames is None or cluster is not None:
            wrong = "without --frames" if frames is None else "with --cluster"
            raise CommandError(f"--set NAME=A:B {wrong}", legal="--frames A:B, on this machine; or NAME=VALUE")
        params |= sweep(0.0)
        set_values(found.parameters, params | sweep(1.0), where=found.where)  # what lies between is legal too
    target = output if output is not None else Path(scene.with_suffix(".png").name)
    if alpha:
        _check_alpha(target, view)
    items = _items(target, time, frames, fps, (width, height))
    suffix = target.suffix.lower()
    if layers and suffix != ".exr":
        raise CommandError(f"--layers with the output '{target}'", legal="a file ending in .exr")
    if (layers or suffix == ".npz") and view != "final":
        raise CommandError(f"--view {view} with all arrays", legal="no --view")
    film = suffix in FILMS
    shot = Shot((width, height), ".png" if film else suffix, params, view, outputs, alpha, layers, strict)
    if explain_time:
        explain_times(found, (width, height), items[0].time, params, backend, device)
    if cluster is not None and source is not None:
        from raymarch.cli.on_cluster import Where, render_on_cluster  # Dask takes tenths of a second to import
        from raymarch.cluster.submit import TIMEOUT, Options

        if error is not None or within is not None:
            raise CommandError("--error or --within with --cluster", legal="--quality, or a quality in the scene")
        options = Options(mixed_drivers, split_samples or 1, batch, task_timeout or TIMEOUT, backend, device)
        found = found if quality is None else found.replace(quality=found.quality.to_preset(quality))
        where = Where(cluster, workers, options)
        with ExitStack() as stack:
            drawn, key, parts = render_on_cluster(source, found, shot, items, target, frames is not None, where, stack)
            if parts is not None:
                join(target, drawn, fps, (width, height), key, parts)
        return
    large = frames is None and view == "final" and is_large((width, height)) and suffix in FORMATS
    if large:
        if error is not None or within is not None:
            raise CommandError(
                f"--error or --within with {width}x{height} pixels", legal=f"up to {LARGE} pixels and edges of {LONG}"
            )
        if suffix in (".tif", ".tiff"):
            import_optional(f"a large '{target}'", "tifffile", "tiff")
        whole, whole_shot = items[0], shot
        items = tiles_of(target, items[0].time, (width, height), EDGE, CommandError)
        shot = replace(shot, suffix=".png")
    key = None
    with Parts(items, target, CommandError) if film or large else nullcontext() as parts:
        with (
            Renderer(items[0].size, backend, device) as renderer,
            bar("drawing", len(items)) as progress,
            warnings.catch_warnings(),
            behind.film(target, items[0].file.parent, fps, CommandError) if film else nullcontext() as add,
            behind.in_order() as later,
        ):
            warnings.simplefilter("ignore", RenderWarning)  # printed below, one on each line
            found = found.replace(quality=chooser(found, renderer, items[0].time, params))
            contents = Contents(found, shot, renderer)
            for i, item in enumerate(items):
                start = clock_time.perf_counter()
                tell = partial(lambda before, share: progress(before + share), i)
                if sweep is not None:
                    shot = replace(shot, params=params | sweep(i / max(1, len(items) - 1)))
                if renderer.size != item.size:
                    renderer.resize(item.size)
                if shot.suffix == ".png":
                    content = contents.of(item, shot.params)
                    key = key_of(content, renderer.context.driver)
                    if parts is not None:
                        item = parts.placed(item, content)
                    if (frames is not None or large) and key is not None and is_whole(item.file, [key]):
                        if not large:
                            later(partial(errors.print, f"{item.file}  is already drawn"))
                        if add is not None:
                            add(item.file)
                        continue
                frame, doubts = draw(renderer, found, shot, item.time, item.part, tell)
                view_result = shown(renderer, frame, view, found, shot.params, tell)
                image = cache(view_result.image)
                writer = encoder(shot, frame, image, view_result.numbers, key, draft=parts is not None)
                if add is not None:
                    add(image())
                if large:
                    tell_end = partial(progress, i + 1)
                else:
                    by = f"{renderer.context.backend}: {renderer.context.driver.renderer}"
                    words = f"{width}x{height}  {frame.milliseconds:.1f} ms to draw ({renderer.clock.kind})"
                    tell_end = partial(_report, item.file, words, start, by, doubts, view_result.lines)
                later(partial(_save, item.file, writer, tell_end), writer.before)
                del frame, view_result, image  # the next frame then reads no arrays of this one
            drawn_at = clock_time.perf_counter()
            if large:
                key = key_of(Contents(found, whole_shot).of(whole), renderer.context.driver)
        if film and parts is not None:
            _report_joined(target, f"{len(items)} frames, {len(items) / fps:g} s", drawn_at, parts)
        elif parts is not None:
            join(target, parts.all(items), fps, (width, height), key, parts)


def explain_times(
    scene: Scene, size: tuple[int, int], time: float, params: Mapping[str, Any], backend: str, device: int | None
) -> None:
    """Print the dearest effects of a scene and what each would save."""
    from raymarch.cost.effects import dearest  # only this option measures

    found = dearest(scene, size, time, params, backend, device)
    if not found:
        errors.print("no effect to leave out: the time is that of the solid; `raymarch explain` shows its plan")
    for saving in found:
        errors.print(f"without {saving.words} less", markup=False, highlight=False)


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


def join(target: Path, items: Sequence[Item], fps: float, size: tuple[int, int], key: str | None, parts: Parts) -> None:
    """Write a film of its frames, or a picture of its tiles, and remove them."""
    start = clock_time.perf_counter()
    if target.suffix.lower() in FILMS:
        join_film(target, items, fps, CommandError)
        what = f"{len(items)} frames, {len(items) / fps:g} s"
    else:
        join_tiles(target, items, key, CommandError)
        what = f"{size[0]}x{size[1]}, {len(items)} tiles"
    _report_joined(target, what, start, parts)


def _check_alpha(target: Path, view: str) -> None:
    if view != "final":
        raise CommandError(f"--alpha with --view {view}", legal="the final picture")
    if target.suffix.lower() not in (".png", ".webp", ".tif", ".tiff"):
        raise CommandError(f"--alpha with the output '{target}'", legal="a file ending in .png, .webp, .tif or .tiff")


def _items(target: Path, time: float | None, frames: str | None, fps: float, size: tuple[int, int]) -> list[Item]:
    check_suffix(target, CommandError)
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
    if not 0 < fps < float("inf"):
        raise CommandError(f"--fps {fps}", legal="a number > 0")
    return frames_of(target, range(int(first), int(last)), fps, size, "--frames", CommandError)


# The quality: the scene's, a preset, or one found by measurement

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
