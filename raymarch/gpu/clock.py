"""Milliseconds of a draw, from a clock that was tested first.

Timer queries of OpenGL are wrong on some drivers: Mesa's llvmpipe has answered 7 ms for a draw of 207 ms. So the
query is held against the wall clock on a few draws of known load, and is used only if it agrees. Otherwise the
time is taken by the wall clock from an idle device to an idle device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from time import perf_counter
from typing import Literal, TypeAlias

from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target

TOLERANCE = 0.2
"""By how much a timer may differ from the wall clock, as a share of the wall clock's reading. Submitting a draw and
waiting for it takes some 0.1 ms that only the wall clock sees: 5 % of the lightest test draw."""

TIMER_SPAN_MS = 2000.0
"""Draws that take longer are timed by the wall clock: moderngl reads the query as 32 bits of nanoseconds, which end
at 4295 ms, and at 2147 ms in the versions that read them signed."""

Timer: TypeAlias = Callable[[Callable[[], None]], float]
"""Runs a draw and returns the milliseconds that it claims the draw took."""

Kind: TypeAlias = Literal["gpu timer", "wall clock"]

_LOADS = (1, 2, 4)
_REPEATS = 3
_LIGHTEST_MS = 2.0
_FEWEST_ITERATIONS = 8
# llvmpipe ends all loops of an invocation after 65,535 iterations; the heaviest load must stay below.
_MOST_ITERATIONS_SOFTWARE = 65_535 // _LOADS[-1]
_MOST_ITERATIONS = 1 << 22
_TEST_SIZE = (512, 512)
_TEST_FRAGMENT = """#version 330 core
uniform int iterations;
out vec4 color;
void main() {
    vec2 z = gl_FragCoord.xy * 0.001;
    for (int i = 0; i < iterations; i++) z = fract(z * 1.37 + z.yx * 0.71 + 0.1);
    color = vec4(z, 0.0, 1.0);
}
"""


@dataclass(frozen=True, slots=True)
class Trial:
    """A timer against the wall clock: relative loads, the milliseconds of both by load, the judgement and its words."""

    loads: tuple[int, ...]
    wall: tuple[float, ...]
    timer: tuple[float, ...]
    agrees: bool
    words: str


class Clock:
    """Measures draws in milliseconds by the GPU's timer if a self-test finds it right, else by the wall clock.

    The self-test runs when it is first needed and takes some 0.2 s. A driver that draws on the CPU is timed by the
    wall clock whatever the test says, because there the wall clock is the truth; `verdict` still tests and reports.

    Parameters
    ----------
    context : the context that draws; bound by every method.
    timer : for tests: measures a draw in place of OpenGL's timer query, and is trusted if it agrees.
    """

    def __init__(self, context: Context, timer: Timer | None = None) -> None:
        self._context = context
        self._timer = timer or gl_timer(context)
        self._is_software = timer is None and context.driver.is_software
        self._trial: Trial | None = None

    @property
    def trial(self) -> Trial:
        """The self-test of the timer; run at the first access, kept thereafter."""
        if self._trial is None:
            self._trial = try_timer(self._context, self._timer)
        return self._trial

    @property
    def kind(self) -> Kind:
        """Which clock `time` reads."""
        return "wall clock" if self._is_software or not self.trial.agrees else "gpu timer"

    @property
    def verdict(self) -> str:
        """One sentence: the clock that is read and why, with the numbers measured."""
        also = "; the CPU draws here, so its clock is the right one" if self._is_software else ""
        return f"{self.kind}: {self.trial.words}{also}"

    def time(self, draw: Callable[[], None]) -> float:
        """Run `draw` and return its milliseconds. Waits for the device before and after; must not be nested.

        By the wall clock the time includes submitting the draw, and whatever else `draw` does.
        """
        if self.kind == "wall clock":
            return wall_time(self._context, draw)
        wall, claimed = _both(self._context, self._timer, draw)
        return claimed if wall < TIMER_SPAN_MS else wall


def gl_timer(context: Context) -> Timer:
    """OpenGL's own timer (GL_TIME_ELAPSED) in milliseconds: trusted by nobody before `try_timer`.

    moderngl offers no way to free a query, so each timer keeps one until the context's release.
    """
    with context.bound():
        query = context.gl.query(time=True)

    def timer(draw: Callable[[], None]) -> float:
        with context.bound():
            context.gl.finish()
            with query:
                draw()
            return query.elapsed * 1e-6

    return timer


def wall_time(context: Context, draw: Callable[[], None]) -> float:
    """Milliseconds of `draw` by the wall clock, from an idle device to an idle device."""
    with context.bound():
        context.gl.finish()
        start = perf_counter()
        draw()
        context.finish()  # a draw may have switched contexts
        return (perf_counter() - start) * 1e3


def try_timer(context: Context, timer: Timer) -> Trial:
    """Time draws of 1, 2 and 4 times a load by both clocks at once, and judge by `judge`.

    Each load is drawn three times, and the draw that the wall clock saw least disturbed counts, unless the timer
    claims in any of them more time than passed: no disturbance explains that.
    """
    with ExitStack() as stack:
        target = stack.enter_context(Target(context, _TEST_SIZE))
        program = stack.enter_context(Program(context, FULL_SCREEN, _TEST_FRAGMENT, _no_location, "clock self-test"))

        def draw(iterations: int) -> Callable[[], None]:
            return lambda: program.draw(target, {"iterations": iterations})

        base = _lightest_load(context, draw)
        pairs = [_least_disturbed([_both(context, timer, draw(base * load)) for _ in range(_REPEATS)]) for load in _LOADS]
    wall, claimed = zip(*pairs, strict=True)
    agrees, words = judge(_LOADS, wall, claimed)
    return Trial(_LOADS, wall, claimed, agrees, words)


def judge(loads: Sequence[int], wall: Sequence[float], timer: Sequence[float]) -> tuple[bool, str]:
    """Whether a timer is to be believed, and the reason with its numbers.

    It must come within `TOLERANCE` of the wall clock at every load, and its growth from the lightest to the
    heaviest load within `TOLERANCE` of the wall clock's growth, which is free of any fixed cost. Where the wall
    clock itself does not grow to at least half of what the loads say, the machine is too restless to believe anybody.

    Parameters
    ----------
    loads : relative loads, ascending.
    wall, timer : milliseconds by load, of the same draws.
    """
    readings = ", ".join(f"{t:.3g} ms where the wall clock saw {w:.3g} ms" for t, w in zip(timer, wall, strict=True))
    if wall[-1] / wall[0] < loads[-1] / loads[0] / 2:
        return False, f"the wall clock could not tell test draws of known load apart (the timer said {readings})"
    if any(not abs(t - w) <= TOLERANCE * w for t, w in zip(timer, wall, strict=True)):  # `not <=` catches NaN
        return False, f"the GPU timer disagrees by more than {TOLERANCE:.0%}: {readings}"
    growth, expected = timer[-1] - timer[0], wall[-1] - wall[0]
    if not abs(growth - expected) <= TOLERANCE * expected:
        return (
            False,
            f"the GPU timer grows by {growth:.3g} ms where the wall clock grows by {expected:.3g} ms: {readings}",
        )
    return True, f"the GPU timer agrees within {TOLERANCE:.0%} and scales with the load: {readings}"


def _lightest_load(context: Context, draw: Callable[[int], Callable[[], None]]) -> int:
    """Loop iterations a pixel that keep the device busy for `_LIGHTEST_MS`, as far as the driver's loops allow."""
    most = _MOST_ITERATIONS_SOFTWARE if context.driver.is_software else _MOST_ITERATIONS
    iterations = _FEWEST_ITERATIONS
    wall_time(context, draw(iterations))  # the first draw of a program also compiles it
    while wall_time(context, draw(iterations)) < _LIGHTEST_MS and 2 * iterations <= most:
        iterations *= 2
    return iterations


def _both(context: Context, timer: Timer, draw: Callable[[], None]) -> tuple[float, float]:
    """(wall clock, timer) in milliseconds for one and the same draw, so that a disturbance strikes both."""
    claimed: list[float] = []
    wall = wall_time(context, lambda: claimed.append(timer(draw)))
    return wall, claimed[0]


def _least_disturbed(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    impossible = [(wall, claimed) for wall, claimed in pairs if not claimed <= wall * (1 + TOLERANCE)]
    return impossible[0] if impossible else min(pairs)


def _no_location(line: int) -> tuple[str, None]:
    return f"raymarch itself (line {line})", None
