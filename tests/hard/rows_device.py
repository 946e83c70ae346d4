"""Cases of the device: loops, clocks, failures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import raymarch as rm
from raymarch.gpu.clock import Clock
from raymarch.gpu.doctor import count_loop
from tests.hard.failing import failures
from tests.hard.world import Figure, World, case, refusals


@case(52, "loops on the software renderer")
def loops(world: World) -> Iterator[Figure]:
    """llvmpipe silently ends every loop after 65,535 iterations. `doctor` detects this, and no quality setting exceeds
    it."""
    found = count_loop(world.context)
    known = 65_535 if world.context.driver.is_software else found.asked
    yield Figure("iterations by which doctor misses the known limit", abs(found.reached - known), 1, "it counts")
    yield refusals(
        (lambda: rm.Quality(max_steps=60_001), ("max_steps = 60001", "60000")),
        (lambda: rm.Quality(steps_per_pass=70_000), ("steps_per_pass", "60000")),
    )


@case(53, "timers on the software renderer", before="7.1 ms for a draw of 207 ms; once 4,295 ms")
def timers(world: World) -> Iterator[Figure]:
    """A timer query may return wrong times. It is compared with the wall clock before it is used."""
    liar = Clock(world.context, lambda draw: (draw(), world.context.gl.finish(), 0.001)[-1])
    yield Figure("wrong timers that are accepted", liar.kind != "wall clock", 0, "tested on draws of known load")
    honest = Clock(world.context)
    software = world.context.driver.is_software
    yield Figure(
        "software renderers timed by a query",
        software and honest.kind != "wall clock",
        0,
        "the wall clock is used there",
    )


@case(60, "a failing driver")
def failing(world: World) -> Iterator[Figure]:
    """Any call may fail: out of memory, a lost context, a refused shader. The error names the pass, no incomplete file
    is left, and the next frame is drawn."""
    calls, unnamed, broken = failures(world.context)
    yield Figure(f"failures without the pass or the cause, of {calls}", unnamed, 0, "each call fails once")
    yield Figure("renderers that do not draw the same again afterwards", broken, 0, "nothing half made is kept")
    with TemporaryDirectory() as folder:
        left = half_written(world, Path(folder))
    yield Figure("files left by a command that failed", left, 0, "written aside, renamed at the end")


def half_written(world: World, folder: Path) -> int:
    from typer.testing import CliRunner

    import raymarch.cli.drawing as command
    from raymarch.cli import app
    from raymarch.errors import DeviceError

    scene = folder / "scene.py"
    scene.write_text("import raymarch as rm\nscene = rm.sphere()\n", encoding="utf-8")

    class Failing(rm.Renderer):
        def render(self, *args: object, **how: object) -> rm.Frame:
            raise DeviceError("pass color: the device is out of memory")

    original = command.Renderer
    command.Renderer = Failing
    try:
        done = CliRunner().invoke(app, ["render", str(scene), "-o", str(folder / "out.png"), "--backend", "egl"])
    finally:
        command.Renderer = original
    assert done.exit_code != 0 and isinstance(done.exception, DeviceError)
    return len([f for f in folder.iterdir() if f.name not in ("scene.py", "__pycache__")])
