"""Films, sequences and large pictures on the workers of a cluster."""

from __future__ import annotations

import os
import statistics
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import islice, pairwise
from operator import length_hint
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from raymarch.cluster.source import Source, of_file, of_scene
from raymarch.cluster.submit import RETRIES, TIMEOUT, Cluster, Failed, Options
from raymarch.cluster.worker import Done, Refused, draw_batch, draw_item, merge
from raymarch.errors import ClusterError, RaymarchError, RenderWarning, SceneError, warn
from raymarch.export import png, stills
from raymarch.export.behind import in_order
from raymarch.export.film import FILMS
from raymarch.export.sequence import Contents, Item, Parts, Placed, Runner, frames_of, join_film
from raymarch.export.stills import Shot
from raymarch.expr.calls import checked
from raymarch.expr.convert import instance, integer, optional, real, short, switch
from raymarch.files import check_apart, import_optional, write, written
from raymarch.gpu.driver import Driver
from raymarch.gpu.part import PicturePart
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.views import VIEWS
from raymarch.scene.parameter import ParamValue
from raymarch.scene.scene import Scene, check_scene
from raymarch.scene.studio import staged

T = TypeVar("T")

TASK = 0.2
"""Seconds of a task of short pictures. A task costs scheduler, client and worker some milliseconds."""

LARGEST_BATCH = 32
"""Pictures of such a task at most."""


Outcome = Done | Refused | Failed | None
"""What became of a picture; None if it was drawn before."""


def draw_items(
    cluster: Cluster[Any],
    source: Source,
    scene: Scene,
    shot: Shot,
    items: Iterable[Item],
    options: Options,
    tell: Callable[[str], None],
    error: type[RaymarchError] = ClusterError,
    parts: Parts | None = None,
) -> Iterator[tuple[Item, Outcome]]:
    """Draw what is missing, write each picture under its name when it arrives, and yield it with its outcome.

    parts : names the files, if the pictures are parts of a film or of a picture.
    scene : of the source, with the quality to use. tell : called with notes. Raises ClusterError before anything is
    drawn if the scene, the options or the workers do not allow it.
    """
    check(scene, shot, options)
    tasks = _Tasks(cluster, source, scene, shot, options, tell, parts)
    missing = tasks.missing(items, length_hint(items, LARGEST_BATCH))
    for batch, result in cluster.completed(_batches(missing, tasks.batch_size), tasks.start):
        outcomes = result if isinstance(result, list) else [result] * len(batch)
        for (_, item, _), outcome in zip(batch, outcomes, strict=True):
            if isinstance(outcome, Done):
                with written(item.file, error) as unfinished:
                    unfinished.write_bytes(outcome.content)
                cluster.log.pictures[outcome.worker] += 1
                cluster.log.seconds[outcome.worker] += outcome.seconds
                tasks.recent.append(outcome.seconds)
            yield item, outcome
        while tasks.settled:
            yield tasks.settled.pop(0)
    yield from tasks.settled


Numbered: TypeAlias = tuple[int, Item, str | None]
"""The number of a picture, the picture, and the hash of its content."""


class _Tasks:
    """The tasks of the pictures that are missing.

    settled : pictures that need none, with their outcome. recent : seconds of the last pictures.
    """

    def __init__(
        self,
        cluster: Cluster[Any],
        source: Source,
        scene: Scene,
        shot: Shot,
        options: Options,
        tell: Callable[[str], None],
        parts: Parts | None,
    ) -> None:
        self.settled: list[tuple[Item, Outcome]] = []
        self.recent: deque[float] = deque(maxlen=9)
        self._cluster, self._options, self._parts = cluster, options, parts
        self._samples, self._contents = scene.quality.samples, Contents(scene, shot)
        self._job = cluster.job(scene.quality, shot, options, tell)
        self._sent, self._run, self._left = cluster.send(source), uuid.uuid4().hex[:8], 0

    def missing(self, items: Iterable[Item], number: int) -> Iterator[Numbered]:
        """The pictures to draw. number : of the items, about."""
        drivers, self._left = [machine.driver for machine in self._job.machines], number
        for k, item in enumerate(items):
            self._left -= 1
            try:
                placed = self._contents.place(item, drivers, self._parts, shares=self._options.split)
            except RaymarchError as fault:
                self.settled.append((item, Refused(str(fault))))
                continue
            if placed.whole:
                self.settled.append((placed.item, None))
            else:
                yield k, placed.item, placed.content

    def batch_size(self) -> int:
        """The number of pictures of the next task."""
        if self._options.split > 1 or (self._options.batch is None and not self.recent):
            return 1
        if self._options.batch is not None:
            return self._options.batch
        threads, left = self._cluster.threads, self._left
        fair = left // (2 * threads) if left > 0 else 1  # so that all workers end at about the same time
        return max(1, min(int(TASK / max(statistics.median(self.recent), 1e-3)), LARGEST_BATCH, fair))

    def start(self, batch: Sequence[Numbered]) -> Any:
        """Submit the task of some pictures, or the tasks of the shares of one."""
        number, item, content = batch[0]
        name, submit = f"raymarch-draw-{self._run}-{number}", self._cluster.client.submit
        how: dict[str, Any] = {"retries": RETRIES, "resources": self._cluster.resources, "priority": -number}
        if self._options.split == 1:
            return submit(draw_batch, self._sent, self._job, [picture for _, *picture in batch], key=name, **how)
        shares = []
        for k, share in enumerate(shares_of(self._samples, self._options.split)):
            part = item.part or PicturePart(item.size)
            one = replace(item, part=replace(part, samples=share))
            given = self._sent, self._job, one, self._contents.of(one)
            shares.append(submit(draw_item, *given, key=f"{name}-{k}", **how))
        return submit(merge, self._sent, self._job, content, *shares, key=f"{name}-all", **how)


def _batches(units: Iterable[T], size: Callable[[], int]) -> Iterator[list[T]]:
    """Lists of as many units as `size` says then; the last one may be shorter."""
    left = iter(units)
    while batch := list(islice(left, size())):
        yield batch


def check(scene: Scene, shot: Shot, options: Options) -> None:
    """ClusterError for what a cluster does not draw."""
    quality = scene.quality
    if quality.temporal != "off":
        what = f"Quality(temporal={quality.temporal!r}) on a cluster: each frame depends on earlier ones"
        raise ClusterError(what, legal="temporal='off'", where=scene.where)
    if shot.view not in VIEWS:
        raise ClusterError(f"--view {shot.view} on a cluster", legal=", ".join(VIEWS))
    if options.split > quality.samples:
        raise ClusterError(f"{quality.samples} samples in {options.split} shares", legal="at most one share a sample")
    if options.split > 1 and (shot.view != "final" or shot.alpha or shot.suffix not in stills.FORMATS):
        raise ClusterError("shares of samples of this output", legal="the final picture, in 8 bits, without alpha")


def drawn_before(
    scene: Scene, shot: Shot, items: Sequence[Item], options: Options, parts: Parts | None
) -> tuple[list[Item], Driver] | None:
    """All pictures with their files, and the driver of this machine, if it has drawn each of them, whole; else None.

    Local workers have this driver, so that they need not start then.
    """
    contents = Contents(scene, shot)

    def places(*drivers: Driver) -> Iterator[Placed]:  # a frame that is missing is likely one of the last
        return (contents.place(item, drivers, parts, shares=options.split) for item in reversed(items))

    try:
        if not all(placed.item.file.is_file() for placed in places()):
            return None
        with Renderer((16, 16), options.backend, options.device) as renderer:
            driver = renderer.context.driver
    except RaymarchError:  # the workers tell
        return None
    found = list(places(driver))
    return ([placed.item for placed in found[::-1]], driver) if all(placed.whole for placed in found) else None


def shares_of(samples: int, number: int) -> list[tuple[int, int]]:
    """The (first, end) of each share of the samples of a pixel."""
    return list(pairwise(samples * k // number for k in range(number + 1)))


@checked
def render_frames(
    scene: Scene | str | os.PathLike[str],
    frames: Iterable[int],
    fps: float = 30.0,
    size: tuple[int, int] = (640, 360),
    out: str | os.PathLike[str] = "frame_{:04d}.png",
    client: Any = None,
    params: Mapping[str, ParamValue] | None = None,
    alpha: bool = False,
    strict: bool = False,
    resources: Mapping[str, float] | None = None,
    mixed_drivers: bool = False,
    split_samples: int = 1,
    batch: int | None = None,
    task_timeout: float = TIMEOUT,
    backend: str = "auto",
    device: int | None = None,
) -> list[Path]:
    """Render frames of a scene to a film or to numbered pictures, here or on the workers of a Dask cluster.

    Frame i shows the time i / fps. PNG files and the frames of a film that are already there, whole, are not drawn
    again. With a client, the bytes are the same as without one.

    Parameters
    ----------
    scene : a Scene, or the path of a scene file. A Scene with your own definitions can be sent to workers only if they
        can import the module of the definitions; a file is sent with all files that it reads.
    frames : numbers of the frames, such as range(0, 90).
    fps : frames per second, above 0.
    size : (width, height) in pixels.
    out : a film (.mp4, .webm, .gif), or a name with a field for the number, "frame_{:04d}.png".
    client : a `distributed.Client`; None draws in this process.
    params : values of parameters by name.
    alpha : make the sky transparent.
    strict : refuse a frame that has doubts, see `Frame.doubts`.
    resources : Dask resources that a worker must have, such as {"GPU": 1}.
    mixed_drivers : accept workers whose drivers may differ in the last bit.
    split_samples : number of tasks that share the samples of each pixel, from 1 to the samples.
    batch : frames of one task. None: as many as take a fifth of a second, up to 32.
    task_timeout : seconds after which a worker that still draws a frame ends itself, and another one draws it.
    backend, device : as in `Renderer`.

    Returns
    -------
    The paths of the pictures, or of the film.

    Raises
    ------
    SceneError : an unknown format, a scene file that is wrong, or a picture that would replace a file which the scene
        reads.
    ClusterError : the workers cannot be used, or frames could not be drawn. All other frames are then written.
    """
    numbers = [integer("render_frames: frames", number, 0, 10**9) for number in _several("frames", frames)]
    if not numbers:
        raise SceneError("render_frames: no frames", legal="numbers >= 0, such as range(0, 90)")
    fps = real("render_frames: fps", fps, 1e-9, 1e9, "a number > 0")
    edges = [integer("render_frames: size", edge, 1, 1 << 20) for edge in _several("size", size)]
    if len(edges) != 2:
        raise SceneError(f"render_frames: size = {short(size)}", legal="(width, height) in pixels")
    width, height = edges
    instance("render_frames: scene", scene, Scene | str | os.PathLike, "a Scene, or the path of a scene file")
    instance("render_frames: out", out, str | os.PathLike, "a path")
    instance("render_frames: params", params, Mapping | None, "a dict of values by name, or None")
    target = Path(out)
    items = frames_of(target, numbers, fps, (width, height))
    source, made = (None, scene) if isinstance(scene, Scene) else of_file(scene)
    check_apart(None if source is None else source.files, (target, *(item.file for item in items)))
    suffix = target.suffix.lower()
    alpha, strict = switch("render_frames: alpha", alpha), switch("render_frames: strict", strict)
    form, level = (".png", png.DRAFT) if suffix in FILMS else (suffix, png.FRAME)
    shot = Shot((width, height), form, dict(params or {}), alpha=alpha, strict=strict, level=level)
    with Parts(items, target) if suffix in FILMS else nullcontext() as parts:
        outcomes: Iterable[tuple[Item, Outcome]]
        if client is None:
            outcomes = _draw_here(made if source is None else staged(made), shot, items, backend, device, parts)
        else:
            distributed = import_optional("render_frames with a client", "distributed", "cluster", ClusterError)
            instance("render_frames: client", client, distributed.Client, "a distributed.Client, or None")
            source, made = source or of_scene(made), staged(made)
            split = integer("render_frames: split_samples", split_samples, 1, 4096)
            timeout = real("render_frames: task_timeout", task_timeout, 1.0, 1e9, "seconds >= 1")
            together = optional(integer, "render_frames: batch", batch, 1, 10**6)
            options = Options(mixed_drivers, split, together, timeout, backend, device)
            cluster: Cluster[Any] = Cluster(client, resources)
            outcomes = draw_items(cluster, source, made, shot, items, options, warnings.warn, parts=parts)
        failed = [(item, outcome) for item, outcome in outcomes if isinstance(outcome, Refused | Failed)]
        if failed:
            raise ClusterError("; ".join(failures(failed)))
        if parts is None:
            return [item.file for item in items]
        join_film(target, parts.all(items), fps)
        if note := parts.finish():
            warn(note)
    return [target]


def _several(name: str, values: Any) -> list[Any]:
    """The elements of an argument. SceneError if it is not iterable."""
    try:
        return list(values)
    except Exception:
        raise SceneError(f"render_frames: {name} = {short(values)}", legal="several integers") from None


def failures(failed: Sequence[tuple[Item, Refused | Failed]]) -> list[str]:
    """One sentence for each error, with the first picture that it concerns and the number of others."""
    by_message: dict[str, list[Item]] = {}
    for item, outcome in failed:
        by_message.setdefault(outcome.message, []).append(item)
    lines = []
    for message, items in by_message.items():
        more = f" and {len(items) - 1} more" if len(items) > 1 else ""
        lines.append(f"{items[0].name}{more} cannot be drawn: {message}")
    return lines


def _draw_here(
    scene: Scene, shot: Shot, items: Sequence[Item], backend: str, device: int | None, parts: Parts | None
) -> Iterator[tuple[Item, Refused]]:
    """Draw what is missing in this process. Yields what could not be drawn."""
    check_scene("render_frames", scene)
    with Renderer(items[0].size, backend, device) as renderer, warnings.catch_warnings(), in_order() as later:
        warnings.simplefilter("ignore", RenderWarning)
        runner = Runner(renderer, scene, shot, parts)
        for item in items:
            try:
                item, made = runner.picture(item)
            except RaymarchError as fault:
                yield item, Refused(str(fault))
                continue
            if made is not None:
                later(partial(write, item.file, made.writer), made.writer.before)
            del made  # the next frame then reads no arrays of this one
