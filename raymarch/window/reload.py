"""Live reload: watches a scene file, tests it in another process, and loads it here if the trial succeeds."""

from __future__ import annotations

import contextlib
import io
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from queue import SimpleQueue
from types import FrameType
from typing import TYPE_CHECKING, Any

from raymarch.errors import Location, RaymarchError, SceneError, is_users
from raymarch.gpu.prepare import prepare
from raymarch.plan.device import SOFTWARE, DeviceClass, as_plain
from raymarch.plan.live_lights import LightMemory
from raymarch.scene.file import load
from raymarch.scene.scene import Scene
from raymarch.scene.studio import staged
from raymarch.window.constants import Constants
from raymarch.window.news import Failed, Fault, Loaded, News, Started, Watching
from raymarch.window.sent import packed, unpacked
from raymarch.window.shot import progressive
from raymarch.window.trials import Answer, Trials
from raymarch.window.watch import Watch

if TYPE_CHECKING:
    from _typeshed import TraceFunction

PATIENCE = 60.0
"""Time limit of a trial in seconds. Large scenes may compile for a while."""

HERE_AT_LEAST = 5.0
HERE_FACTOR = 20.0
"""Time limits of loading what a trial could not send: seconds, and a multiple of the time of the trial."""


class Reloader:
    """Watches a scene file and all files that it reads, in its own threads, and reports changes to the window.

    file : the scene file.
    wake : called after each event, from another thread.
    params : returns the window's current values of parameters.
    size : size of the pictures for which scenes are planned.
    constants, clicks : the constants of the shaders of the picture, and of those for clicks.
    device : the class of devices that draw.
    """

    def __init__(
        self,
        file: Path,
        wake: Callable[[], None],
        params: Callable[[], dict[str, Any]],
        size: tuple[int, int],
        constants: Constants,
        clicks: Constants,
        device: DeviceClass = SOFTWARE,
    ) -> None:
        self.file, self.size, self.device = file, size, device
        self.news: SimpleQueue[News] = SimpleQueue()
        self.busy_since: float | None = None
        self._wake, self._params = wake, params
        self._constants, self._clicks = constants, clicks
        self._lights = LightMemory()
        self._silent = False
        self._changed, self._stopping, self._interrupted = threading.Event(), threading.Event(), threading.Event()
        self._trials = Trials()
        self._watch = Watch(self._changed.set)
        self._watch.files([str(file.absolute())])
        self._known: list[str] = []
        self._known_for = file
        self._first: dict[str, Any] = {}
        self._compile = False
        self._thread = threading.Thread(target=self._work, name="reload", daemon=True)

    def start(self, scene: Scene, read: Iterable[str], compile: bool = False) -> None:
        """Start watching. A first trial of the loaded scene warms the shader of clicks.

        read : the files that were read when it was loaded. compile : whether the trial compiles the scene, which is
        then reported as a change is.
        """
        self._first, self._compile = {"packed": packed(scene), "read": list(read)}, compile
        self._lights.fit(progressive(scene), str(self.file), self.device.prices)
        self._watch.start()
        self._thread.start()

    def reload(self) -> None:
        """Reload, even without a change."""
        self._changed.set()

    def open(self, file: Path) -> None:
        """Switch to another scene file."""
        self.file = file
        self._watch.files([str(file.absolute())])
        self._changed.set()

    def interrupt(self) -> None:
        """Stop the running trial of a change; it is reported as failed, with the line that it was executing."""
        if self.busy_since is not None and not self._silent:
            self._interrupted.set()

    def stop(self) -> None:
        """End all threads and processes."""
        self._stopping.set()
        self._changed.set()
        self._watch.stop()
        if self._thread.is_alive():
            self._thread.join(5)
        self._trials.close()

    def latest(self) -> list[News]:
        """The events since the last call."""
        return [self.news.get() for _ in range(self.news.qsize())]

    def _tell(self, news: News) -> None:
        self.news.put(news)
        self._wake()

    def _work(self) -> None:
        first = True
        while True:
            if not first:
                self._changed.wait()
            self._changed.clear()
            if self._stopping.is_set():
                return
            try:
                self._once(silent=first and not self._compile, first=first)
            except Exception as fault:  # an internal error must not stop live reload
                self._tell(Failed(Fault(f"a fault of raymarch: {type(fault).__name__}: {fault}")))
            finally:
                self.busy_since = None
            first = False

    def _once(self, silent: bool, first: bool) -> None:
        """Run one trial and handle its result; `silent` for the scene that is already visible, `first` for the one that
        the window loaded."""
        self._interrupted.clear()
        self._silent = silent
        self.busy_since = time.monotonic()
        if not silent:
            self._tell(Started(self.file))
        file = self.file
        known = {"constants": self._constants.as_json(), "clicks": self._clicks.as_json()}
        lights = None if first else packed(self._lights)
        if lights is None and not first:
            self._lights = LightMemory()  # as the trial has it
        known |= {"device": as_plain(self.device), "lights": lights} | (self._first if first else {})
        answer = self._trials.run(str(file), self._params(), self.size, known, self._over)
        if answer is None or self._stopping.is_set():
            return  # a newer change
        kept = self._known if answer["error"] is not None and file == self._known_for else []
        self._known, self._known_for = [*kept, *answer["files"]], file
        self._watch.files([str(file.absolute()), *self._known])
        if answer["error"] is not None:
            self._tell(Failed(Fault.read(answer["error"])))
        elif silent:
            self._tell(Watching(tuple(self._known)))
        else:
            self._load_here(file, {**answer, "packed": answer["packed"] or known.get("packed")})

    def _over(self) -> str | None:
        """The reason to end the running trial; None to continue."""
        if self._changed.is_set() or self._stopping.is_set():
            return "changed"
        waited = time.monotonic() - (self.busy_since or time.monotonic())
        if self._interrupted.is_set() or waited > PATIENCE:
            return f"stopped after {waited:.0f} s"
        return None

    def _load_here(self, file: Path, answer: Answer) -> None:
        start = time.perf_counter()
        try:
            scene = unpacked(answer["packed"], Scene)
            if scene is None:
                took = sum(answer["ms"].values()) * 1e-3
                scene = _loaded(file, max(HERE_AT_LEAST, HERE_FACTOR * took))
            middle = time.perf_counter()
            drawn = progressive(scene)
            live = self._lights.fit(drawn, str(file), self.device.prices)
            prepared = prepare(drawn, size=self.size, device=self.device, live=live)
        except RaymarchError as fault:
            self._tell(Failed(Fault.of(fault)))
            return
        if answer["baked"]:
            self._constants.forget()
        prepared, _ = self._constants.fit(prepared)
        ms = {"import": 1e3 * (middle - start), "plan": 1e3 * (time.perf_counter() - middle)}
        trial = {f"trial {name}": spent for name, spent in answer["ms"].items()}
        self._tell(Loaded(scene, prepared, file, {**trial, **ms}, tuple(answer.get("words", ()))))


class _TooLong(BaseException):
    """Raised at a line of the user that is executed after a time limit."""


def _loaded(file: Path, seconds: float) -> Scene:
    """The scene of a file that a trial loaded but could not send; SceneError if it takes longer than some seconds.

    It is loaded in a thread of its own, which looks at the clock at each line of the user and ends there.
    """
    found: list[Scene | BaseException] = []
    until = time.monotonic() + seconds
    last = Location(str(file), 1)

    def at_line(frame: FrameType, event: str, _: Any) -> TraceFunction | None:
        nonlocal last
        last = Location(frame.f_code.co_filename, frame.f_lineno)
        if time.monotonic() > until:
            raise _TooLong
        return at_line

    def run() -> None:
        sys.settrace(lambda frame, *_: at_line if is_users(frame.f_code.co_filename) else None)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # the trial has printed it already
                found.append(staged(load(file)))
        except BaseException as fault:
            found.append(fault)

    thread = threading.Thread(target=run, name="load", daemon=True)
    thread.start()
    thread.join(seconds + 1.0)
    if not found or isinstance(found[0], _TooLong):
        raise SceneError("the scene file did not end, although its trial did", where=last)
    if isinstance(found[0], RaymarchError):
        raise found[0]
    if isinstance(found[0], BaseException):
        raise SceneError(f"{type(found[0]).__name__}: {found[0]}", where=last)
    return found[0]
