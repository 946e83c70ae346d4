"""Threads, contexts of other code, forked and spawned processes: a frame is right or refused, and nothing hangs.

What may hang or crash runs in a process of its own, with a time limit.
"""

from __future__ import annotations

import inspect
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import DeviceError
from raymarch.gpu import Renderer, current
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.targets import Target

ROOT = Path(__file__).parents[2]
SIZE = (32, 24)
LIMIT = 120.0


def scene() -> rm.Scene:
    lamps = [rm.PointLight((0.3 * i - 2, 2, 2), intensity=0.5) for i in range(12)]
    return rm.Scene(rm.heightmap(np.eye(6)) | rm.box(0.5), rm.Camera((1, 2, 3), (0, 0, 0)), lamps)


@pytest.fixture
def right(egl: Context) -> Any:
    with Renderer(SIZE, context=egl) as alone:
        return alone.render(scene()).color


def elsewhere(work: Callable[[], Any]) -> Any:
    """What a function gives in another thread; an error there is one here."""
    answer: queue.Queue[Any] = queue.Queue()

    def run() -> None:
        try:
            answer.put(work())
        except BaseException as error:
            answer.put(error)

    threading.Thread(target=run, daemon=True).start()
    found = answer.get(timeout=LIMIT)
    if isinstance(found, BaseException):
        raise found
    return found


class Other:
    """A context of other code, made by moderngl alone."""

    def __init__(self) -> None:
        settings: dict[str, Any] = {"backend": "egl"}
        self.gl: Any = moderngl.create_context(require=330, standalone=True, **settings)
        self.target = self.gl.framebuffer([self.gl.texture((4, 4), 4, dtype="f4")])
        self.target.use()
        self.seen = current.current()

    def make_current(self) -> None:
        self.gl.__enter__()

    def draw(self, value: float) -> None:
        self.target.clear(value, value, value, value)

    def value(self) -> float:
        return float(np.frombuffer(self.target.read(components=1, dtype="f4"), np.float32)[0])


@pytest.fixture
def other() -> Iterator[Other]:
    """It is current when a test begins."""
    current.unbind()
    made = Other()
    yield made
    current.unbind()
    made.gl.release()


# Threads


@pytest.mark.parametrize("backend", ["egl", "osmesa"])
def test_a_renderer_draws_in_any_thread(backend: str, right: Any, request: pytest.FixtureRequest) -> None:
    with Renderer(SIZE, context=request.getfixturevalue(backend)) as renderer:
        for work in (elsewhere, lambda draw: draw(), elsewhere, elsewhere):
            frame = work(lambda: renderer.render(scene()))
            assert frame.complete and np.array_equal(frame.color, right)
        lazy = elsewhere(lambda: renderer.render(scene(), outputs=()))
        assert np.array_equal(lazy.color, right) and np.array_equal(elsewhere(lambda: lazy.depth), lazy.depth)


def test_a_renderer_is_opened_and_closed_in_any_thread(right: Any) -> None:
    renderer = elsewhere(lambda: Renderer(SIZE, "egl"))
    assert np.array_equal(renderer.render(scene()).color, right)
    elsewhere(renderer.close)
    with pytest.raises(DeviceError, match="this renderer is closed"):
        renderer.render(scene())


def test_threads_draw_at_once_on_one_renderer_and_on_two(egl: Context, right: Any) -> None:
    with Renderer(SIZE, context=egl) as one, Renderer(SIZE, "egl") as two:
        wrong: list[Any] = []

        def draw(renderer: Renderer) -> None:
            for _ in range(6):
                if not np.array_equal(renderer.render(scene()).color, right):
                    wrong.append(renderer)

        threads = [threading.Thread(target=draw, args=(r,), daemon=True) for r in (one, one, two, two)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(LIMIT)
            assert not thread.is_alive(), "hangs"
        assert not wrong


def test_objects_freed_in_another_thread_are_their_own_contexts(egl: Context) -> None:
    """Their names repeat from context to context: freed in the wrong one, they are another's."""
    with open_context("egl") as second:
        mine, its = Target(egl, (4, 4)), Target(second, (4, 4))
        mine.clear((1.0,) * 4)
        with egl.bound():
            elsewhere(its.release)
        assert np.all(mine.read() == 1.0)
        mine.release()


def test_a_context_that_another_thread_holds_is_refused(egl: Context) -> None:
    """Where other code made ours current in another thread, it cannot be had here, and the error says so."""
    with open_context("egl") as taken:
        held, done = threading.Event(), threading.Event()

        def hold() -> None:
            current.bind((taken._binding,))
            held.set()
            done.wait(LIMIT)
            current.unbind()

        thread = threading.Thread(target=hold, daemon=True)
        thread.start()
        assert held.wait(LIMIT)
        try:
            with pytest.raises(DeviceError, match=r"egl context \(thread MainThread.*cannot be made current"):
                Target(taken, (4, 4))
        finally:
            done.set()
            thread.join(LIMIT)
        assert not current.current()
        with Target(taken, (4, 4)) as target:
            target.clear((1.0,) * 4)
            assert np.all(target.read() == 1.0)


# Contexts of other code


def test_a_context_of_other_code_is_current_before_and_after(egl: Context, right: Any, other: Other) -> None:
    with Renderer(SIZE, context=egl) as renderer:
        for value in (0.25, 0.5):
            other.make_current()
            other.draw(value)
            assert np.array_equal(renderer.render(scene()).color, right)
            assert renderer.render(scene()).depth.shape == SIZE[::-1]  # another output: new textures
            assert current.current() == other.seen and other.value() == value
        renderer.resize((16, 12))
        renderer.resize(SIZE)
        with Renderer(SIZE, "egl") as fresh:
            assert np.array_equal(fresh.render(scene()).color, right)
        with pytest.raises(DeviceError):
            Renderer(SIZE, "egl", device=77)
        assert rm.render(scene(), SIZE).size == SIZE
        assert current.current() == other.seen and other.value() == value
    assert current.current() == other.seen and other.value() == value


def test_the_context_that_moderngl_gives_to_other_code_stays_so(egl: Context, other: Other) -> None:
    assert moderngl.get_context() is other.gl
    with Renderer(SIZE, "egl") as renderer:
        renderer.render(scene())
        assert moderngl.get_context() is other.gl
    assert moderngl.get_context() is other.gl


def test_nothing_is_left_current(egl: Context) -> None:
    current.unbind()
    with Renderer(SIZE, "egl") as renderer:
        assert not current.current()
        renderer.render(scene())
        assert not current.current()
    with pytest.raises(rm.RaymarchError):
        rm.render(scene(), (0, 0))
    assert not current.current()


def test_progress_is_told_with_the_callers_context(egl: Context, right: Any, other: Other) -> None:
    """It may draw there, and make yet another current; the frame goes on."""
    second = Other()
    other.make_current()
    told: list[bool] = []

    def progress(share: float) -> None:
        if not told:
            told.append(current.current() == other.seen)
            other.draw(0.5)
            second.make_current()
        else:
            told.append(current.current() == second.seen)

    with Renderer(SIZE, context=egl) as renderer:
        frame = renderer.render(scene(), progress=progress, outputs=("color", "depth"))
    assert len(told) > 1 and all(told) and np.array_equal(frame.color, right)
    assert current.current() == second.seen
    other.make_current()
    assert other.value() == 0.5
    second.gl.release()


def test_a_frame_within_a_frame_is_refused(egl: Context, right: Any) -> None:
    with Renderer(SIZE, context=egl) as renderer:
        for call in (lambda _: renderer.render(scene()), lambda _: renderer.resize((8, 8)), lambda _: renderer.close()):
            with pytest.raises(DeviceError, match="in the middle of a frame"):
                renderer.render(scene(), progress=call)
        assert np.array_equal(renderer.render(scene()).color, right)


def test_every_call_of_moderngl_is_made_with_our_context(
    egl: Context, other: Other, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All methods of moderngl's objects ask the platform first whose context is current."""
    calls: list[str] = []
    addresses = {id(egl.gl): egl._binding.values[-1]}

    def checked(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(self: Any, *args: Any, **how: Any) -> Any:
            gl = self if isinstance(self, moderngl.Context) else self.ctx
            if id(gl) in addresses:
                calls.append(name)
                assert current.EGL.context() == addresses[id(gl)], f"{name} is called in another context"
            return function(self, *args, **how)

        return call

    kinds = (moderngl.Texture, moderngl.Texture3D, moderngl.Framebuffer, moderngl.Program, moderngl.VertexArray)
    for kind in (*kinds, moderngl.Context, moderngl.Buffer, moderngl.Query):
        for name, found in vars(kind).items():
            if name.startswith("_") or name in ("ctx", "extensions", "gc_mode", "version_code", "extra"):
                continue
            where = f"{kind.__name__}.{name}"
            if inspect.isfunction(found):
                monkeypatch.setattr(kind, name, checked(where, found))
            elif isinstance(found, property) and found.fset is not None:
                monkeypatch.setattr(kind, name, property(found.fget, checked(where, found.fset)))
    cloud = rm.Scene(
        rm.sphere(0.5).material(rm.Material(albedo=rm.planar(np.full((4, 4), 0.5)))) | rm.box(0.4),
        rm.Camera((1, 2, 3), (0, 0, 0)),
        quality=rm.Quality(temporal="accumulate", steps_per_pass=16, schedule="cone"),
    )
    with Renderer(SIZE, context=egl) as renderer:
        renderer.kept = 1
        for some in (scene(), cloud, rm.Scene(rm.sphere(), quality=rm.Quality(temporal="reproject"))):
            frame = renderer.render(some, within=1e-3, progress=lambda share: None)
            assert frame.depth.shape == SIZE[::-1]
        renderer.resize((20, 10))
        for call in renderer.draw_calls(scene()):
            call.draw((0, 0, 4, 4))
            call.target.read_texel(1, 1)
    assert current.current() == other.seen and len(calls) > 100


# Processes


def run(code: str, *, limit: float = LIMIT, display: str | None = None) -> str:
    """What a program prints; it fails if it hangs or ends badly."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "tests")))}
    environment.pop("DISPLAY", None)
    if display:
        environment["DISPLAY"] = display
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], env=environment, capture_output=True, text=True, timeout=limit
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


START = """
import os, sys
import numpy as np
import raymarch as rm
from tests.lab.owners import forked
SCENE, SIZE = rm.Scene(rm.sphere()), (32, 24)
def draw(renderer): return renderer.render(SCENE).color.tobytes()
def refused(work):
    word, message = forked(work)
    assert word == "refused" and all(w in message for w in (b"spawn", b"forkserver", b"fork")), (word, message)
"""


def test_a_fork_is_refused_and_the_parent_draws_on(egl: Context) -> None:
    run(
        START
        + """
renderer = rm.Renderer(SIZE, "egl")
frame = renderer.render(SCENE)
right = frame.color.tobytes()
refused(lambda: draw(renderer))
refused(lambda: frame.depth.tobytes())
refused(lambda: renderer.resize((8, 8)))
refused(lambda: rm.render(SCENE, SIZE).tobytes())
refused(lambda: rm.Renderer(SIZE, "osmesa"))
assert forked(lambda: (renderer.close(), renderer.resources.release(), b"closed")[-1])[1] == b"closed"
def in_a_frame():
    told = []
    def progress(share):
        told or refused(lambda: draw(renderer))
        told.append(share)
    renderer.render(SCENE, progress=progress)
in_a_frame()
assert draw(renderer) == right
renderer.close()
refused(lambda: rm.render(SCENE, SIZE).tobytes())
"""
    )


def test_the_end_of_a_fork_leaves_the_parents_objects(egl: Context, display: str) -> None:
    """A child that ends in full, through its garbage and its exit handlers, destroys nothing of the parent's."""
    for backend in ("egl", "osmesa", "window"):
        run(
            START
            + f"""
renderer = rm.Renderer(SIZE, "{backend}")
right = draw(renderer)
for k in range(3):
    child = os.fork()
    if child == 0:
        if k == 1:
            renderer.close()
        elif k == 2:
            import gc
            del renderer
            gc.collect()
        sys.exit(7)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    assert draw(renderer) == right
""",
            display=display,
        )


def test_a_fork_of_a_program_with_opengl_of_its_own_is_refused(egl: Context) -> None:
    run(
        START
        + """
import moderngl
gl = moderngl.create_context(standalone=True, backend="egl")
gl.framebuffer([gl.texture((4, 4), 4)]).clear()
refused(lambda: rm.render(SCENE, SIZE).tobytes())
"""
    )


def test_a_fork_before_any_opengl_draws(egl: Context) -> None:
    run(
        START
        + """
def twice():
    with rm.Renderer(SIZE, "egl") as one, rm.Renderer(SIZE, "egl") as two:
        assert draw(one) == draw(two)
        refused(lambda: draw(one))
        return draw(one)
word, drawn = forked(twice)
assert word == "drawn", (word, drawn)
with rm.Renderer(SIZE, "egl") as renderer:
    assert draw(renderer) == drawn
"""
    )


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_a_pool_of_processes(method: str, egl: Context, tmp_path: Path) -> None:
    """After a render in the parent: drawn where the children are new, refused at once where they are forks."""
    (tmp_path / "pooled.py").write_text(f"""
import multiprocessing, sys, warnings
import raymarch as rm
def draw(k): return rm.render(rm.Scene(rm.sphere(0.5 + 0.1 * k)), (32, 24)).tobytes()
if __name__ == "__main__":
    warnings.simplefilter("ignore", DeprecationWarning)
    right = [draw(k) for k in range(2)]
    with multiprocessing.get_context("{method}").Pool(1) as pool:
        try:
            print(pool.map(draw, range(2)) == right)
        except rm.RaymarchError as error:
            print(error)
""")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, str(tmp_path / "pooled.py")], env=environment, capture_output=True, text=True, timeout=LIMIT
    )
    assert done.returncode == 0, done.stderr
    answer = done.stdout.strip()
    assert "spawn" in answer and "forkserver" in answer if method == "fork" else answer == "True"


@pytest.mark.parametrize("shown", [True, False], ids=["windows", "osmesa"])
def test_random_turns(shown: bool, egl: Context, display: str) -> None:
    """A short run of `python -m tests.lab.owners`."""
    code = f"""
from tests.lab.owners import run
if __name__ == "__main__":
    count = run(10, seed=3, display={display if shown else None!r}, processes=0.1)
    assert not count.faults, count.faults
    assert count.refused
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "tests")))}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_number_of_loaded_libraries_grows_with_each() -> None:
    code = """
import ctypes, ctypes.util
from raymarch.gpu import current
before = current._count_loads()
assert before is None or before == current._count_loads() > 5
name = next(n for n in ("libEGL.so.1", "libGLX.so.0", "libOSMesa.so.8", "libGL.so.1") if not current._loaded(n)
            and ctypes.util.find_library(n[3:].partition(".")[0]))
ctypes.CDLL(name)
assert before is None or current._count_loads() > before
assert current._loaded(name)
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=LIMIT)
