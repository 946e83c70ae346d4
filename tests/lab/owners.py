"""Renderers among threads, processes and contexts of other code, in random turns: each frame is right or refused.

python -m tests.lab.owners --frames 1000 [--seed 1] [--keep]

Each turn takes a renderer, a thread, a context of other code that is current meanwhile, and a scene. The frame is
compared bit for bit with the one that a process of its own drew before anything else was opened, and what was current
before must be so after it, with its picture unharmed. Some turns open processes, by fork and by spawn: a child of a
fork must refuse with the cure, a spawned one must draw. Nothing may hang: the command ends after its time limit.
"""

from __future__ import annotations

import argparse
import faulthandler
import multiprocessing
import os
import queue
import random
import select
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import DeviceError
from raymarch.gpu import current
from tests.lab.long_runs import keep

Picture = NDArray[np.float32]

SIZE = (48, 36)
LIMIT = 20.0
"""Seconds after which a process or a thread is taken to hang."""
SCENES = 3
CURE = ("spawn", "forkserver", "fork")
"""Words that a refusal after a fork has."""


def scene(k: int) -> rm.Scene:
    """With textures of data, many lights, or neither."""
    camera = rm.Camera((1.5, 1.2, 2.5), (0, 0, 0))
    if k == 0:
        return rm.Scene(rm.sphere(0.8), camera)
    if k == 1:
        return rm.Scene(rm.heightmap(np.eye(6)) | rm.box(0.5), camera)
    return rm.Scene(rm.box(0.9), camera, [rm.PointLight((0.3 * i - 2, 2, 2), intensity=0.5) for i in range(12)])


def draw_alone(k: int) -> bytes:
    """A frame, in a process that does nothing else."""
    with rm.Renderer(SIZE, "egl") as renderer:
        return renderer.render(scene(k)).color.tobytes()


def spawned(k: int, backend: str) -> tuple[str, bytes]:
    """The frame of a process that multiprocessing spawns, or what refuses it."""
    context = multiprocessing.get_context("spawn")
    mine, its = context.Pipe(duplex=False)
    child = context.Process(target=_send, args=(its, k, backend))
    child.start()
    its.close()
    try:
        if not mine.poll(3 * LIMIT):
            return "hangs", b""
        answer: tuple[str, bytes] = mine.recv()
        child.join(LIMIT)
        return answer if child.exitcode == 0 else (f"exit code {child.exitcode}", b"")
    except EOFError:
        return "died", b""
    finally:
        if child.is_alive():
            child.kill()
        child.join()


def _send(pipe: Any, k: int, backend: str) -> None:
    with rm.Renderer(SIZE, backend) as renderer:
        pipe.send(("drawn", renderer.render(scene(k)).color.tobytes()))


def forked(work: Callable[[], bytes]) -> tuple[str, bytes]:
    """What a fork of this process answers: "drawn" and a frame, "refused" and the message, or "hangs"."""
    read_end, write_end = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # that a process with threads forks: the very case
        child = os.fork()
    if child == 0:
        faulthandler.disable()
        try:
            try:
                answer = b"drawn " + work()
            except DeviceError as error:
                answer = b"refused " + str(error).encode()
            except BaseException as error:
                answer = b"failed " + repr(error).encode()
            with os.fdopen(write_end, "wb") as pipe:
                pipe.write(answer)
        finally:
            os._exit(0)
    os.close(write_end)
    data, until = b"", time.monotonic() + LIMIT
    with os.fdopen(read_end, "rb", buffering=0) as pipe:
        while time.monotonic() < until and select.select([pipe], [], [], until - time.monotonic())[0]:
            part = pipe.read(1 << 16)
            if not part:
                break
            data += part
        else:
            os.kill(child, signal.SIGKILL)
            data = b"hangs "
    os.waitpid(child, 0)
    word, _, rest = data.partition(b" ")
    return word.decode() or "died", rest


class Foreign:
    """A context of other code, made with no help of the package, that holds a picture of its own."""

    def __init__(self, name: str, gl: moderngl.Context, make_current: Callable[[], None]) -> None:
        self.name, self._gl, self.make_current = name, gl, make_current
        self._texture = gl.texture((4, 4), 4, dtype="f4")
        self._target = gl.framebuffer([self._texture])
        self.seen = current.current()

    def begin(self) -> None:
        self.make_current()
        self._target.use()
        self._target.clear(0.25, 0.5, 0.75, 1.0)

    def unharmed(self) -> bool:
        """Whether it is current still, with its framebuffer in use and its picture."""
        if current.current() != self.seen or self._gl.fbo is not self._target:
            return False
        texels = np.frombuffer(self._target.read(components=4, dtype="f4"), np.float32)
        return bool(np.all(texels.reshape(-1, 4) == np.array((0.25, 0.5, 0.75, 1.0), np.float32)))


@contextmanager
def nothing_current() -> Iterator[None]:
    current.unbind()
    yield
    current.unbind()


def foreigners(display: str | None) -> list[Foreign]:
    """moderngl on EGL; with a display a window of glfw and moderngl on X; pygame where it is installed."""
    made: list[Foreign] = []
    with nothing_current():
        settings: dict[str, Any] = {"backend": "egl"}
        egl = moderngl.create_context(require=330, standalone=True, **settings)
        made.append(Foreign("moderngl on EGL", egl, egl.__enter__))
    if display is None:
        return made
    os.environ["DISPLAY"] = display
    with nothing_current():
        x11 = moderngl.create_context(require=330, standalone=True)
        made.append(Foreign("moderngl on X", x11, x11.__enter__))
    with nothing_current():
        import glfw

        glfw.init()
        for hint, value in (
            (glfw.CONTEXT_VERSION_MAJOR, 3),
            (glfw.CONTEXT_VERSION_MINOR, 3),
            (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        ):
            glfw.window_hint(hint, value)
        window = glfw.create_window(32, 32, "theirs", None, None)
        glfw.make_context_current(window)
        made.append(Foreign("glfw", moderngl.create_context(), lambda: glfw.make_context_current(window)))
    try:
        import pygame
    except ImportError:
        return made
    with nothing_current():
        pygame.display.init()
        pygame.display.gl_set_attribute(pygame.GL_CONTEXT_MAJOR_VERSION, 3)
        pygame.display.gl_set_attribute(pygame.GL_CONTEXT_MINOR_VERSION, 3)
        pygame.display.gl_set_attribute(pygame.GL_CONTEXT_PROFILE_MASK, pygame.GL_CONTEXT_PROFILE_CORE)
        pygame.display.set_mode((32, 32), pygame.OPENGL | pygame.DOUBLEBUF)
        (its,) = current.current()
        made.append(Foreign("pygame", moderngl.create_context(), lambda: current.bind((its,))))
    return made


class Worker:
    """A thread that does what it is given."""

    def __init__(self) -> None:
        self._tasks: queue.Queue[Callable[[], None] | None] = queue.Queue()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            task()

    def start(self, work: Callable[[], Any]) -> queue.Queue[Any]:
        answer: queue.Queue[Any] = queue.Queue()

        def task() -> None:
            try:
                answer.put(work())
            except BaseException as error:
                answer.put(error)

        self._tasks.put(task)
        return answer

    def end(self) -> None:
        self._tasks.put(None)
        self._thread.join(LIMIT)


@dataclass
class Count:
    """How many frames were drawn, by whom, and what was wrong with any."""

    frames: int = 0
    refused: int = 0
    kinds: dict[str, int] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def see(self, kind: str, answer: Any, right: bytes) -> None:
        self.frames += 1
        self.kinds[kind] = self.kinds.get(kind, 0) + 1
        if not isinstance(answer, bytes):
            self.faults.append(f"{kind}: {answer!r}")
        elif answer != right:
            a, b = np.frombuffer(answer, np.float32), np.frombuffer(right, np.float32)
            share = float(np.mean(a != b)) if a.shape == b.shape else 1.0
            self.faults.append(f"{kind}: {share:.1%} of the values differ")


class Owners:
    """Renderers, threads and contexts of other code, to be taken in turns."""

    def __init__(self, seed: int = 1, display: str | None = None, processes: float = 0.02) -> None:
        self._random = random.Random(seed)
        self._processes = processes
        self.right = [spawned(k, "egl")[1] for k in range(SCENES)]
        self.foreign = foreigners(display)
        backends = ["egl", "egl", "window" if display else "osmesa"]
        self.renderers = [rm.Renderer(SIZE, backend) for backend in backends]
        self.workers = [Worker(), Worker()]
        self.count = Count()

    def turn(self) -> None:
        """One frame, or two at once."""
        chosen = self._random
        if chosen.random() < self._processes:
            self._process()
            return
        k, renderer = chosen.randrange(SCENES), chosen.choice(self.renderers)
        where = chosen.choice(["here", "thread", "both", "fresh", "passing"])
        foreign = chosen.choice([*self.foreign, None])
        current.unbind()
        if foreign is not None:
            foreign.begin()
        name = f"{renderer.context.backend}, {where}, {foreign.name if foreign else 'nothing'} current"

        def draw(renderer: rm.Renderer = renderer, k: int = k) -> bytes:
            return renderer.render(scene(k)).color.tobytes()

        if where == "here":
            self.count.see(name, self._tried(draw), self.right[k])
        elif where == "thread":
            self._wait(name, chosen.choice(self.workers).start(draw), k)
        elif where == "both":
            other, i = chosen.choice(self.renderers), chosen.randrange(SCENES)
            answers = [
                self.workers[0].start(draw),
                self.workers[1].start(lambda: draw(other, i)),
            ]
            for answer, which in zip(answers, (k, i), strict=True):
                self._wait(name, answer, which)
        elif where == "fresh":  # opened in one thread, drawn in another, closed in a third
            made = self._answer(self.workers[0].start(lambda: rm.Renderer(SIZE, "egl")))
            self._wait(name, self.workers[1].start(lambda: draw(made)), k)
            made.close()
        else:
            picture = self._tried(lambda: np.asarray(rm.render(scene(k), SIZE, backend="egl")).tobytes())
            shown = scene(k).tone.image(np.frombuffer(self.right[k], np.float32).reshape(*SIZE[::-1], 3))
            self.count.see(name, picture, np.asarray(shown).tobytes())
        if foreign is not None:
            if not foreign.unharmed():
                self.count.faults.append(f"{name}: the other context is harmed")
        elif current.current():
            self.count.faults.append(f"{name}: a context was left current")
        current.unbind()

    def _process(self) -> None:
        k = self._random.randrange(SCENES)
        if self._random.random() < 0.25:
            word, frame = spawned(k, "egl")
            self.count.see("spawned process", frame if word == "drawn" else word, self.right[k])
            return
        renderer = self._random.choice(self.renderers)
        works: list[Callable[[], bytes]] = [
            lambda: renderer.render(scene(k)).color.tobytes(),
            lambda: rm.render(scene(k), SIZE).tobytes(),
            lambda: rm.Renderer(SIZE, "egl").render(scene(k)).color.tobytes(),
        ]
        word, answer = forked(self._random.choice(works))
        self.count.frames += 1
        self.count.refused += word == "refused"
        self.count.kinds["forked process"] = self.count.kinds.get("forked process", 0) + 1
        if word != "refused" or not all(cure in answer.decode() for cure in CURE):
            self.count.faults.append(f"forked process: {word} {answer[:200]!r}")

    def _tried(self, work: Callable[[], bytes]) -> Any:
        try:
            return work()
        except Exception as error:
            return error

    def _answer(self, answer: queue.Queue[Any]) -> Any:
        try:
            return answer.get(timeout=LIMIT)
        except queue.Empty:
            return TimeoutError("hangs")

    def _wait(self, name: str, answer: queue.Queue[Any], k: int) -> None:
        self.count.see(name, self._answer(answer), self.right[k])

    def close(self) -> None:
        self.workers[0].start(lambda: [renderer.close() for renderer in self.renderers[:2]])
        for worker in self.workers:
            worker.end()
        for renderer in self.renderers:
            renderer.close()
        current.unbind()


def run(frames: int, seed: int = 1, display: str | None = None, processes: float = 0.02) -> Count:
    """So many frames in random turns."""
    owners = Owners(seed, display, processes)
    try:
        while owners.count.frames < frames:
            owners.turn()
    finally:
        owners.close()
    return owners.count


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="put the figures into docs/figures/long_runs.json")
    given = parser.parse_args(arguments)
    faulthandler.dump_traceback_later(300 + 2.0 * given.frames, exit=True)
    with ExitStack() as stack:
        try:
            from tests.support.window_driver import serve_display

            display = stack.enter_context(serve_display())
        except OSError as error:
            print(f"without windows: {error}")
            display = None
        count = run(given.frames, given.seed, display)
    for kind, frames in sorted(count.kinds.items()):
        print(f"{frames:5d} {kind}")
    for fault in count.faults[:20]:
        print(f"WRONG {fault}")
    print(f"{count.frames} frames, {count.refused} refused after a fork, {len(count.faults)} wrong")
    if given.keep:
        keep(
            "owners",
            **{
                "frames": count.frames,
                "kinds of turns": len(count.kinds),
                "refused after a fork, with the cure": count.refused,
                "wrong, hung or harmful to other contexts": len(count.faults),
            },
        )
    return 1 if count.faults else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
