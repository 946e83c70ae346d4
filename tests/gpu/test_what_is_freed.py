"""What is dropped is freed on the device, and not only forgotten."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import DeviceError, SceneError
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context, kept_context, open_context
from raymarch.gpu.display import KEPT, display_of
from raymarch.gpu.probe import probe_with
from raymarch.gpu.targets import Target
from raymarch.plan.passes import Output
from tests.support.gl_objects import alive

LAMPS = [rm.PointLight((0.1 * i, 2, 1), intensity=0.3) for i in range(40)]
SIZES = [(8 + i, 9) for i in range(12)]


def resized(renderer: Renderer, i: int) -> None:
    renderer.resize(SIZES[i])
    renderer.render(rm.Scene(rm.sphere()))


def resized_with_a_history(renderer: Renderer, i: int) -> None:
    renderer.resize(SIZES[i])
    renderer.render(rm.Scene(rm.sphere(), quality=rm.Quality(temporal="reproject")))


def resized_while_it_marches_in_passes(renderer: Renderer, i: int) -> None:
    renderer.resize(SIZES[i])
    renderer.render(rm.Scene(rm.sphere(), quality=rm.Quality(steps_per_pass=8)))


def with_another_schedule(renderer: Renderer, i: int) -> None:
    schedules = ("single", "cone", "cones", "two")
    renderer.render(rm.Scene(rm.sphere(), quality=rm.Quality(schedule=schedules[i % 4])))


def with_another_history(renderer: Renderer, i: int) -> None:
    renderer.render(rm.Scene(rm.sphere(), quality=rm.Quality(temporal=("accumulate", "reproject")[i % 2])))


def with_other_data(renderer: Renderer, i: int) -> None:
    renderer.render(rm.Scene(rm.heightmap(np.full((4, 4), 0.01 * (i + 1))) | rm.plane(offset=-1)))


def with_another_picture(renderer: Renderer, i: int) -> None:
    skin = rm.Material(albedo=rm.triplanar(np.full((4, 4, 3), 0.01 * (i + 1))))
    renderer.render(rm.Scene(rm.sphere().material(skin)))


def with_more_lamps(renderer: Renderer, i: int) -> None:
    renderer.render(rm.Scene(rm.sphere(), lights=LAMPS[: 20 + i]))


def of_another_text(renderer: Renderer, i: int) -> None:
    renderer.render(rm.Scene(rm.sphere(1.0 + 0.01 * i)))


def closed(renderer: Renderer, i: int) -> None:
    with Renderer((9 + i, 8), context=renderer.context) as other:
        other.render(rm.Scene(rm.sphere(), lights=LAMPS[:20], quality=rm.Quality(temporal="accumulate")))
        other.render(rm.Scene(rm.sphere(), quality=rm.Quality(steps_per_pass=8)))
        other.render(rm.Scene(rm.heightmap(np.eye(4))), outputs=("color", "depth"))


def looked_at(renderer: Renderer, i: int) -> None:
    probe_with(renderer, rm.Scene(rm.sphere() | rm.box(1), rm.Camera((0, 0, 4 + i), (0, 0, 0))))


@pytest.mark.parametrize(
    "act",
    [
        resized,
        resized_with_a_history,
        resized_while_it_marches_in_passes,
        with_another_schedule,
        with_another_history,
        with_other_data,
        with_another_picture,
        with_more_lamps,
        of_another_text,
        closed,
        looked_at,
    ],
    ids=lambda act: act.__name__,
)
def test_what_is_dropped_is_freed(
    act: Callable[[Renderer, int], None], egl: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("raymarch.gpu.resource_cache.KEPT", 4)
    with Renderer((8, 9), context=egl) as renderer:
        renderer.resources.kept = 4
        for i in range(6):
            act(renderer, i)
        before = alive(egl)
        for i in range(6, 12):
            act(renderer, i)
        assert alive(egl) == before


def test_pictures_use_one_context_again() -> None:
    scenes = [rm.Scene(rm.sphere(1.0 + 0.01 * i)) for i in range(4)]
    pictures = [rm.render(scene, (8, 5), backend="egl") for scene in scenes]
    with kept_context("egl") as context:
        before = alive(context)
    assert [rm.render(scene, (8, 5), backend="egl") for scene in scenes] == pictures
    with kept_context("egl") as again:
        assert again is context and alive(again) == before
        with kept_context("egl") as nested:
            assert nested is not again
    assert nested.released and not again.released
    with pytest.raises(SceneError), kept_context("egl") as failed:
        raise SceneError("wrong")
    assert failed is again and failed.released
    with kept_context("egl") as fresh, pytest.raises(DeviceError):
        rm.render(rm.sphere(), (8, 5), backend="none")
    assert not fresh.released


def test_programs_of_many_exposures_are_freed() -> None:
    target_of_light = Output(0, slice(0, 3))

    def show(exposure: int) -> bytes | None:
        pixels = display_of(context).light(target, target_of_light, rm.ToneMapping(exposure=exposure / 8))
        return None if pixels is None else pixels.tobytes()

    with open_context("egl") as context, Target(context, (4, 4)) as target:
        target.clear((0.2, 0.1, 0.5, 1.0))
        first = show(0)
        for i in range(1, KEPT):
            show(i)
        before = alive(context)
        for i in range(KEPT, 3 * KEPT):
            show(i)
        assert first is not None and show(0) == first and alive(context) == before


def test_a_context_that_was_asked_for_otherwise_is_released(monkeypatch: pytest.MonkeyPatch) -> None:
    with kept_context("egl") as first:
        pass
    monkeypatch.setenv("RAYMARCH_EGL_DEVICE", "0")
    with kept_context("egl") as second:
        assert second is not first and first.released
    with kept_context("osmesa") as third:
        assert second.released
    assert third.released, "glfw's windows are closed"
