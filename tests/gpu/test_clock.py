"""A clock is believed only after it told the truth."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf
from time import process_time, sleep
from typing import Any

import pytest

from raymarch.gpu import clock as module
from raymarch.gpu.clock import Clock, Trial, gl_timer, judge, try_growth, try_timer, wall_time
from raymarch.gpu.context import Context

LOADS = (1, 2, 4)
WALL = (2.0, 4.0, 8.0)


def timer_that(context: Context, distort: Callable[[float], float]) -> module.Timer:
    """A timer that knows the truth, and says what `distort` makes of it."""
    return lambda draw: distort(wall_time(context, draw))


@pytest.mark.parametrize(
    ("timer", "believed"),
    [
        ((2.0, 4.0, 8.0), True),
        ((1.9, 3.9, 7.9), True),  # a fixed cost that only the wall clock sees
        ((2.2, 4.4, 8.8), True),
        ((4.0, 8.0, 16.0), False),
        ((1.0, 2.0, 4.0), False),
        ((2.4, 4.0, 6.4), False),  # each reading within 20 %, but blind to a third of the load
        ((4.0, 4.0, 4.0), False),
        ((0.1, 0.2, 0.4), False),
        ((2.0, 4.0, 4295.0), False),
        ((float("nan"), 4.0, 8.0), False),
        ((2.0, float("nan"), 8.0), False),
        ((0.0, 0.0, 0.0), False),
    ],
)
def test_the_judge(timer: tuple[float, ...], believed: bool) -> None:
    agrees, words = judge(LOADS, WALL, timer)
    assert agrees is believed
    assert f"{timer[0]:.3g} ms" in words and "8 ms" in words


def test_a_restless_wall_clock_convicts_and_acquits_nobody() -> None:
    agrees, words = judge(LOADS, (5.0, 5.0, 6.0), (5.0, 5.0, 6.0))
    assert not agrees and "could not distinguish" in words


def test_an_honest_timer_is_used(egl: Context) -> None:
    clock = Clock(egl, timer_that(egl, lambda milliseconds: milliseconds))
    for _ in range(5):  # the machine may be too restless to believe anybody: ask again
        if clock.kind == "gpu timer":
            break
        clock = Clock(egl, timer_that(egl, lambda milliseconds: milliseconds))
    assert clock.kind == "gpu timer" and clock.verdict.startswith("gpu timer: ")
    clock._timer = lambda draw: 123.0
    assert clock.time(lambda: None) == 123.0


@pytest.mark.parametrize(
    "distort",
    [lambda ms: 2 * ms, lambda ms: ms / 2, lambda ms: 5.0, lambda ms: ms * 0.03],
    ids=["twice", "half", "constant", "like llvmpipe"],
)
def test_a_lying_timer_is_refused(context: Context, distort: Callable[[float], float]) -> None:
    clock = Clock(context, timer_that(context, distort))
    assert clock.kind == "wall clock" and clock.verdict.startswith("wall clock: ")
    assert "ms where the wall clock measured" in clock.verdict
    clock._timer = lambda draw: 123.0
    assert clock.time(lambda: sleep(0.02)) != 123.0


def test_one_impossible_reading_among_honest_ones_is_enough() -> None:
    pairs = [(2.0, 2.0), (2.1, 4295.0), (1.9, 1.9)]
    assert module._least_disturbed(pairs) == (2.1, 4295.0)
    assert module._least_disturbed([(2.0, 2.0), (9.0, 2.0), (1.9, 1.8)]) == (1.9, 1.8)


def test_software_is_timed_by_the_wall_clock(context: Context) -> None:
    if not context.driver.is_software:
        pytest.skip(f"{context.driver.renderer} is no software renderer")
    clock = Clock(context)
    assert clock.kind == "wall clock" and clock._trial is None  # known without a test
    assert "ms where the wall clock measured" in clock.verdict and "CPU" in clock.verdict


def test_llvmpipes_timer_is_found_out_by_its_numbers(context: Context) -> None:
    if "llvmpipe" not in context.driver.renderer:
        pytest.skip(f"{context.driver.renderer} is not llvmpipe")
    assert [try_timer(context, gl_timer(context)).agrees for _ in range(3)] == [False] * 3


def test_the_test_is_lazy_quick_and_made_once(egl: Context, monkeypatch: Any) -> None:
    calls: list[int] = []

    def count(context: Context, timer: module.Timer) -> Trial:
        calls.append(1)
        return try_timer(context, timer)

    monkeypatch.setattr(module, "try_timer", count)
    clock = Clock(egl, timer_that(egl, lambda ms: ms))
    assert not calls
    start = process_time()
    assert clock.verdict and clock.kind and clock.time(lambda: None) >= 0.0
    assert len(calls) == 1
    assert process_time() - start < 2.0  # 0.1 s on an idle machine; the rest is for a busy one


def test_the_wall_clock_waits_for_the_draw(context: Context) -> None:
    """Times of one and of 32 times the work: a clock that does not wait sees no difference."""
    from raymarch.gpu.program import FULL_SCREEN, Program
    from raymarch.gpu.targets import Target

    more = 1 if context.driver.is_software else 64
    program = Program(context, FULL_SCREEN, module._TEST_FRAGMENT, lambda line: ("test", None), "test")
    with program, Target(context, (512, 512)) as target:
        program.draw(target, {"iterations": 1})
        least = {32 * more: inf, 1024 * more: inf}
        for turn in range(30):
            for n in least:
                least[n] = min(least[n], wall_time(context, partial(program.draw, target, {"iterations": n})))
            light, heavy = least.values()
            if turn > 1 and heavy > 10 * light:
                return
    raise AssertionError(f"{heavy} ms and {light} ms")  # also where other programs lengthen single draws


def test_what_a_draw_does_on_the_cpu_counts_too(egl: Context) -> None:
    assert wall_time(egl, lambda: sleep(0.02)) >= 20.0


def test_a_draw_beyond_the_timers_span_is_timed_by_the_wall_clock(egl: Context, monkeypatch: Any) -> None:
    clock = Clock(egl, lambda draw: 123.0)
    clock._trial = Trial(WALL, WALL, True, "told the truth")
    assert clock.time(lambda: None) == 123.0
    monkeypatch.setattr(module, "TIMER_SPAN_MS", 0.0)
    assert clock.time(lambda: None) != 123.0


def test_cpu_time_replaces_the_wall_clock_where_asked(egl: Context) -> None:
    """Load of other programs lengthens the wall clock alone: here, a pause in the draw."""
    if not egl.driver.is_software:
        pytest.skip("frames of a GPU take no CPU time")
    clock = Clock(egl)
    assert clock.time(lambda: sleep(0.05)) > 45.0
    clock.by_cpu = True
    assert clock.kind == "CPU time" and clock.time(lambda: sleep(0.05)) < 25.0
    assert "so CPU time is used" in clock.verdict
    grown = try_growth(egl, clock.time)
    assert grown.agrees, grown.words
    assert not try_growth(egl, lambda draw: 3.0).agrees, "a clock that stands still"
