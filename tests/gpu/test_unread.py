"""Arrays that stay on the device until they are accessed, and views that are coloured there."""

from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import display, views
from raymarch.gpu.context import Context
from raymarch.gpu.frame import Frame
from raymarch.gpu.targets import Target
from raymarch.gpu.unread import unread_of
from raymarch.plan.passes import DRAWN

SIZE = (32, 24)
SCENE = rm.Scene(rm.union(rm.sphere(), rm.box(1), k=0.1), rm.Camera((1, 2, 4), (0, 0, 0)))
OTHER = rm.Scene(rm.box((3, 1, 1)), rm.Camera((1, 2, 4), (0, 0, 0)))
ALL = ("color", "depth", "position")


def never(name: str) -> Any:
    raise AssertionError(f"{name} was rendered")


def read_at_once(renderer: rm.Renderer, scene: rm.Scene) -> dict[str, Any]:
    frame = renderer.render(scene, outputs=ALL)
    return {name: frame.array(name) for name in frame._unread}


@pytest.mark.parametrize("change", ["render", "another array", "resize", "close", "draw calls", "doubts", "samples"])
def test_a_frame_keeps_its_arrays_whatever_the_renderer_does_next(egl: Context, change: str) -> None:
    scene = SCENE
    if change == "samples":
        scene = SCENE.replace(quality=rm.Quality(samples=3, temporal="accumulate"))
    with rm.Renderer(SIZE, context=egl) as renderer:
        known = read_at_once(renderer, scene)
        renderer.forget()
        frame = renderer.render(scene, outputs=ALL)
        assert not frame._arrays and len(frame._unread) == 11 and "depth" in repr(frame)
        if change in ("render", "samples"):
            renderer.render(OTHER, outputs=ALL)
        elif change == "another array":
            assert np.isnan(renderer.render(OTHER, outputs=("depth",)).slice).all() is not None
        elif change == "resize":
            renderer.resize((8, 8))
        elif change == "draw calls":
            for call in renderer.draw_calls(OTHER, outputs=ALL):
                call.draw()
        elif change == "doubts":
            frame.doubts(steps=True)
        if change != "close":
            for name, values in known.items():
                assert np.array_equal(frame.array(name), values, equal_nan=True), name
    for name, values in known.items():
        assert np.array_equal(frame.array(name), values, equal_nan=True), name


def test_a_frame_that_nobody_refers_to_is_not_read(egl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    real = Target.read
    monkeypatch.setattr(Target, "read", lambda self, *given: read.append(given[0]) or real(self, *given))
    with rm.Renderer(SIZE, context=egl) as renderer:
        for _ in range(3):
            frame = renderer.render(SCENE, outputs=ALL)
            del frame
        gc.collect()
        assert not read and not egl.unread
        frame = renderer.render(SCENE, outputs=ALL)
        assert frame.depth.shape == SIZE[::-1] and read == [0]
        renderer.render(SCENE)
        assert len(read) == 2  # the colour, whose texture was drawn


def drawn_on(egl: Context, texels: Any, pass_name: str) -> tuple[Frame, Target]:
    chosen = DRAWN[pass_name]
    target = Target(egl, (texels.shape[2], texels.shape[1]), chosen.textures)
    for k, values in enumerate(texels):
        target.write(values, k)
    unread = unread_of({pass_name: (chosen, target)})
    return Frame(target.size, 0.0, [], {}, never, _unread=unread), target


ODD = [np.nan, np.inf, -np.inf, -1.0, 0.0, -0.0, 1e-30, 1e30, 2.5, -7.0]


@pytest.mark.parametrize("view", [name for name, view in views.ALL.items() if view.color is not None])
def test_a_view_has_the_same_colours_on_the_device_and_in_numpy(
    egl: Context, view: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The device computes in float32, NumPy in float64: at a boundary of two codes they may differ by one."""
    name = views.VIEWS[view][0]
    (pass_name,) = (key for key, drawn in DRAWN.items() if name in drawn.outputs)
    rng = np.random.default_rng(3)
    texels = rng.normal(0.5, 2.0, (DRAWN[pass_name].textures, 24, 40, 4)).astype(np.float32)
    if DRAWN[pass_name].outputs[name].type == "i4" or name == "cycles":
        texels = np.rint(texels * 10).astype(np.float32)
    elif view != "evaluations":  # counts are finite
        texels[:, 0, :10] = np.float32(ODD)[:, None]
        texels[:, 1, :10, 3] = np.float32(ODD)
    frame, target = drawn_on(egl, texels, pass_name)
    with target, np.errstate(all="ignore"):
        by_numpy = np.asarray(views.picture(frame, view, SCENE)).astype(int)
        monkeypatch.setattr(views, "is_worth", lambda target: True)
        by_device = np.asarray(views.picture(frame, view, SCENE)).astype(int)
        assert by_device.std() > 20 and by_device.shape == (24, 40, 3)
        apart = np.abs(by_device - by_numpy)
        assert apart.max() <= 1 and np.mean(apart > 0) < 0.01, np.argwhere(apart > 1)[:5]
        with Target(egl, (80, 48)) as canvas:  # of twice the size, as linear light
            assert views.fill(canvas, frame, view)
            shown = display_bytes(canvas.read()[::2, ::2, :3])
        assert np.abs(shown - by_device).max() <= 1
    assert np.array_equal(np.asarray(views.picture(frame, view, SCENE)), by_numpy)  # the texture is gone


def display_bytes(linear: Any) -> Any:
    return rm.ToneMapping().image(linear).astype(int)


def test_small_pictures_are_coloured_by_numpy_on_a_software_renderer(egl: Context) -> None:
    with Target(egl, (16, 8)) as small:
        assert display.is_worth(small) is not egl.driver.is_software
