"""What this machine can draw with: every backend tried, its driver, its limits and its quirks. Prints nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from raymarch.errors import DeviceError
from raymarch.gpu.clock import Clock, Kind
from raymarch.gpu.context import BACKENDS, Context, Driver, Limits, open_context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target

LOOP_ITERATIONS = 200_000
"""How far the loop test counts: three times llvmpipe's limit, and at once done on any device."""

# The counter depends on a generator (Numerical Recipes' constants) that the compiler cannot see through, so it
# must run the loop and cannot put `iterations` in its place. Exact as a float below 2^24.
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
    """How many iterations a shader's loop made of those it was told to make."""

    asked: int
    reached: int

    @property
    def is_limited(self) -> bool:
        """Whether the loop ended before its time."""
        return self.reached < self.asked

    @property
    def words(self) -> str:
        """The finding in a few words."""
        if self.is_limited:
            return f"loops end silently after {self.reached:,} iterations"
        return f"no loop limit seen up to {self.asked:,}"


@dataclass(frozen=True, slots=True)
class ClockReport:
    """Which clock times the draws, and the self-test's words."""

    kind: Kind
    verdict: str


@dataclass(frozen=True, slots=True)
class Report:
    """One backend: what it is made of where it works, else the driver's answer and the cure."""

    backend: str
    works: bool
    error: str | None = None
    cure: str | None = None
    driver: Driver | None = None
    limits: Limits | None = None
    loops: LoopLimit | None = None
    clock: ClockReport | None = None

    def to_dict(self) -> dict[str, Any]:
        """Numbers, texts, lists and dicts alone, as JSON takes them; what is unknown is None."""
        plain = asdict(self)
        if self.loops is not None:
            plain["loops"] |= {"is_limited": self.loops.is_limited, "words": self.loops.words}
        if self.limits is not None:
            plain["limits"]["viewport"] = list(self.limits.viewport)
        return plain


def examine(backends: Sequence[str] = BACKENDS) -> list[Report]:
    """Open each backend in turn, test it and release it: one report for each, in the given order.

    Takes about a second. Never raises for a backend that does not work: its report says why.
    DeviceError for a name that is no backend.
    """
    unknown = [backend for backend in backends if backend not in BACKENDS]
    if unknown:
        raise DeviceError(f"unknown backend {unknown[0]!r}", legal=f"legal: {', '.join(BACKENDS)}")
    return [_examine(backend) for backend in backends]


def _examine(backend: str) -> Report:
    try:
        context = open_context(backend)
    except DeviceError as error:
        return Report(backend, works=False, error=error.what, cure=error.legal)
    with context:
        return Report(
            backend,
            works=True,
            driver=context.driver,
            limits=context.limits,
            loops=count_loop(context),
            clock=_examine_clock(context),
        )


def count_loop(context: Context, iterations: int = LOOP_ITERATIONS) -> LoopLimit:
    """Run a shader loop of `iterations`, from 1 to 2^24, on one pixel, and read back how far it came.

    llvmpipe ends every loop after 65,535 iterations of all loops of an invocation together, and says nothing.
    """
    with (
        Target(context, (1, 1)) as target,
        Program(
            context, FULL_SCREEN, _LOOP_FRAGMENT, lambda line: (f"the loop test (line {line})", None), "loop test"
        ) as program,
    ):
        # The generator's period is 2^32 and it comes to 1 last of all, so the loop never breaks by itself.
        program.draw(target, {"iterations": iterations, "never": 1})
        return LoopLimit(iterations, int(target.read()[0, 0, 0]))


def _examine_clock(context: Context) -> ClockReport:
    clock = Clock(context)
    return ClockReport(clock.kind, clock.verdict)
