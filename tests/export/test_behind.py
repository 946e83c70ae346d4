"""Jobs and films in threads: order, errors, and what is left behind."""

from __future__ import annotations

import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from raymarch.errors import SceneError
from raymarch.export.behind import AHEAD, film, in_order
from raymarch.export.film import write_film
from raymarch.gpu.context import Context


def test_jobs_run_in_order_in_another_thread_and_few_wait() -> None:
    done: list[int] = []
    threads: set[int] = set()
    gate = threading.Event()

    def job(number: int) -> None:
        gate.wait(60)
        threads.add(threading.get_ident())
        done.append(number)

    with in_order() as later:
        for number in range(AHEAD):
            later(partial(job, number))
        assert not done
        threading.Timer(0.05, gate.set).start()
        later(partial(job, AHEAD))  # waits for the first
        assert done[0] == 0
        for number in range(AHEAD + 1, 9):
            later(partial(job, number))
    assert done == list(range(9)) and len(threads) == 1 and threading.get_ident() not in threads


def failing() -> None:
    raise SceneError("a full disk")


def test_the_error_of_a_job_ends_the_jobs_after_it() -> None:
    done: list[int] = []
    with pytest.raises(SceneError, match="a full disk"), in_order() as later:
        later(partial(done.append, 0))
        later(failing)
        for number in range(1, 99):
            later(partial(done.append, number))
    assert done == [0]
    with pytest.raises(SceneError, match="a full disk"), in_order() as later:
        later(failing)


def test_jobs_that_were_given_end_before_an_error_of_the_drawing_is_raised() -> None:
    done: list[int] = []

    def slow() -> None:
        time.sleep(0.05)
        done.append(1)

    with pytest.raises(ValueError, match="glass"), in_order() as later:
        later(slow)
        raise ValueError("glass")
    assert done == [1]


def pictures() -> list[Image.Image]:
    rng = np.random.default_rng(2)
    return [Image.fromarray(rng.integers(0, 255, (16, 24, 3), np.uint8)) for _ in range(5)]


def test_a_film_of_images_and_of_files_has_the_same_bytes(tmp_path: Path) -> None:
    write_film(tmp_path / "whole.gif", ".gif", pictures(), 10)
    with film(tmp_path / "film.gif", tmp_path, 10) as add:
        for number, picture in enumerate(pictures()):
            file = tmp_path / f"{number}.png"
            picture.save(file)
            add(picture if number % 2 else file)
    assert (tmp_path / "film.gif").read_bytes() == (tmp_path / "whole.gif").read_bytes()


@pytest.mark.parametrize("count", [0, 1, 5])
def test_a_film_whose_drawing_fails_is_not_written(count: int, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="glass"), film(tmp_path / "film.gif", tmp_path, 10) as add:
        for picture in pictures()[:count]:
            add(picture)
        raise ValueError("glass")
    assert not list(tmp_path.iterdir())


def test_a_film_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="cannot write"), film(tmp_path / "film.gif", tmp_path / "no", 10) as add:
        for picture in pictures() * 9:
            add(picture)


def test_the_wait_for_the_device_does_not_keep_pythons_lock(egl: Context) -> None:
    """That of moderngl does, and encoders in other threads would wait."""
    finish = egl._fences._finish
    assert finish != egl.gl.finish and "CFunction" in type(finish).__name__
    egl.finish()


def test_what_precedes_jobs_runs_in_two_threads_and_the_jobs_stay_in_order() -> None:
    both, done = threading.Barrier(2, timeout=120), list[int]()
    with in_order() as later:
        for number in range(6):
            later(partial(done.append, number), both.wait)  # no pair would pass in one thread
    assert done == list(range(6))


def test_what_fails_before_a_job_fails_again_in_the_job_or_not_at_all() -> None:
    """The job repeats it, and knows its file."""
    done: list[int] = []

    def repeating() -> None:
        done.append(1)
        failing()

    with pytest.raises(SceneError, match="a full disk"), in_order() as later:
        later(partial(done.append, 0), failing)
        later(repeating, failing)
        later(partial(done.append, 2))
    assert done == [0, 1]
