"""Objects of one context are used while another is current, whose objects have the same names."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.samples import Samples
from raymarch.expr.walk import find
from raymarch.gpu import Renderer, current
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target, upload, upload_pyramid

SIZE = (4, 3)
FILL = "#version 330 core\nuniform float u_value;\nout vec4 c;\nvoid main() { c = vec4(u_value); }\n"


@pytest.fixture
def other(egl: Context) -> Iterator[Context]:
    """A second context; it is current when a test begins."""
    with open_context("egl") as made:
        leave_current(made)
        yield made
        current.unbind()


def leave_current(context: Context) -> None:
    """Make a context current and leave it so, as other code of the process may."""
    current.unbind()
    current.bind((context._binding,))


def filled(context: Context, value: float) -> Target:
    target = Target(context, SIZE)
    target.write(np.full((3, 4, 4), value, np.float32))
    return target


def test_a_target_is_read_and_written_where_it_lives(egl: Context, other: Context) -> None:
    here, there = filled(egl, 1.0), filled(other, 2.0)
    assert np.all(here.read() == 1.0)  # the other is current
    leave_current(egl)
    assert np.all(there.read() == 2.0)
    leave_current(other)
    here.write(np.full((3, 4, 4), 3.0, np.float32))
    assert np.all(there.read() == 2.0) and np.all(here.read_texel(1, 1) == 3.0)
    there.clear((5.0, 5.0, 5.0, 5.0))
    leave_current(egl)
    assert np.all(there.read_texel(1, 1) == 5.0)
    leave_current(other)
    here.clear((6.0, 6.0, 6.0, 6.0))
    assert np.all(there.read() == 5.0) and np.all(here.read() == 6.0)
    here.write(np.full((3, 4, 4), 3.0, np.float32))
    leave_current(egl)
    there.release()
    assert np.all(here.read() == 3.0), "what was freed was the other's"
    here.release()


def test_a_target_is_made_where_it_is_to_live(egl: Context, other: Context) -> None:
    leave_current(other)
    here = filled(egl, 1.0)
    leave_current(other)
    again = filled(egl, 4.0)
    assert np.all(here.read() == 1.0) and np.all(again.read() == 4.0)
    for target in (here, again):
        target.release()


def test_a_program_draws_where_it_lives(egl: Context, other: Context) -> None:
    def made(context: Context) -> Program:
        return Program(context, FULL_SCREEN, FILL, lambda line: (FILL, None), "fill")

    with made(egl) as here, made(other) as there:
        mine, theirs = Target(egl, SIZE), Target(other, SIZE)
        here.draw(mine, {"u_value": 1.0})
        there.draw(theirs, {"u_value": 2.0})
        here.draw(mine, {"u_value": 3.0})
        assert np.all(theirs.read() == 2.0) and np.all(mine.read() == 3.0)
        mine.release()
        theirs.release()


def test_data_goes_where_it_is_to_be_read(egl: Context, other: Context) -> None:
    data = Samples(np.arange(24, dtype=np.float32).reshape(2, 3, 4))
    leave_current(other)
    here = upload(egl, data)
    leave_current(egl)
    with egl.bound():
        assert np.array_equal(np.frombuffer(here.read(), np.float32), data.values.ravel())
        here.release()
    leave_current(other)
    picture = rm.planar(np.full((4, 4), 0.5))
    (texels,) = {node.data for node in find([rm.Material(albedo=picture).expressions[0]], "texture")}
    pyramid = upload_pyramid(egl, texels)
    leave_current(egl)
    with egl.bound():
        assert np.all(np.frombuffer(pyramid.read(), np.float16) == 0.5)
        pyramid.release()


def test_two_renderers_take_turns(egl: Context, other: Context) -> None:
    """With histories, many lamps and data, each draws what it would draw alone, and closing one leaves the other."""
    lamps = [rm.PointLight((0.3 * i - 2, 2, 2), intensity=0.5) for i in range(12)]
    scenes = [
        rm.Scene(rm.heightmap(np.eye(6)) | rm.box(0.5), rm.Camera((1, 2, 3), (0, 0, 0)), lamps[: 10 + k],
                 quality=rm.Quality(temporal="accumulate"))
        for k in range(2)
    ]  # fmt: skip
    alone = []
    for context, scene in zip((egl, other), scenes, strict=True):
        with Renderer((24, 18), context=context) as renderer:
            alone.append([renderer.render(scene).color for _ in range(3)])
    with Renderer((24, 18), context=egl) as one:
        two = Renderer((24, 18), context=other)
        for i in range(3):
            for k, renderer in enumerate((one, two)):
                assert np.array_equal(renderer.render(scenes[k]).color, alone[k][i])
        leave_current(egl)
        two.close()
        one.forget()
        assert np.array_equal(one.render(scenes[0]).color, alone[0][0])


def test_a_library_that_is_loaded_later_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    loads, asked = [3], list[str]()
    library = current.Api(("libLater.so",), "make", ("ask",))

    def search(file: str) -> Any:
        asked.append(file)
        return None if loads[0] == 3 else SimpleNamespace(make=SimpleNamespace(), ask=lambda: 7)

    monkeypatch.setattr(current, "_loaded", search)
    monkeypatch.setattr(current, "_count_loads", lambda: loads[0])
    assert library.context() is None and library.current() is None
    assert len(asked) == 1, "the search is made again only after another load"
    loads[0] = 4
    assert library.context() == 7


def test_loads_are_counted_where_the_system_counts_them() -> None:
    before = current._count_loads()
    if sys.platform == "linux":
        assert before is not None and before > 10
    assert current._count_loads() == before
