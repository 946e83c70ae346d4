"""`raymarch render --cluster`: progress, messages and the summary."""

from __future__ import annotations

import time as clock_time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from raymarch.cli.common import CommandError, errors
from raymarch.cli.job import Job
from raymarch.cli.progress import counted
from raymarch.cluster.connect import check_address, connected
from raymarch.cluster.frames import check, draw_items, drawn_before, failures
from raymarch.cluster.source import Source
from raymarch.cluster.submit import Cluster, Failed, Options
from raymarch.cluster.sweep import SHARED, Moment, sweep_on
from raymarch.cluster.worker import Done, Refused
from raymarch.cost.settings import Setting
from raymarch.cost.sweep import Progress, Sweep
from raymarch.export.sequence import Contents, Item, Parts, edge_of
from raymarch.export.stills import FORMATS, key_of
from raymarch.gpu.driver import Driver
from raymarch.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class Where:
    """The options of a cluster as they were given: --cluster, --workers, and the others."""

    address: str
    workers: str | None
    options: Options

    @property
    def resources(self) -> dict[str, float] | None:
        """The Dask resources of --workers. CommandError if they are not NAME=N."""
        if self.workers is None:
            return None
        name, equals, value = self.workers.partition("=")
        if not equals or not name.strip() or not value.replace(".", "", 1).isdecimal() or float(value) <= 0:
            raise CommandError(f"--workers {self.workers}", legal="NAME=N, such as GPU=1")
        return {name.strip(): float(value)}


def render_on_cluster(
    source: Source, job: Job, where: Where, stack: ExitStack
) -> tuple[Sequence[Item], str | None, Parts | None]:
    """Draw the frames of a film, or the tiles of one picture. source : of the job's scene.

    Returns what was drawn, the items or the tiles, the key of the one picture, and the folder of parts that are to be
    joined, which `stack` closes.
    """
    local = check_address(where.address)
    scene, items, shot = job.scene, job.items, job.shot
    resources, options = where.resources, where.options
    check(scene, shot, options)
    what, key = "frames", None
    tiled = shot.suffix in FORMATS and shot.view == "final" and scene.quality.rays == "computed" and not scene.post
    if not job.sequence and tiled:
        tiles, what = job.tiled(edge_of(shot.size)), "tiles"
        items, shot = tiles.items, tiles.shot
    failed: list[tuple[Item, Refused | Failed]] = []
    start = clock_time.perf_counter()
    joined = what == "tiles" or job.film
    parts = stack.enter_context(Parts(items, job.target, CommandError)) if joined else None
    before = None if local is None else drawn_before(scene, shot, items, options, parts)
    if before is not None:
        for item in before[0] if what == "frames" else ():
            errors.print(f"{item.file}  is already drawn")
        return before[0], key_for(job, before[1]) if what == "tiles" else None, parts
    with connected(where.address, options.timeout) as client:
        cluster: Cluster[Any] = Cluster(client, resources)
        errors.print(f"{where.address}: {client.dashboard_link}")
        with counted(len(items), what) as advance:
            drawn = draw_items(cluster, source, scene, shot, items, options, errors.say, CommandError, parts)
            for item, outcome in drawn:
                advance(cluster.log.workers)
                if isinstance(outcome, Done):
                    if what == "frames":
                        _print(item, outcome)
                elif outcome is not None:
                    if all(outcome.message != known.message for _, known in failed):
                        errors.say(failures([(item, outcome)])[0])
                    failed.append((item, outcome))
                elif what == "frames":
                    errors.print(f"{item.file}  is already drawn")
    for line in cluster.log.lines(what, clock_time.perf_counter() - start):
        errors.print(line)
    for line in failures(failed):
        if " more cannot" in line:
            errors.say(line)
    if failed:
        raise CommandError(f"{len(failed)} of {len(items)} {what} could not be drawn", legal="see above")
    if what == "tiles":
        key = key_for(job, cluster.used[0].driver)
    return parts.all(items) if parts is not None else items, key, parts


def key_for(job: Job, driver: Driver) -> str | None:
    """The key of the one picture of a job."""
    return key_of(Contents(job.scene, job.shot).of(job.items[0]), driver)


def cost_on_cluster(
    source: Source,
    scene: Scene,
    name: str,
    settings: Sequence[Setting],
    moment: Moment,
    repeats: int,
    seed: int,
    address: str,
    options: Options,
    report: Progress,
    timed: bool,
) -> Sweep:
    """The sweep of a scene, which is that of the source, on a cluster.

    timed : raise CommandError if times cannot be taken.
    """
    check_address(address)
    start = clock_time.perf_counter()
    with connected(address, options.timeout) as client:
        cluster: Cluster[Any] = Cluster(client)
        errors.print(f"{address}: {client.dashboard_link}")
        if timed and not cluster.alone():
            raise CommandError(f"--plot or --html without times: {SHARED}", legal="--json or --csv")
        made = sweep_on(cluster, source, scene, settings, moment, name, repeats, seed, options, report, errors.say)
    spent = clock_time.perf_counter() - start
    errors.print(f"{len(settings)} settings in {spent:.1f} s on {cluster.log.workers} workers")
    return made


def _print(item: Item, done: Done) -> None:
    width, height = item.size
    errors.print(
        f"{item.file}  {width}x{height}  {done.milliseconds:.1f} ms to draw, {1e3 * done.seconds:.0f} ms in all, "
        f"{done.worker}"
    )
    errors.say(*done.doubts)
