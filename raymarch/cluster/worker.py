"""What a worker does: it keeps an OpenGL context, its programs and the scenes, and draws one picture at a time."""

from __future__ import annotations

import faulthandler
import os
import sys
import tempfile
import threading
import time as clock_time
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.cluster.machines import Machine, libraries
from raymarch.cluster.source import Source, without_folder
from raymarch.errors import DeviceError, Doubt, RaymarchError, RenderWarning, SceneError
from raymarch.export.sequence import Contents, Item
from raymarch.export.stills import Shot, draw, encoder, key_of, package, save, view_of
from raymarch.gpu.renderer import Renderer
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene
from raymarch.scene.studio import staged

SCENES = 4
"""Number of scenes that a worker keeps."""

ELSEWHERE = 0.5
"""Seconds that a worker waits before it returns a task that it may not draw, so that another worker takes it."""


@dataclass(frozen=True, slots=True)
class Job:
    """What the tasks of a film have in common.

    quality : of the scene. shot : what to draw.
    backend, device : of the OpenGL context; None is the worker's variable RAYMARCH_EGL_DEVICE.
    machines : kinds of workers that may draw. timeout : seconds after which a worker that still draws ends itself.
    """

    quality: Quality
    shot: Shot
    backend: str
    device: int | None
    machines: tuple[Machine, ...]
    timeout: float


@dataclass(frozen=True, slots=True)
class Work:
    """What a worker did for a picture.

    milliseconds : to draw, by the renderer's clock. seconds : of the whole task. worker : its address.
    doubts : reasons to doubt the picture.
    """

    milliseconds: float
    seconds: float
    worker: str
    doubts: Sequence[Doubt]


@dataclass(frozen=True, slots=True)
class Done(Work):
    """A picture: the content of its file."""

    content: bytes


@dataclass(frozen=True, slots=True)
class Share(Work):
    """A mean of some samples per pixel: float32 (H, W, 3), of `count` samples."""

    color: NDArray[np.float32]
    count: int


@dataclass(frozen=True, slots=True)
class Refused:
    """A picture that the scene cannot draw, on any worker: the message of the error, with file and line."""

    message: str
    worker: str = ""

    @classmethod
    def by(cls, fault: RaymarchError) -> Refused:
        """Of an error on this worker."""
        return cls(without_folder(str(fault)), address())


class _State:
    """What a worker process keeps between tasks."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.renderer: Renderer | None = None
        self.opened: tuple[str, int | None] | None = None
        self.scenes: OrderedDict[tuple[str, str], Scene] = OrderedDict()

    def renderer_for(self, backend: str, device: int | None, size: tuple[int, int]) -> Renderer:
        if self.renderer is None or self.opened != (backend, device):
            self.close()
            self.renderer, self.opened = Renderer(size, backend, device), (backend, device)
            # All workers draw by one plan, whatever was measured on the driver of one of them.
            alone = self.renderer.context.driver.class_alone
            self.renderer.context.device = self.renderer.resources.device = alone
        if self.renderer.size != size:
            self.renderer.resize(size)
        return self.renderer

    def scene(self, source: Source, quality: Quality) -> Scene:
        key = source.digest, repr(quality)
        if key not in self.scenes:
            self.scenes[key] = staged(source.scene()).replace(quality=quality)
            while len(self.scenes) > SCENES:
                self.scenes.popitem(last=False)
        self.scenes.move_to_end(key)
        return self.scenes[key]

    def close(self) -> None:
        if self.renderer is not None:
            with suppress(Exception):  # the device may be lost
                self.renderer.close()
        self.renderer = self.opened = None


STATE = _State()


def address() -> str:
    from distributed import get_worker

    return str(get_worker().address)


def describe(backend: str, device: int | None) -> Machine | str:
    """The versions and the driver of this worker, or the reason why it cannot draw."""
    with STATE.lock:
        try:
            renderer = STATE.renderer_for(backend, device, (16, 16))
        except RaymarchError as fault:
            return str(fault)
        return Machine(package(), libraries(), renderer.context.driver)


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """End this process if the block takes longer, also if it hangs in the driver: its nanny then starts another one.

    Dask has no time limit of its own for tasks.
    """
    with open(os.devnull, "w") as nowhere:  # for a process without a stream of errors
        faulthandler.dump_traceback_later(seconds, exit=True, file=sys.__stderr__ or sys.stderr or nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


@contextmanager
def drawing(job: Job, size: tuple[int, int], timeout: float) -> Iterator[Renderer]:
    """This worker's renderer at a size. Other tasks of this process wait.

    A worker of another kind than the job accepts gives the task back to Dask. A fault of the device closes the context
    and is raised as a RuntimeError, so that Dask tries the task again.
    """
    with STATE.lock, limited(timeout), warnings.catch_warnings():
        warnings.simplefilter("ignore", RenderWarning)  # reported as doubts
        try:
            renderer = STATE.renderer_for(job.backend, job.device, size)
            if Machine(package(), libraries(), renderer.context.driver) not in job.machines:
                from distributed import Reschedule

                clock_time.sleep(ELSEWHERE)
                raise Reschedule
            yield renderer
        except DeviceError as fault:
            STATE.close()  # the next task opens another context
            raise RuntimeError(f"the device failed: {fault}") from None


def draw_item(source: Source, job: Job, item: Item, content: str | None) -> Done | Share | Refused:
    """Draw a picture, a tile, or a share of the samples.

    content : the hash that the picture must have (`stills.content_of`), so that a scene that is not the same on all
    machines is refused. None is not compared.
    """
    start = clock_time.perf_counter()
    try:
        with drawing(job, item.size, job.timeout) as renderer:
            scene = STATE.scene(source, job.quality)
            _compare(renderer, scene, job.shot, item, content)
            frame, doubts = draw(renderer, scene, job.shot, item.time, item.part)
            if item.part is not None and item.part.samples is not None:
                first, end = item.part.samples
                spent = clock_time.perf_counter() - start
                return Share(frame.milliseconds, spent, address(), doubts, frame.color, end - first)
            key, view = key_of(content, renderer.context.driver), view_of(frame, job.shot.view, scene)
            made = _content(job.shot, encoder(job.shot, renderer, scene, frame, view, key))
            return Done(frame.milliseconds, clock_time.perf_counter() - start, address(), doubts, made)
    except RaymarchError as fault:
        return Refused.by(fault)


def _content(shot: Shot, write: Callable[[Path], object]) -> bytes:
    """What a function writes into a file with the suffix of a picture."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"picture{shot.suffix}"
        write(file)
        return file.read_bytes()


def draw_batch(source: Source, job: Job, pictures: Sequence[tuple[Item, str | None]]) -> list[Done | Share | Refused]:
    """`draw_item` for several pictures: one task costs the scheduler as much as a task of one picture."""
    return [draw_item(source, job, item, content) for item, content in pictures]


def _compare(renderer: Renderer, scene: Scene, shot: Shot, item: Item, content: str | None) -> None:
    """SceneError if a picture of this scene is not the one that the client submitted."""
    if content is not None and Contents(scene, shot, renderer).of(item) != content:
        what = "the scene is not the same on this worker"
        legal = "a scene file that makes the same scene each time: seed random numbers, read no clock"
        raise SceneError(what, legal=legal, where=scene.where)


def merge(source: Source, job: Job, content: str | None, *shares: Share | Refused) -> Done | Refused:
    """A picture of the shares of its samples, added in their order in float64. Does not draw."""
    start = clock_time.perf_counter()
    total: NDArray[np.float64] | float = 0.0
    count = 0
    for share in shares:
        if isinstance(share, Refused):
            return share
        total, count = total + share.color.astype(np.float64) * share.count, count + share.count
    with STATE.lock:
        scene = STATE.scene(source, job.quality)
    color = np.asarray(total / count, np.float32)
    image = Image.fromarray(scene.tone.image(color))
    key = key_of(content, job.machines[0].driver)
    made = _content(job.shot, lambda file: save(image, file, job.shot.suffix, key))
    drawn = [share for share in shares if isinstance(share, Share)]
    spent = clock_time.perf_counter() - start + sum(share.seconds for share in drawn)
    doubts = list(dict.fromkeys(doubt for share in drawn for doubt in share.doubts))
    return Done(sum(share.milliseconds for share in drawn), spent, address(), doubts, made)
