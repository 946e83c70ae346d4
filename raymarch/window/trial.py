"""The trial of a scene file in a separate process, before the window loads it.

Whatever a scene file does there (loop for ever, exit Python, exhaust memory, crash a library, hang a driver), the
window survives, and the trial can be killed. After a successful trial the driver's shader cache on disk has the
compiled programs, so the window compiles the same text in a few milliseconds.

The process reads requests and writes answers as lines of JSON. On Linux it forks for each request, so that a trial
starts in milliseconds with all modules loaded; elsewhere (`--once`) it serves one request and ends.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import json
import os
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from raymarch.errors import DeviceError, RaymarchError, SceneError, ShaderError
from raymarch.files import may_belong, recorded
from raymarch.gpu.prepare import Prepared, prepare
from raymarch.gpu.program import Program
from raymarch.gpu.renderer import Renderer
from raymarch.plan.device import of_plain
from raymarch.plan.live_lights import LightMemory
from raymarch.scene.file import load
from raymarch.scene.scene import Scene
from raymarch.scene.studio import staged
from raymarch.sdf import box, sphere
from raymarch.window.constants import CLICKED, Constants
from raymarch.window.news import Fault, noted
from raymarch.window.pace import scaled
from raymarch.window.sent import packed, unpacked
from raymarch.window.shot import progressive

SIZE = (96, 58)
"""Scale of the picture that warms the driver's cache; `raymarch.window.pace` chooses its edges."""

FLUSHED = 0.05
"""Seconds for the driver to write its cache to disk, which it does in its own thread."""

MEMORY_SHARE = 0.5
"""Maximum fraction of the machine's memory that a scene file may use while it runs."""

Answer = dict[str, Any]


def serve(forks: bool) -> None:
    """Answer requests from the standard input until it ends; without forks, one of them."""
    _die_with_parent()
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # output of scene files must not mix with the answers

    def say(answer: Answer) -> None:
        out.write(json.dumps(answer) + "\n")
        out.flush()

    prepare(Scene(box(1).round(0.1) | sphere()))  # forks then inherit the common definitions
    for line in sys.stdin:
        request = json.loads(line)
        if not forks:
            say({"id": request["id"], "pid": os.getpid()})
            examine(request, say)
            return
        if sys.platform != "win32":
            _examine_in_fork(request, say)


if sys.platform != "win32":

    def _examine_in_fork(request: Answer, say: Callable[[Answer], None]) -> None:
        """Answer a request in a child, whose end is an answer, too."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that libraries run threads; none of them holds a lock that a trial needs
            parent = os.getpid()
            child = os.fork()
        if child == 0:
            _die_with_parent()
            if os.getppid() != parent:  # the parent died before the call took effect
                os._exit(1)
            code = 1
            try:
                examine(request, say)
                code = 0
            finally:
                os._exit(code)  # each answer was flushed
        say({"id": request["id"], "pid": child})
        status = os.waitpid(child, 0)[1]
        say({"id": request["id"], "ended": os.waitstatus_to_exitcode(status)})


def _die_with_parent() -> None:
    """On Linux, kill this process when its parent dies, even if a scene file hangs."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def examine(request: Answer, say: Callable[[Answer], None]) -> None:
    """Load, plan, compile and draw a scene file once, and report the result.

    Answers {"id", "ok", "ms": {stage: milliseconds}, "files": [...], "error": {...} or None, "baked", "packed",
    "words"}: `files` are the user's that were read, `error` says what, legal, file and line, `baked` that no number may
    be a uniform, `packed` is the scene, see `raymarch.window.sent`, `words` are warnings. A request with "packed" and
    the "read" files is about that scene.
    """
    number, scene = request["id"], request["scene"]
    sys.stdin = open(os.devnull)  # noqa: SIM115 - the requests are not for the scene file
    if sys.platform != "win32" and request.get("trace"):
        trace = open(request["trace"], "a")  # noqa: SIM115  (stays open for the signal)
        faulthandler.register(signal.SIGUSR1, trace, all_threads=False)
    say({"id": number, "begun": True})
    times: dict[str, float] = {}
    error: Fault | None = None
    found: Scene | None = None
    baked, sent = False, None
    with recorded() as read, noted() as words:
        read.update(dict.fromkeys(request.get("read", ())))
        try:
            with _limited_memory(), _timed(times, "import"):
                base = unpacked(request.get("packed"), Scene) or staged(load(scene))
            found, sent = progressive(base), None if request.get("packed") else packed(base)
            size, device = tuple(request["size"]), of_plain(request.get("device"))
            with _timed(times, "plan"):
                lights = unpacked(request.get("lights"), LightMemory) or LightMemory()
                made = prepare(found, size=size, device=device, live=lights.fit(found, scene, device.prices))
                ready, fresh = Constants(request["constants"]).fit(made)
            if fresh:
                with _timed(times, "compile"):
                    baked = _compiled(found, ready, size, request["params"])
        except RaymarchError as fault:
            error = Fault.of(fault)
        except MemoryError as fault:
            error = Fault(f"out of memory: {fault}", "a smaller scene", scene, 1)
        except Exception as fault:
            traceback.print_exc()
            error = Fault(f"a fault of raymarch: {type(fault).__name__}: {fault}")
    main = Path(scene).absolute()
    inputs = (f for f in read if may_belong(f) and (os.path.isfile(f) or _is_missing(Path(f), main)))
    files = sorted({str(main), *inputs})  # a missing file may appear beside the scene
    described = None if error is None else asdict(error)
    told = {"ok": error is None, "ms": times, "files": files, "error": described, "baked": baked, "packed": sent}
    told["words"] = words
    say({"id": number, **told})
    if error is None and found is not None:
        with contextlib.suppress(RaymarchError):  # so that a click does not wait for the compiler
            ready, fresh = Constants(request["clicks"]).fit(prepare(found, CLICKED, size, device))
            if fresh:
                _warm(found, ready, size, {}, CLICKED)
            rows = lights.next_rows(found, scene, device.prices)
            if rows is not None:  # so that a light that comes or goes does not wait for it either
                _warm(found, prepare(found, size=size, device=device, live=rows), size, request["params"])


def _is_missing(file: Path, scene: Path) -> bool:
    """True for a file beside the scene that is not there, and may appear."""
    return file.parent == scene.parent and not file.exists()


def _compiled(scene: Scene, ready: Prepared, size: tuple[int, int], params: dict[str, Any]) -> bool:
    """Compile and draw a scene; True if its numbers must be baked for that. ShaderError if that does not help."""
    try:
        _warm(scene, ready, size, params)
    except ShaderError:
        if not any(ready.constants.values()):
            raise
        baked = prepare(scene, size=size, device=ready.plan.device, live=ready.plan.live)
        _warm(scene, baked, size, params)
        return True
    return False


def _warm(
    scene: Scene, ready: Prepared, size: tuple[int, int], params: dict[str, Any], outputs: tuple[str, ...] = ("color",)
) -> None:
    """Draw a small picture off screen; none where there is no such context: then the window compiles by itself."""
    scales = tuple(level.scale for level in ready.plan.marching.schedule.levels)
    try:
        renderer = Renderer(scaled(SIZE, 0.9, scales))
    except DeviceError:
        return
    renderer.planned_for = size
    renderer.adopt(scene, ready, outputs)
    try:
        known = {name: value for name, value in params.items() if name in ready.plan.parameters}
        _draw(renderer, scene, known, outputs)
    except SceneError:  # a kept value outside the new range is the window's to mend
        _draw(renderer, scene, {}, outputs)
    time.sleep(FLUSHED)


def _draw(renderer: Renderer, scene: Scene, params: dict[str, Any], outputs: tuple[str, ...]) -> None:
    """Draw each pass once, each with a program of its own.

    Mesa's software renderer compiles a program for each kind of texture that it is drawn with, and the first such
    compilation changes how the next ones are named in its cache on disk: only the first is found again by others.
    """
    ready = renderer.prepared(scene, outputs)
    for call in renderer.draw_calls(scene, params=params, outputs=outputs):
        text = ready.texts[call.chosen.name]
        with Program(renderer.context, ready.vertex, text, ready.shader.locate, call.chosen.name) as fresh:
            fresh.draw(call.target, call.uniforms)
    renderer.context.finish()


@contextlib.contextmanager
def _timed(times: dict[str, float], name: str) -> Iterator[None]:
    """Record the time of a block in milliseconds."""
    start = time.perf_counter()
    try:
        yield
    finally:
        times[name] = 1e3 * (time.perf_counter() - start)


@contextlib.contextmanager
def _limited_memory() -> Iterator[None]:
    """Limit memory while a scene file runs; the compiler afterwards has no limit."""
    if sys.platform != "linux":
        yield
    else:
        import resource

        most = int(MEMORY_SHARE * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        before = resource.getrlimit(resource.RLIMIT_DATA)
        hard = before[1]
        resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, before)


if __name__ == "__main__":
    serve(forks="--once" not in sys.argv[1:])
