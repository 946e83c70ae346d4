"""Diagnosis of the OpenGL backends of this machine: driver, limits and known defects. Prints nothing."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from raymarch.errors import DeviceError
from raymarch.gpu.clock import Clock, Kind
from raymarch.gpu.compute import draws_by, why_drawn_so
from raymarch.gpu.context import BACKENDS, Context, open_context
from raymarch.gpu.driver import Driver, Limits
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target

LOOP_ITERATIONS = 200_000
"""Iterations of the loop test: three times llvmpipe's limit, and still fast on any device."""

PATIENCE = 60.0
"""Seconds after which a driver that is examined in a process of its own counts as hanging."""

# The counter depends on a random generator (constants of Numerical Recipes) that the compiler cannot predict, so it
# must run the loop and cannot replace it by `iterations`. Exact as a float below 2^24.
_LOOP_FRAGMENT = """#version 330 core
uniform int iterations;
uniform uint never;
out vec4 reached;
void main() {
    uint state = 1u;
    int count = 0;
    for (int i = 0; i < iterations; i++) {
        state = state * 1664525u + 1013904223u;
        if (state == never) break;
        count++;
    }
    reached = vec4(float(count), float(state & 65535u), 0.0, 1.0);
}
"""


@dataclass(frozen=True, slots=True)
class LoopLimit:
    """Number of iterations that a shader's loop made, of those requested."""

    asked: int
    reached: int

    @property
    def is_limited(self) -> bool:
        """True if the loop ended early."""
        return self.reached < self.asked

    @property
    def words(self) -> str:
        """The finding as text."""
        if self.is_limited:
            return f"loops end silently after {self.reached:,} iterations"
        return f"no loop limit up to {self.asked:,}"


@dataclass(frozen=True, slots=True)
class ClockReport:
    """The clock that times draws, and the verdict of its self-test."""

    kind: Kind
    verdict: str


@dataclass(frozen=True, slots=True)
class Report:
    """One backend: its properties if it works, else the driver's message and a remedy."""

    backend: str
    works: bool
    error: str | None = None
    cure: str | None = None
    driver: Driver | None = None
    limits: Limits | None = None
    loops: LoopLimit | None = None
    clock: ClockReport | None = None
    draws: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON types; unknown values are None."""
        plain = asdict(self)
        if self.loops is not None:
            plain["loops"] |= {"is_limited": self.loops.is_limited, "words": self.loops.words}
        if self.limits is not None:
            plain["limits"]["viewport"] = list(self.limits.viewport)
        return plain


def examine(backends: Sequence[str] = BACKENDS) -> list[Report]:
    """Open, test and release each backend. Returns one report for each, in the given order.

    Takes about two seconds. Each is opened in a process of its own: a driver that crashes or hangs ends that one alone,
    which is reported. A backend that does not work raises nothing: its report has the reason. Raises DeviceError for
    an unknown backend.
    """
    unknown = [backend for backend in backends if backend not in BACKENDS]
    if unknown:
        raise DeviceError(f"unknown backend {unknown[0]!r}", legal=f"legal: {', '.join(BACKENDS)}")
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / backend for backend in backends]
        asked = [_asked(backend, file) for backend, file in zip(backends, files, strict=True)]
        return [_answer(*each) for each in zip(backends, asked, files, strict=True)]


def _asked(backend: str, file: Path) -> subprocess.Popen[str]:
    """A process that examines a backend."""
    code = "import sys; sys.path[:] = sys.argv[3:]; from raymarch.gpu.doctor import _write; _write(*sys.argv[1:3])"
    command = [sys.executable, "-c", code, backend, str(file), *sys.path]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace")


def _answer(backend: str, asked: subprocess.Popen[str], file: Path) -> Report:
    """The report of a process."""
    with asked:
        try:
            _, said = asked.communicate(timeout=PATIENCE)
            if asked.returncode == 0:
                return pickle.loads(file.read_bytes())
            last = (said.strip().splitlines() or [""])[-1]
            what = f"the driver crashed ({_reason(asked.returncode)})" + f": {last}" * bool(last)
        except subprocess.TimeoutExpired:
            asked.kill()
            what = f"the driver hung for {PATIENCE:.0f} s"
    return Report(backend, works=False, error=what, cure="another driver, or one of the other backends")


def _reason(code: int) -> str:
    """Why a process ended, by its exit code."""
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"exit code {code}"


def _write(backend: str, file: str) -> None:
    """Examine a backend and write its report to a file."""
    Path(file).write_bytes(pickle.dumps(_examine(backend)))


def _examine(backend: str) -> Report:
    try:
        context = open_context(backend)
    except DeviceError as error:
        return Report(backend, works=False, error=error.what, cure=error.legal)
    with context:
        clock = Clock(context)
        report = ClockReport(clock.kind, clock.verdict)
        known = context.driver, context.limits, count_loop(context), report
        return Report(backend, True, None, None, *known, f"{draws_by(context)} shaders: {why_drawn_so(context)}")


def count_loop(context: Context, iterations: int = LOOP_ITERATIONS) -> LoopLimit:
    """Run a shader loop of `iterations`, from 1 to 2^24, on one pixel, and return the number of iterations made.

    llvmpipe silently ends every loop after 65,535 iterations of all loops of an invocation together.
    """
    with Target(context, (1, 1)) as target, Program(context, FULL_SCREEN, _LOOP_FRAGMENT, None, "loop test") as program:
        # The generator has period 2^32 and reaches 1 last, so the loop never breaks by itself.
        program.draw(target, {"iterations": iterations, "never": 1})
        return LoopLimit(iterations, int(target.read()[0, 0, 0]))
