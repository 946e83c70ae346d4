"""Short reprs, pickled frames and references, frames of a closed renderer, and `scene.show`."""

from __future__ import annotations

import copy
import pickle
import sys
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.gpu.context import Context

SCENE = rm.Scene(
    rm.box((1, 1, 1)).material(rm.Material("tomato")),
    camera=rm.Camera((1, 2, 3)),
    lights=[rm.Sun(shadow=True), rm.PointLight((1, 2, 3), color="orange")],
)

REPRS = [
    (rm.time, "time"),
    (rm.Param("gap", 1, 0, 2.5), "Param('gap', 1, min=0, max=2.5)"),
    (rm.Param("tint", (1, 0.5, 0)), "Param('tint', (1, 0.5, 0))"),
    (SCENE.camera, "Camera(position=(1.0, 2.0, 3.0))"),
    (SCENE.lights, "(Sun(shadow=True), PointLight(position=(1.0, 2.0, 3.0), color=(1.0, 0.376262, 0.0)))"),
    (SCENE.materials[1], "Material(color=(1.0, 0.124772, 0.06301))"),
    (rm.truth(SCENE, (4, 3)), "<Truth 4x3: 2 of 12 rays hit>"),
]


@pytest.mark.parametrize(("value", "text"), REPRS, ids=[text for _, text in REPRS])
def test_a_value_is_shown_in_a_line(value: Any, text: str) -> None:
    assert repr(value) == text


def test_a_scene_fits_two_lines() -> None:
    assert "\n" not in repr(SCENE) and len(repr(SCENE)) < 320 and "PointLight(" in repr(SCENE)


def test_a_frame_and_a_renderer(egl: Context) -> None:
    renderer = rm.Renderer((16, 9), context=egl)
    frame = renderer.render(SCENE, time=2)
    assert repr(frame).startswith("<Frame 16x9 at time 2: color, done; ") and repr(frame).endswith(" ms>")
    assert repr(renderer).startswith("<Renderer 16x9, egl: ")
    assert copy.copy(frame).depth.shape == (9, 16)  # a copy still has its renderer
    renderer.close()


def test_a_frame_is_pickled_with_what_was_rendered(egl: Context) -> None:
    with rm.Renderer((16, 9), context=egl) as renderer:
        frame = renderer.render(SCENE, outputs=("color", "depth"))
        again = pickle.loads(pickle.dumps(frame))
    np.testing.assert_array_equal(again.color, frame.color)
    np.testing.assert_array_equal(again.depth, frame.depth)
    np.testing.assert_array_equal(again.image(), frame.image())
    assert (again.size, again.time, again.milliseconds) == (frame.size, frame.time, frame.milliseconds)
    assert again.doubts() == []
    for name in ("alpha", "material"):
        if name not in again._arrays:
            with pytest.raises(rm.DeviceError, match=f"its array '{name}' was not rendered before"):
                getattr(again, name)


def test_a_reference_is_pickled_whole() -> None:
    truth = rm.truth(SCENE, (6, 4))
    again = pickle.loads(pickle.dumps(truth))
    for name in ("depth", "hit", "normal", "material", "color", "gap"):
        np.testing.assert_array_equal(getattr(again, name), getattr(truth, name))


def test_a_frame_of_a_closed_renderer_says_how_to_ask() -> None:
    with rm.Renderer((16, 9)) as renderer:
        frame, late = renderer.render(SCENE), renderer.render(SCENE, outputs=("depth",))
    assert frame.color.shape == (9, 16, 3)
    with pytest.raises(rm.DeviceError, match=r"'color' was not rendered.*render\(scene, outputs=\(\"color\",\)\)"):
        late.image()
    with pytest.raises(
        rm.DeviceError, match=r"'depth' was not rendered.*render\(scene, outputs=\(\"color\", \"depth\"\)"
    ):
        _ = frame.depth
    with pytest.raises(rm.DeviceError, match="'alpha' was not rendered"):
        _ = frame.alpha
    with pytest.raises(rm.DeviceError, match="this renderer is closed"):
        renderer.render(SCENE)


def test_a_renderer_draws_the_same_in_another_thread(egl: Context) -> None:
    found: list[np.ndarray] = []
    with rm.Renderer((16, 9), context=egl) as renderer:
        here = renderer.render(SCENE).color
        thread = threading.Thread(target=lambda: found.append(renderer.render(SCENE).color))
        thread.start()
        thread.join()
        np.testing.assert_array_equal(found[0], here)


def test_show_opens_the_viewer_or_says_why_not(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Image.Image] = []
    monkeypatch.setattr(Image.Image, "show", lambda picture: shown.append(picture))
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(rm.SceneError, match=r"no display \(rm.render\(scene\).save"):
        SCENE.show((16, 9))
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert SCENE.show((16, 9)) is shown[0] and shown[0].size == (16, 9)
    notebook = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=None))
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    assert SCENE.show((16, 9)).size == (16, 9) and len(shown) == 1
