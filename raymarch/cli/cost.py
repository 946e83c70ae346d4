"""`raymarch cost`: measures accuracy against time."""

from __future__ import annotations

import json as json_format
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from raymarch.cli.common import (
    Backend,
    CommandError,
    Device,
    NoMeasured,
    OptionalTime,
    Output,
    SceneFile,
    Settings,
    among,
    errors,
    ignore_measured,
    parse_settings,
    parse_size,
)
from raymarch.cli.progress import bar, watched
from raymarch.cluster.source import Source, of_file
from raymarch.cost import baseline
from raymarch.cost.answer import BOUNDS, advice, sentence
from raymarch.cost.checks import check
from raymarch.cost.drawing import by_cpu_time
from raymarch.cost.effects import Effect, ablate, ablations, evaluations_of
from raymarch.cost.effects import table as effects_table
from raymarch.cost.errors import check_followed
from raymarch.cost.html import as_html, templates
from raymarch.cost.plots import figure, save
from raymarch.cost.reference import Reference, reference
from raymarch.cost.rivals import time_again
from raymarch.cost.settings import Setting, axes, grid, parse_values
from raymarch.cost.sweep import METRICS, Point, Progress, Sweep, environment, sweep
from raymarch.cost.text import FORMAT, as_csv, as_json, findings, in_table, light_table, proof_words, table
from raymarch.cost.variants import ideal_of
from raymarch.cost.views import views
from raymarch.errors import CostError
from raymarch.files import check_apart, import_optional, reading, recorded, valid, write
from raymarch.gpu.driver_cache import without_driver_cache
from raymarch.gpu.renderer import Renderer
from raymarch.proof import prove
from raymarch.scene.file import load
from raymarch.scene.parameter import set_values
from raymarch.scene.scene import Scene

UNPROVED = "No hit is proved: the field is an estimate (--prove tries all the same)."
SIZE = "320x180"
"""Default size of the measured pictures."""
WIDTH = 150
"""Minimum width of the table in columns, also if the output is a narrower terminal or none."""

ENDINGS = {
    "--json": (".json",),
    "--csv": (".csv",),
    "--plot": (".png", ".svg", ".pdf"),
    "--html": (".html", ".htm"),
    "--write-baseline": (".json",),
}
"""Suffixes that each option accepts."""


Metric = Annotated[
    str, typer.Option(help=f"Error metric of the Pareto front: {', '.join(METRICS)}.", autocompletion=among(*METRICS))
]
Proved = Annotated[
    bool | None,
    typer.Option(
        "--prove/--no-prove",
        help="Prove the hits of the scene's own setting by intervals, as `raymarch prove`; by default unless the field "
        "is an estimate.",
        show_default=False,
    ),
]


def run(
    scene: SceneFile,
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Width and height in pixels.", show_default=SIZE)
    ] = None,
    time: OptionalTime = None,
    set_: Settings = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=V,V,...", help="Values to try on an axis; may be repeated."),
    ] = None,
    cross: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="Try these axes only, in all combinations.")
    ] = None,
    by: Metric = "pixels_p99",
    repeats: Annotated[int, typer.Option(min=1, max=1000, help="Timed frames per setting.")] = 9,
    seed: Annotated[int, typer.Option(help="Seed of the random order of frames.")] = 1,
    samples: Annotated[
        int, typer.Option("--reference-samples", help="Rays per pixel of the reference picture, a square number.")
    ] = 16,
    everything: Annotated[bool, typer.Option("--all", help="Show all settings, including dominated ones.")] = False,
    json: Annotated[Path | None, typer.Option(help="Write all results as JSON.")] = None,
    csv: Annotated[Path | None, typer.Option(help="Write one line per setting as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Plot error against time and more: .png, .svg or .pdf.")] = None,
    html: Annotated[
        Path | None, typer.Option(help="Write a page to explore error against time, pictures and effects: one file.")
    ] = None,
    check_: Annotated[
        Path | None,
        typer.Option(
            "--check", metavar="FILE", help="Fail with exit code 1 if errors or evaluations grew since this baseline."
        ),
    ] = None,
    write_baseline: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Record errors and evaluations of this scene; other scenes in it are kept."),
    ] = None,
    effects: Annotated[bool, typer.Option("--effects", help="Measure the cost of each effect of the scene.")] = False,
    prove_: Proved = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT|local[:N]", help="Measure on the workers of a Dask cluster."),
    ] = None,
    mixed_drivers: Annotated[
        bool, typer.Option("--mixed-drivers", help="--cluster: accept workers with different drivers.")
    ] = False,
    backend: Backend = "auto",
    device: Device = None,
    no_measured: NoMeasured = False,
) -> None:
    files = {"--json": json, "--csv": csv, "--plot": plot, "--html": html, "--write-baseline": write_baseline}
    baselines = {"--check": check_, "--write-baseline": write_baseline}
    _check_files(files)
    if by not in METRICS:
        raise CommandError(f"--by {by}", legal=", ".join(METRICS))
    if not 1 <= samples <= 256 or round(samples**0.5) ** 2 != samples:
        raise CommandError(f"--reference-samples {samples}", legal="a square number from 1 to 256")
    if mixed_drivers and cluster is None:
        raise CommandError("--mixed-drivers without --cluster", legal="--cluster tcp://HOST:PORT or local:N")
    _check_together(files | baselines, effects, bool(prove_), cluster is not None)
    crossed = None if cross is None else [name.strip() for name in cross.split(",") if name.strip()]
    asked = axes(crossed, _given(axis or []))
    pixels, params = parse_size(size or SIZE), parse_settings(set_ or [])
    with recorded() as read:  # once: it may be a pipe
        source, found = (None, load(scene)) if cluster is None else of_file(scene)
    check_apart(read, files.values(), CommandError)
    bench = _Bench(found, valid(scene.stem), pixels, time or 0.0, params, repeats, seed, samples, backend, device)
    if write_baseline is not None or check_ is not None:
        ignore_measured(True)  # evaluations then depend on no driver
    if write_baseline is not None:
        _write_baseline(bench, write_baseline)
    elif check_ is not None:
        _check_baseline(bench, check_, {"--size": size and pixels, "--time": time, "--set": params or None})
    elif effects:
        _effects(bench, json)
    else:
        if by.startswith("flip_"):
            check_followed(found)
        settings = grid(found, asked, pixels)
        costs: list[Effect] = []
        if cluster is not None and source is not None:
            timed = plot is not None or html is not None
            made = bench.sweep_on(source, settings, cluster, mixed_drivers, timed)
        else:
            made, costs = bench.sweep(settings, html is not None)
        if prove_ is not False:
            made.proof = bench.proof(asked=prove_ is True)
        show(made, by, everything)
        _write_sweep(made, costs, by, files)


def _check_together(files: Mapping[str, Path | None], effects: bool, proved: bool, cluster: bool) -> None:
    """CommandError for options that exclude each other."""
    given = [option for option, file in files.items() if file is not None]
    baselines = [option for option in ("--check", "--write-baseline") if option in given]
    if cluster and baselines:
        raise CommandError("--check or --write-baseline together with --cluster", legal="one of them")
    if cluster and effects:
        raise CommandError("--effects together with --cluster", legal="one of them")
    if proved and (effects or baselines):
        raise CommandError("--prove together with --effects, --check or --write-baseline", legal="one of them")
    if baselines:
        others = [option for option in given if option != baselines[0]] + ["--effects"] * effects
        if others:
            raise CommandError(f"{baselines[0]} together with {others[0]}", legal="one of them")
    for option in given:
        if effects and option != "--json":
            raise CommandError(f"--effects together with {option}", legal="--json")


def _write_sweep(made: Sweep, costs: Sequence[Effect], by: str, files: Mapping[str, Path | None]) -> None:
    """Write the files of a sweep; without times no figure and no page."""
    if made.untimed and (files["--plot"] or files["--html"]):  # the worker that was alone on its machine has left
        errors.print(f"raymarch: --plot and --html are not written without times: {made.untimed}")
        files = {**files, "--plot": None, "--html": None}
    for option, text in (("--json", as_json), ("--csv", as_csv), ("--html", partial(as_html, effects=costs))):
        if (file := files[option]) is not None:
            _write(file, text(made, by))
    if (plot := files["--plot"]) is not None:
        data = save(figure(made, by), plot.suffix[1:].lower())
        write(plot, lambda target: target.write_bytes(data), CommandError)


@dataclass(frozen=True, slots=True)
class _Bench:
    """What is measured: a scene, its picture, how often, and the device.

    samples : rays per pixel of the reference. repeats : timed frames per setting. seed : of the order of frames.
    """

    scene: Scene
    name: str
    size: tuple[int, int]
    time: float
    params: dict[str, Any]
    repeats: int
    seed: int
    samples: int
    backend: str
    device: int | None

    @contextmanager
    def opened(self) -> Iterator[tuple[Progress, Renderer]]:
        """A progress bar and a renderer."""
        with (
            without_driver_cache(),
            watched() as tell,
            Renderer(self.size, self.backend, self.device) as renderer,
            by_cpu_time(renderer),
        ):
            yield tell, renderer

    def reference(self, scene: Scene, samples: int, tell: Progress) -> Reference:
        """The reference of a variant of the scene."""
        return reference(scene, self.size, self.time, self.params, samples, lambda what: tell(what, 0.0))

    def sweep(self, settings: Sequence[Setting], effects: bool) -> tuple[Sweep, list[Effect]]:
        """The sweep of the scene with its checks; with `effects`, also the cost of each effect."""
        scene, moment = self.scene, (self.time, self.params)
        with self.opened() as (tell, renderer):
            known = self.reference(scene, self.samples, tell)

            def judge(setting: Setting) -> Reference:
                ideal = ideal_of(scene, setting.variations)
                return known if ideal is scene else self.reference(ideal, self.samples, tell)

            seen = views(scene, self.size, *moment, lambda what: tell(what, 0.0))
            how: dict[str, Any] = {"judge": judge, "count": evaluations_of, "seen": seen}
            made = sweep(scene, settings, known, renderer, self.name, *moment, self.repeats, self.seed, tell, **how)
            time_again(made, scene, renderer, BOUNDS, *moment, tell)
            made.checks = check(made, scene, renderer, *moment)
            costs: list[Effect] = []
            if effects and any(ablations(scene)):
                costs = self.effects(renderer, tell)
        return made, costs

    def sweep_on(self, source: Source, settings: Sequence[Setting], address: str, mixed: bool, timed: bool) -> Sweep:
        """The sweep on a cluster. mixed, timed : see `Options` and `cost_on_cluster`."""
        from raymarch.cli.on_cluster import cost_on_cluster  # Dask takes tenths of a second to import
        from raymarch.cluster.submit import Options
        from raymarch.cluster.sweep import Moment

        moment = Moment(self.size, self.time, self.params, self.samples)
        options = Options(mixed, backend=self.backend, device=self.device)
        with watched() as tell:
            how = moment, self.repeats, self.seed, address, options, tell, timed
            return cost_on_cluster(source, self.scene, self.name, settings, *how)

    def effects(self, renderer: Renderer, tell: Progress) -> list[Effect]:
        """The cost of each effect."""
        return ablate(self.scene, renderer, self.time, self.params, self.repeats, self.seed, tell)

    def proof(self, asked: bool) -> dict[str, Any]:
        """The proof of the hits of the scene's own setting. asked : False leaves out that of an estimate."""
        if self.scene.node.exactness == "estimate" and not asked:
            return {"words": UNPROVED, "pixels": 0}
        with bar("proof", 1.0) as progress:
            proof = prove(self.scene, size=self.size, time=self.time, params=self.params, progress=progress)
        return {"words": str(proof), **proof.as_dict()}

    def rows(self) -> dict[str, baseline.Row]:
        with self.opened() as (tell, renderer):
            known = self.reference(self.scene, 0, tell)
            return baseline.measured(self.scene, known, renderer, self.time, self.params)


def _write_baseline(bench: _Bench, file: Path) -> None:
    """Measure a scene and record it in a baseline."""
    records = baseline.read(file) if file.exists() else {}
    rows = bench.rows()
    record = records[bench.name] = baseline.Record(bench.size, bench.time, bench.params, rows)
    _write(file, baseline.as_text(records))
    Output().print(baseline.summary(bench.name, record, rows, 0).replace("nothing grew", "recorded"), markup=False)


def _check_baseline(bench: _Bench, file: Path, given: dict[str, Any]) -> None:
    """Measure a scene as its baseline was; print what grew. Exit code 1 if something did."""
    records, name = baseline.read(file), bench.name
    if name not in records:
        raise CommandError(f"--check {file}: no scene '{name}'", legal=", ".join(records) or baseline.LEGAL)
    known = records[name]
    bench = replace(bench, size=known.size, time=known.time, params=dict(known.params))
    with reading("--check", file, baseline.LEGAL, CommandError):
        set_values(bench.scene.parameters, bench.params, bench.time)
    recorded = {"--size": bench.size, "--time": bench.time, "--set": bench.params}
    for option, value in given.items():
        if value is not None and value != recorded[option]:
            raise CommandError(f"{option} {value} with --check", legal=f"{recorded[option]}, as in the baseline")
    now = bench.rows()
    faults = [f for row, figures in known.rows.items() for f in baseline.grown(f"{name} {row}", figures, now[row])]
    out = Output()
    for line in (*faults, baseline.summary(name, known, now, len(faults))):
        out.print(line, markup=False)
    if faults:
        raise typer.Exit(1)


def _effects(bench: _Bench, json: Path | None) -> None:
    """Measure the cost of each effect; print a table and write JSON."""
    with bench.opened() as (tell, renderer):
        found = bench.effects(renderer, tell)
        measured_on = environment(renderer)
    _wide().print(effects_table(found, bench.name))
    if json is not None:
        data = {"format": FORMAT, "scene": bench.name, "size": list(bench.size)}
        data |= {"seed": bench.seed, "repeats": bench.repeats}
        data |= {"environment": measured_on, "effects": [e.as_dict() for e in found]}
        _write(json, json_format.dumps(data, indent=2, allow_nan=False) + "\n")


def _write(file: Path, text: str) -> None:
    write(file, lambda target: target.write_text(text, encoding="utf-8"), CommandError)


def _wide() -> Output:
    """The output stream, wide enough for tables."""
    out = Output(soft_wrap=False)
    out.width = max(out.width, WIDTH)
    return out


def show(made: Sweep, metric: str, everything: bool) -> None:
    out = _wide()
    shown = made.points if everything else points_shown(made, metric)
    out.print(table(made, metric, shown))
    left = len(in_table(made, metric)) - len(in_table(made, metric, shown))
    if left:
        out.print(f"and {left} more dominated settings (--all)", markup=False)
    if (light := light_table(made, metric)) is not None:
        out.print(light)
    proved = [line for line in (proof_words(made),) if line]
    for line in (*findings(made, metric), *proved, "", sentence(made), *([] if made.untimed else advice(made))):
        out.print(line, markup=False, soft_wrap=True, highlight=False)


def points_shown(made: Sweep, metric: str) -> list[Point]:
    """The points to show: the Pareto front, the scene's own quality, the presets, and settings with a single change."""
    front = {id(p) for p in made.front(metric)}
    return [p for p in made.points if id(p) in front or p is made.base or p.setting.preset or "," not in p.setting.name]


def _check_files(files: dict[str, Path | None]) -> None:
    """Check suffixes and folders of the output files before measuring."""
    for option, file in files.items():
        if file is None:
            continue
        if file.suffix.lower() not in ENDINGS[option]:
            raise CommandError(f"{option} {file}", legal=f"a file ending in {' or '.join(ENDINGS[option])}")
        if not file.absolute().parent.is_dir():
            raise CommandError(f"{option} {file}: no folder '{file.parent}'", legal="a writable folder")
        if option == "--plot":
            import_optional("a figure", "matplotlib", "report", CostError)
        if option == "--html":
            templates()


def _given(texts: Sequence[str]) -> dict[str, Sequence[Any]]:
    found: dict[str, Sequence[Any]] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        if not equals:
            raise CommandError(f"--axis {text}", legal="NAME=VALUE,VALUE,...")
        found[name.strip()] = parse_values(name.strip(), values)
    return found
