"""The pace keeps the budget on devices of any speed, and gives back resolution when it may."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from raymarch.plan.marching import SCHEDULES
from raymarch.window.pace import SMALLEST, Pace, scaled
from raymarch.window.timeline import Timeline

SIZE = (640, 360)


def frames(pace: Pace, cost: Callable[[int, int], float], count: int) -> list[float]:
    """Milliseconds of so many frames on a device where `cost` tells them by number and pixels."""
    spent = []
    for i in range(count):
        width, height = scaled(SIZE, pace.scale(SIZE))
        spent.append(cost(i, width * height))
        pace.drawn(spent[-1], width * height)
    return spent


@pytest.mark.parametrize("full", [1.0, 20.0, 60.0, 300.0, 1500.0])
def test_frames_keep_the_budget_whatever_the_full_picture_costs(full: float) -> None:
    pace = Pace(33.0)
    spent = frames(pace, lambda _, pixels: full * pixels / (SIZE[0] * SIZE[1]), 60)
    assert max(spent[3:]) <= 33.0
    if full <= 26:
        assert pace.scale(SIZE) == 1.0
    else:  # no more is given up than two steps of the ladder
        assert max(spent[3:]) > 33.0 * 0.8 / 2


def test_a_device_that_is_too_slow_gets_the_smallest_picture() -> None:
    pace = Pace(33.0)
    frames(pace, lambda _, pixels: 1e5 * pixels / (SIZE[0] * SIZE[1]), 10)
    assert pace.scale(SIZE) == SMALLEST


def test_noise_does_not_break_the_budget() -> None:
    """A fifth of noise, and a scene that costs three times as much from one frame on."""
    random = np.random.default_rng(1)
    noise = random.uniform(0.9, 1.1, 400)

    def cost(i: int, pixels: int) -> float:
        return float(noise[i] * (60.0 if i < 200 else 180.0) * pixels / (SIZE[0] * SIZE[1]))

    spent = np.array(frames(Pace(33.0), cost, 400))
    assert np.mean(spent <= 1.5 * 33.0) >= 0.95
    assert np.sum(spent > 33.0) < 8


def test_one_frame_that_had_to_wait_does_not_spoil_the_next() -> None:
    pace = Pace(33.0)
    frames(pace, lambda _, pixels: 60.0 * pixels / (SIZE[0] * SIZE[1]), 40)
    before = pace.scale(SIZE)
    frames(pace, lambda _, pixels: 3000.0, 1)
    frames(pace, lambda _, pixels: 60.0 * pixels / (SIZE[0] * SIZE[1]), 12)
    assert pace.scale(SIZE) >= 0.8 * before


def test_resolution_comes_back_when_the_scene_gets_cheap() -> None:
    pace = Pace(33.0)
    frames(pace, lambda i, pixels: (300.0 if i < 20 else 5.0) * pixels / (SIZE[0] * SIZE[1]), 80)
    assert pace.scale(SIZE) == 1.0


def test_resolution_does_not_flicker() -> None:
    pace = Pace(33.0)
    shares = []
    for i in range(200):
        share = pace.scale(SIZE)
        width, height = scaled(SIZE, share)
        pace.drawn((100.0 + 4 * np.sin(i)) * width * height / (SIZE[0] * SIZE[1]), width * height)
        shares.append(share)
    assert np.count_nonzero(np.diff(shares[10:])) <= 2


def test_what_a_frame_costs_besides_is_taken_off() -> None:
    pace = Pace(33.0)
    for _ in range(50):
        pace.other(20.0)
    spent = frames(pace, lambda _, pixels: 60.0 * pixels / (SIZE[0] * SIZE[1]), 60)
    assert max(spent[3:]) <= 13.0


def test_sizes_are_whole_and_never_nothing() -> None:
    assert scaled((641, 360), 0.5) == (320, 180)
    assert scaled((3, 1), SMALLEST) == (1, 1)
    assert scaled((512, 256), 1.0) == (512, 256)


@pytest.mark.parametrize("name", SCHEDULES)
def test_moving_sizes_have_no_power_of_two_and_keep_their_shape(name: str) -> None:
    """Nor have their cones: Mesa's software renderer would compile anew in the middle of a movement."""
    levels = SCHEDULES[name].levels
    scales = tuple(level.scale for level in levels)
    for width in range(400, 2000, 47):
        for step in range(1, 9):
            share = 2 ** (-step / 4)
            chosen = scaled((width, 360), share, scales)
            edges = [edge for drawn in (chosen, *(level.size(chosen) for level in levels)) for edge in drawn]
            assert all(edge & (edge - 1) for edge in edges if edge > 2)
            assert 0.7 * width * share - 1 < chosen[0] <= width * share + 0.5
            assert abs(chosen[1] - 360 * chosen[0] / width) <= 1.5


def test_a_still_picture_tells_what_a_moving_one_costs() -> None:
    pace = Pace(33.0)
    pace.guess(1500.0, SIZE[0] * SIZE[1])
    width, height = scaled(SIZE, pace.scale(SIZE))
    assert 1500.0 * width * height / (SIZE[0] * SIZE[1]) <= 33.0
    for _ in range(2):
        pace.drawn(1500.0 * width * height / (SIZE[0] * SIZE[1]), width * height)
    before = pace.scale(SIZE)
    pace.guess(1.0, SIZE[0] * SIZE[1])  # what moving pictures have cost is known better
    assert pace.scale(SIZE) == before


def test_time_plays_pauses_steps_and_scrubs() -> None:
    clock = Timeline()
    assert clock.advance(0.5).time == 0.5
    paused = clock.advance(0.5).toggle()
    assert paused.advance(3.0).time == 0.5
    assert paused.toggle().advance(1.0).time == 1.5
    stepped = paused.step(1)
    assert np.isclose(stepped.time, 16 / 30) and not stepped.playing
    assert np.isclose(stepped.step(-2).time, 14 / 30)
    assert clock.scrub(7.0).time == 7.0 and clock.scrub(7.0).playing


def test_time_loops() -> None:
    clock = Timeline(time=1.0).looping((1.0, 3.0))
    assert np.isclose(clock.advance(2.5).time, 1.5)
    assert np.isclose(clock.scrub(0.5).time, 2.5)
    assert np.isclose(Timeline(time=1.0, speed=-1.0, loop=(1.0, 3.0)).advance(0.5).time, 2.5)
    assert clock.looping((2.0, 2.0)).loop is None
    assert clock.looping(None).advance(10).time == 11.0


@pytest.mark.parametrize("base", [40.0, 60.0, 90.0])
def test_a_picture_is_not_shrunk_where_that_hardly_helps(base: float) -> None:
    """A turning torus in a software renderer: 60 ms whatever the size, and 4 ms for a tenth of the width."""
    pace = Pace(33.0)
    share = 0.0
    for _ in range(25):
        share = pace.scale(SIZE)
        width, height = scaled(SIZE, share)
        spent = base + 400.0 * width * height / (SIZE[0] * SIZE[1])
        pace.drawn(spent, width * height)
    assert 1.4 * base <= spent <= 2.2 * base and share >= 2 * SMALLEST


def test_a_slow_picture_is_known_as_slow() -> None:
    for full, slow in ((3000.0, False), (9000.0, True)):
        pace = Pace(33.0)
        frames(pace, lambda _, pixels, full=full: full * pixels / (SIZE[0] * SIZE[1]), 5)
        assert pace.slow(SIZE) == slow
        pace.restart()
        assert not pace.slow(SIZE) and pace.scale(SIZE) == SMALLEST


@pytest.mark.parametrize("odd", [-1, 0, 1, 2, 3, 5])
@pytest.mark.parametrize("took", [1.0, 300.0])
def test_one_frame_of_another_time_does_not_keep_a_picture_small(took: float, odd: int) -> None:
    """Whatever part of the time all sizes take: within a second the picture is as large as the budget, or twice that
    part, allows, up to one step and a half of the ladder. The odd frame -1 is none."""
    for base, full in ((0.0, 60.0), (10.0, 60.0), (20.0, 100.0), (35.0, 120.0), (60.0, 400.0)):
        pace, spent, count, share = Pace(33.0), 0.0, 0, 0.0
        while spent < 1300.0:
            share = pace.scale(SIZE)
            pixels = scaled(SIZE, share)[0] * scaled(SIZE, share)[1]
            last = took if count == odd else base + full * pixels / (SIZE[0] * SIZE[1])
            spent, count = spent + last, count + 1
            pace.drawn(last, pixels)
        allowed = (max(0.8 * 33.0, 2 * base) - base) / full
        assert share >= 2**-0.375 * min(1.0, allowed**0.5), (base, full)


def test_a_still_picture_corrects_one_slow_frame() -> None:
    """The first moving picture had to wait: it moves as a preview only until a still one was drawn."""
    pace = Pace(33.0)
    pace.drawn(300.0, 3600)
    assert pace.slow(SIZE)
    pace.guess(60.0, SIZE[0] * SIZE[1])
    assert not pace.slow(SIZE) and pace.scale(SIZE) > 0.5


def test_a_noisy_fast_device_draws_whole_pictures() -> None:
    random = np.random.default_rng(2)
    pace = Pace(33.0)
    times = random.uniform(0.2, 2.0, 200)
    pace.drawn(times[0], 3600)
    for time in times[1:]:
        assert pace.scale(SIZE) > 0.5
        pace.drawn(time, SIZE[0] * SIZE[1])
