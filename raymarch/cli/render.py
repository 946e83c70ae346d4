"""`raymarch render`: renders a scene to picture files."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from raymarch.cli.common import (
    SIZE,
    Backend,
    CommandError,
    Device,
    NoMeasured,
    OptionalTime,
    SceneFile,
    among,
    errors,
    parse_size,
    parse_sweeps,
)
from raymarch.cli.drawing import draw_here, join
from raymarch.cli.job import Job, check_measured, check_outputs, check_sweep, parse_items, parse_quality
from raymarch.cli.presets import Preset
from raymarch.cli.report import reported
from raymarch.cli.views import CHOICES, check_view
from raymarch.cluster.source import Source, of_file
from raymarch.export import png
from raymarch.export.film import FILMS
from raymarch.export.stills import Shot
from raymarch.files import check_apart, folders_of, recorded
from raymarch.scene.file import load
from raymarch.scene.scene import Scene
from raymarch.scene.studio import staged

OnCluster = Annotated[
    str | None, typer.Option(metavar="tcp://HOST:PORT|local[:N]", help="Draw on the workers of a Dask cluster.")
]
Workers = Annotated[
    str | None,
    typer.Option(metavar="NAME=N", help="--cluster: use workers with this Dask resource, such as GPU=1."),
]
MixedDrivers = Annotated[
    bool, typer.Option("--mixed-drivers", help="--cluster: accept workers whose drivers may differ in the last bit.")
]
SplitSamples = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, help="--cluster: split the samples of a pixel into N tasks.", show_default="1"),
]
Batch = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, help="--cluster: pictures of one task.", show_default="as many as take 0.2 s"),
]
TaskTimeout = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", min=1, help="--cluster: end a worker whose task takes longer.", show_default="900"),
]


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
    view: Annotated[
        str, typer.Option(help=f"What to show: {', '.join(CHOICES)}.", autocompletion=among(*CHOICES))
    ] = "final",
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
    alpha: Annotated[
        bool, typer.Option("--alpha", help="Make the sky transparent, in .png, .webp, .tif or .exr.")
    ] = False,
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
        bool,
        typer.Option("--layers", help=".exr: also write depth, normals, albedo, motion and all arrays, as layers."),
    ] = False,
    cryptomatte: Annotated[
        bool, typer.Option("--cryptomatte", help=".exr: also write mattes of objects and materials by their names.")
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document: files, times, evaluations and doubts.")
    ] = False,
    cluster: OnCluster = None,
    workers: Workers = None,
    mixed_drivers: MixedDrivers = False,
    split_samples: SplitSamples = None,
    batch: Batch = None,
    task_timeout: TaskTimeout = None,
    backend: Backend = "auto",
    device: Device = None,
    no_measured: NoMeasured = False,
) -> None:
    with ExitStack() as stack:
        report = stack.enter_context(reported(json))
        outputs = check_view(view, slice_)
        extent, choose = parse_size(size), parse_quality(quality, error, within)
        on_workers = parse_cluster(cluster, json, workers, mixed_drivers, split_samples, batch, task_timeout)
        with recorded() as read:  # once: it may be a pipe
            source, found = (None, load(scene)) if cluster is None else of_file(scene)
        found = staged(found)
        if samples is not None:  # before a quality is chosen by measurement
            found = found.replace(quality=found.quality.replace(samples=samples))
        params, sweep = parse_sweeps(set_ or [])
        params = check_sweep(sweep, found, params, frames, cluster)
        target = output if output is not None else Path(scene.with_suffix(".png").name)
        check_outputs(target, view, alpha, layers, cryptomatte)
        items = parse_items(target, time, frames, fps, extent)
        check_apart(read, (target, *(item.file for item in items)), CommandError)
        suffix, level = target.suffix.lower(), png.FRAME if frames else png.STILL
        if suffix in FILMS:
            suffix, level = ".png", png.DRAFT
        shot = Shot(extent, suffix, params, view, outputs, alpha, layers, cryptomatte, strict, fps, level=level)
        job = Job(found, target, items, shot, fps, frames is not None, choose, sweep, backend, device)
        if explain_time:
            explain_times(found, extent, items[0].time, params, backend, device)
        check_measured(error, within, cluster is not None, job)
        report.folders = stack.enter_context(folders_of(target, CommandError))
        if cluster is None or source is None:
            draw_here(job, report)
        else:
            if quality is not None:
                job = replace(job, scene=found.replace(quality=found.quality.to_preset(quality)))
            draw_there(job, source, cluster, on_workers)


def parse_cluster(
    cluster: str | None,
    json: bool,
    workers: str | None,
    mixed_drivers: bool,
    split_samples: int | None,
    batch: int | None,
    task_timeout: float | None,
) -> dict[str, Any]:
    """The options of a cluster that were given, by their names there. CommandError for one without --cluster, and for
    --json with it."""
    given = {
        "workers": workers,
        "split_samples": split_samples,
        "batch": batch,
        "task_timeout": task_timeout,
        "mixed_drivers": mixed_drivers or None,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if cluster is not None and json:
        raise CommandError("--json with --cluster", legal="one of them")
    if cluster is None and given:
        option = "--" + next(iter(given)).replace("_", "-")
        raise CommandError(f"{option} without --cluster", legal="--cluster tcp://HOST:PORT or local:N")
    return given


def draw_there(job: Job, source: Source, address: str, given: Mapping[str, Any]) -> None:
    """Draw the pictures on the workers of a cluster, and join what belongs together here."""
    from raymarch.cli.on_cluster import Where, render_on_cluster  # Dask takes tenths of a second to import
    from raymarch.cluster.submit import TIMEOUT, Options

    options = Options(
        given.get("mixed_drivers", False),
        given.get("split_samples", 1),
        given.get("batch"),
        given.get("task_timeout", TIMEOUT),
        job.backend,
        job.device,
    )
    where = Where(address, given.get("workers"), options)
    with ExitStack() as stack:
        drawn, key, parts = render_on_cluster(source, job, where, stack)
        if parts is not None:
            join(job, drawn, key, parts)


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
