"""Arrays that stay on the device until they are accessed, and views that are coloured there."""

from __future__ import annotations

import gc
from dataclasses import replace
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
    real = Target.channels
    monkeypatch.setattr(Target, "channels", lambda self, *given: read.append(given[0]) or real(self, *given))
    with rm.Renderer(SIZE, context=egl) as renderer:
        for _ in range(3):
            frame = renderer.render(SCENE, outputs=ALL)
            del frame
        gc.collect()
        assert not read and not egl.unread
        frame = renderer.render(SCENE, outputs=ALL)
        assert frame.depth.shape == SIZE[::-1] and read == [0]
        renderer.render(SCENE)
        assert read == [0, 0]  # the colour with the rays out of steps, whose texture was drawn


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
    output = DRAWN[pass_name].outputs[name]
    own = texels[output.texture, ..., output.channels]
    if output.type == "i4" or name == "cycles":
        own[:] = np.rint(own * 10)
    elif view != "position" and not view.endswith("evaluations"):  # whose ends are the largest values
        own[0, :10] = np.float32(ODD)[:, None] if own.ndim == 3 else ODD
        own[1, 10:20] = np.roll(np.float32([ODD, ODD, ODD]), 3).T.reshape(10, 3) if own.ndim == 3 else ODD
    frame, target = drawn_on(egl, texels, pass_name)
    with target, np.errstate(all="ignore"):
        monkeypatch.setattr(views, "is_worth", lambda target: False)
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


def light() -> Any:
    """Values around all changes of the code, odd ones, and random ones."""
    rng = np.random.default_rng(9)
    steps = rm.ToneMapping().steps
    assert steps is not None
    edges = steps.light[np.isfinite(steps.light)]
    below = np.nextafter(edges, np.float32(0.0))
    odd = np.float32([*ODD, 1e-45, 3e38, 1.0, np.nextafter(np.float32(1.0), np.float32(2.0))])
    bits = rng.integers(0, 2**32, 2000, dtype=np.uint32).view(np.float32)
    values = np.concatenate([edges, below, odd, bits, rng.uniform(-0.1, 1.4, 9000).astype(np.float32)])
    texels = np.ones((1, 64, 96, 4), np.float32)
    texels[..., :3] = np.resize(values, (64, 96, 3))
    texels[0, :32] = rng.permutation(texels[0, :32].reshape(-1, 4)).reshape(32, 96, 4)
    return texels


@pytest.mark.parametrize("exposure", [0.0, 1.5, -3.0])
def test_a_device_encodes_light_to_the_bytes_of_numpy(
    egl: Context, exposure: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    texels = light()
    frame, target = drawn_on(egl, texels, "color")
    frame.tone = rm.ToneMapping(exposure=exposure)
    other, same = drawn_on(egl, texels, "color")
    with target, same, np.errstate(all="ignore"):
        monkeypatch.setattr(egl, "driver", replace(egl.driver, is_software=False))
        by_device = np.asarray(frame.image())
        assert not frame._arrays and not any(unread._read for unread in frame._unread.values())
        counts = frame._count_odd()
        monkeypatch.undo()
        assert np.array_equal(by_device, frame.tone.image(frame.color))
        finite = np.isfinite(frame.color).all(-1)
        assert counts == other._count_odd() and counts[0] > 10 and counts[1] > 50
        assert counts == (np.sum(~finite), np.sum(finite & (np.nan_to_num(frame.color).min(-1) > 1.0)))


@pytest.mark.parametrize("tone", [rm.ToneMapping("aces"), rm.ToneMapping(dither=True)])
def test_other_tones_are_numpys_on_every_device(
    egl: Context, tone: rm.ToneMapping, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame, target = drawn_on(egl, np.ones((1, 4, 6, 4)), "color")
    frame.tone = tone
    with target:
        monkeypatch.setattr(egl, "driver", replace(egl.driver, is_software=False))
        assert np.array_equal(np.asarray(frame.image()), tone.image(np.ones((4, 6, 3), np.float32)))


def test_small_pictures_are_coloured_by_numpy_on_a_software_renderer(egl: Context) -> None:
    with Target(egl, (16, 8)) as small:
        assert display.is_worth(small) is not egl.driver.is_software
