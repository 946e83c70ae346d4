"""Timing of draws in milliseconds, by a clock that passed a self-test.

OpenGL timer queries are wrong on some drivers: Mesa's llvmpipe has reported 7 ms for a draw of 207 ms. The query is
therefore compared with the wall clock on a few draws of known load, and used only if they agree. Otherwise the wall
clock measures from an idle device to an idle device.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Literal, TypeAlias

from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target

TOLERANCE = 0.2
"""Relative tolerance of the timer against the wall clock. Submitting a draw and waiting for it takes about 0.1 ms that
only the wall clock includes: 5 % of the lightest test draw."""

TIMER_SPAN_MS = 2000.0
"""Longer draws are timed by the wall clock: moderngl reads the query as 32-bit nanoseconds, which overflow at 4295 ms,
or at 2147 ms in versions that read them as signed."""

Timer: TypeAlias = Callable[[Callable[[], None]], float]
"""A function that runs a draw and returns its measured time in milliseconds."""

Kind: TypeAlias = Literal["gpu timer", "wall clock", "CPU time"]

_LOADS = (1, 2, 4)
_REPEATS = 3
_LIGHTEST_MS = 2.0
_FEWEST_ITERATIONS = 8
# llvmpipe ends all loops of an invocation after 65,535 iterations; the heaviest load must stay below that.
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
    """A comparison of a timer with the wall clock: milliseconds of both, the verdict and its reason."""

    wall: tuple[float, ...]
    timer: tuple[float, ...]
    agrees: bool
    words: str


class Clock:
    """Times draws by the GPU's timer if it passes a self-test, else by the wall clock.

    The self-test runs on first use and takes about 0.2 s. A driver that renders on the CPU is always timed by the wall
    clock, which is exact there; `verdict` still runs the test.

    context : the OpenGL context; bound by every method.
    timer : for tests: replaces OpenGL's timer query, and is used if it agrees.
    by_cpu : True to time such a driver by the CPU time of the process, of all its threads, in place of the wall clock:
        to compare settings while other programs run. A frame of several threads takes less than its CPU time.
    """

    by_cpu: bool = False

    def __init__(self, context: Context, timer: Timer | None = None) -> None:
        self._context = context
        self._timer = timer or gl_timer(context)
        self._is_software = timer is None and context.driver.is_software
        self._trial: Trial | None = None

    @property
    def trial(self) -> Trial:
        """The self-test of the timer; run on first access and cached."""
        if self._trial is None:
            self._trial = try_timer(self._context, self._timer)
        return self._trial

    @property
    def kind(self) -> Kind:
        """The clock that `time` uses."""
        if self._is_software:
            return "CPU time" if self.by_cpu else "wall clock"
        return "gpu timer" if self.trial.agrees else "wall clock"

    @property
    def verdict(self) -> str:
        """The clock in use and the reason, with measured numbers, as one sentence."""
        used = "CPU time" if self.by_cpu else "the wall clock"
        also = f"; the driver renders on the CPU, so {used} is used" if self._is_software else ""
        return f"{self.kind}: {self.trial.words}{also}"

    def time(self, draw: Callable[[], None]) -> float:
        """Run `draw` and return its milliseconds. Waits for the device before and after; must not be nested.

        The wall clock includes the submission of the draw and any other work of `draw`.
        """
        kind = self.kind
        if kind != "gpu timer":
            return wall_time(self._context, draw) if kind == "wall clock" else cpu_time(self._context, draw)
        wall, claimed = _both(self._context, self._timer, draw)
        return claimed if wall < TIMER_SPAN_MS else wall


def gl_timer(context: Context) -> Timer:
    """OpenGL's timer (GL_TIME_ELAPSED) in milliseconds. Test it by `try_timer` first.

    moderngl cannot free a query, so all timers of a context share one.
    """
    with context.bound():
        query = context.kept["timer"] = context.kept.get("timer") or context.gl.query(time=True)

    def timer(draw: Callable[[], None]) -> float:
        with context.bound():
            context.finish()
            with query:
                draw()
            return query.elapsed * 1e-6

    return timer


def wall_time(context: Context, draw: Callable[[], None]) -> float:
    """Time of `draw` in milliseconds by the wall clock, from an idle device to an idle device."""
    with context.bound_until_idle():
        context.finish()
        start = perf_counter()
        draw()
        context.finish()  # a draw may have switched contexts
        return (perf_counter() - start) * 1e3


def cpu_time(context: Context, draw: Callable[[], None]) -> float:
    """CPU time of the process for `draw` in milliseconds, from an idle device to an idle device."""
    with context.bound_until_idle():
        context.finish()
        start = process_time()
        draw()
        context.finish()
        return (process_time() - start) * 1e3


def try_timer(context: Context, timer: Timer) -> Trial:
    """Time draws of 1, 2 and 4 times a load by both clocks at once, and compare them by `judge`.

    Each load is drawn three times. The draw with the shortest wall time counts, unless the timer reports more time than
    passed in one of them, which no disturbance explains.
    """
    with _test_draws(context) as (draw, base):
        pairs = [
            _least_disturbed([_both(context, timer, draw(base * load)) for _ in range(_REPEATS)]) for load in _LOADS
        ]
    wall, claimed = zip(*pairs, strict=True)
    agrees, words = judge(_LOADS, wall, claimed)
    return Trial(wall, claimed, agrees, words)


def try_growth(context: Context, timer: Timer) -> Trial:
    """Whether a timer that other programs do not disturb grows as the load of draws does, which the wall clock of a
    busy machine cannot tell: each load is drawn three times, and the least time counts."""
    with _test_draws(context) as (draw, base):
        found = [min(timer(draw(base * load)) for _ in range(_REPEATS)) for load in _LOADS]
    first, last = found[1] - found[0], found[-1] - found[0]
    expected = first * (_LOADS[-1] - _LOADS[0]) / (_LOADS[1] - _LOADS[0])
    agrees = first > 0.0 and abs(last - expected) <= TOLERANCE * expected
    times = ", ".join(f"{t:.3g}" for t in found)
    words = f"{times} ms for draws of {', '.join(map(str, _LOADS))} times a load"
    return Trial((), tuple(found), agrees, f"it {'grows' if agrees else 'does not grow'} with the load: {words}")


@contextmanager
def _test_draws(context: Context) -> Iterator[tuple[Callable[[int], Callable[[], None]], int]]:
    """Draws of a number of iterations, and that of the lightest load."""
    with ExitStack() as stack:
        target = stack.enter_context(Target(context, _TEST_SIZE))
        program = stack.enter_context(Program(context, FULL_SCREEN, _TEST_FRAGMENT, None, "clock self-test"))

        def draw(iterations: int) -> Callable[[], None]:
            return lambda: program.draw(target, {"iterations": iterations})

        yield draw, _lightest_load(context, draw)


def judge(loads: Sequence[int], wall: Sequence[float], timer: Sequence[float]) -> tuple[bool, str]:
    """Whether a timer agrees with the wall clock, and the reason with numbers.

    The timer must be within `TOLERANCE` of the wall clock at every load. Its growth from the lightest to the heaviest
    load, which excludes fixed costs, must be within `TOLERANCE` of the wall clock's growth. If the wall clock grows by
    less than half of the ratio of the loads, the machine is too busy for a verdict, and the timer is rejected.

    loads : relative loads, ascending.
    wall, timer : milliseconds by load, of the same draws.
    """
    readings = ", ".join(
        f"{t:.3g} ms where the wall clock measured {w:.3g} ms" for t, w in zip(timer, wall, strict=True)
    )
    if wall[-1] / wall[0] < loads[-1] / loads[0] / 2:
        return False, f"the wall clock could not distinguish test draws of known load (the timer measured {readings})"
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
    """Loop iterations per pixel for a draw that takes `_LIGHTEST_MS` and three times as long as one of hardly any
    iterations, limited by the driver's loop limit. The cost that all draws share would hide the load of a lighter one.
    """
    most = _MOST_ITERATIONS_SOFTWARE if context.driver.is_software else _MOST_ITERATIONS
    iterations = _FEWEST_ITERATIONS

    def least() -> float:
        return min(wall_time(context, draw(iterations)) for _ in range(_REPEATS))

    wall_time(context, draw(iterations))  # the first draw of a program also compiles it
    enough = max(_LIGHTEST_MS, 3.0 * least())
    while least() < enough and 2 * iterations <= most:
        iterations *= 2
    return iterations


def _both(context: Context, timer: Timer, draw: Callable[[], None]) -> tuple[float, float]:
    """(wall clock, timer) in milliseconds for the same draw, so that a disturbance affects both."""
    claimed: list[float] = []
    wall = wall_time(context, lambda: claimed.append(timer(draw)))
    return wall, claimed[0]


def _least_disturbed(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    impossible = [(wall, claimed) for wall, claimed in pairs if not claimed <= wall * (1 + TOLERANCE)]
    return impossible[0] if impossible else min(pairs)
