"""The panel by events of its toolkit, without a window: what its items do to the model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.prepare import prepare
from raymarch.window import commands as do
from raymarch.window.model import Copy, Measure, Model, SavePicture, Show
from raymarch.window.panel import Panel
from raymarch.window.theme import apply_theme
from tests.window.test_commands import carried_out, model_of, text_of

SCENE = """import raymarch as rm
RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
TINT = rm.Param("tint of a very long name indeed", (0.8, 0.2, 0.1), 0, 1)
ball = rm.sphere(RADIUS).material(rm.Material(color=TINT))
glass = rm.box((4, 0.2, 4)).material(rm.Material(albedo=(0.5, 0.6, 0.7), roughness=0.2))
scene = rm.Scene(ball | glass.translate((0.2 * rm.time, -1.2, 0)), rm.Camera((0, 1, 6), (0, 0, 0)),
    lights=[rm.Sun((0, 1, 0), intensity=1 + 0.1 * rm.time), rm.PointLight((1, 3, 2), shadow=True)])
"""


class Shown:
    """A panel in a context of its toolkit that draws nothing."""

    def __init__(self, model: Model, imgui: Any) -> None:
        self.model, self._imgui = model, imgui
        self._context = imgui.create_context()
        self._io = imgui.get_io()
        self._io.set_ini_filename("")
        self._io.display_size = imgui.ImVec2(640, 1600)
        self._io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
        apply_theme(imgui, 1.0)
        self.panel = Panel(imgui, model)
        self.frame(2)

    def frame(self, count: int = 1) -> None:
        for _ in range(count):
            self._imgui.new_frame()
            self.panel.draw()
            self._imgui.render()

    @property
    def items(self) -> dict[str, tuple[int, int]]:
        said: Any = self.model.log
        return [facts["at"] for event, facts in said.events if event == "items"][-1]

    def click(self, *names: str) -> None:
        for name in names:
            self.drag(name, 0, 0)

    def drag(self, name: str, start: int, end: int, down: int = 0) -> None:
        x, y = self.items[name]
        for event in (
            lambda: self._io.add_mouse_pos_event(x + start, y + down),
            lambda: self._io.add_mouse_button_event(0, True),
            lambda: self._io.add_mouse_pos_event(x + end, y + down),
            lambda: self._io.add_mouse_button_event(0, False),
        ):
            event()
            self.frame(2)

    def close(self) -> None:
        self._io.backend_flags &= ~self._imgui.BackendFlags_.renderer_has_textures
        self._imgui.destroy_context(self._context)


@pytest.fixture
def shown() -> Iterator[Shown]:
    imgui = pytest.importorskip("imgui_bundle").imgui
    model = model_of(SCENE, panel=True)
    model.size = (640, 1600)
    model.plan = prepare(model.state.progressive, size=(32, 20)).plan
    made = Shown(model, imgui)
    yield made
    made.close()


def test_parameters(shown: Shown) -> None:
    model = shown.model
    shown.drag("radius", -60, 20)
    assert model.state.value("radius") > 1.3 and not model.requests
    shown.click("copy parameters")
    assert isinstance(copied := model.requests.pop(), Copy) and copied.text.startswith('rm.Param("radius", ')
    shown.click("defaults")
    assert not model.state.params
    # The label of a long name stands above its field, so that both can be read.
    assert shown.items["tint of a very long name indeed"][1] - shown.items["radius"][1] > 30


def test_view_time_and_camera(shown: Shown) -> None:
    model = shown.model
    shown.click("view")
    shown.drag("view", 0, 0, down=44)  # the second of the list
    assert model.state.view == "depth"
    shown.click("beside")
    shown.drag("beside", 0, 0, down=66)
    assert model.compare.side == "truth"
    shown.click("errors")
    assert model.compare.over == "errors"
    shown.click("proof")
    assert model.compare.over == "proof"
    shown.click("save PNG")
    assert isinstance(model.requests.pop(), SavePicture)
    shown.click("pause")
    assert not model.state.timeline.playing
    shown.drag("time", -20, 20)
    assert model.state.timeline.time > 1.0
    shown.click("Camera")
    shown.click("copy camera")
    assert isinstance(copied := model.requests.pop(), Copy) and copied.text.startswith("rm.Camera(")


def test_every_field_of_a_light(shown: Shown) -> None:
    """Two lights with all that they may have; what is copied runs and gives the same lights."""
    model = shown.model
    shown.click("Lights", "edit lights")
    carried_out(model)
    shown.frame(2)
    for name in ("set radius 2", "set range 2", "set shadow_radius 2", "set attenuation 2", "shadow 1"):
        shown.click(name)
        carried_out(model)
        shown.frame(2)
    shown.click("penumbra 2")
    shown.drag("penumbra 2", 0, 0, down=44)
    carried_out(model)
    shown.frame(2)
    shown.drag("light 2 radius", -30, 10)
    assert "light 1 intensity" not in shown.items  # an expression of the file
    shown.click("add RectLight")
    carried_out(model)
    shown.frame(2)
    for name in ("set up 3", "set target 3", "set direction 3", "set target 3"):
        shown.click(name)
        carried_out(model)
        shown.frame(2)
    shown.drag("light 3 up", -20, -60)
    shown.drag("light 3 target", -20, -60)
    point, rect = model.state.scene.lights[1:]
    assert isinstance(point, rm.PointLight) and point.shadow and point.soft and point.penumbra == "cone"
    assert None not in (point.range, point.shadow_radius, point.attenuation, rect.up, rect.target)
    do.copy_edits(model)
    names: dict[str, Any] = {"rm": rm, "scene": model.state.base}
    exec(model.requests.pop().text, names)  # type: ignore[union-attr]
    values = model.state.values
    for made, seen in zip(names["scene"].lights, model.state.scene.lights, strict=True):
        for name, value in made.arguments().items():
            same = seen.arguments()[name]
            assert value == same or np.allclose(values.of(value), values.of(same), atol=1e-5), name
    shown.frame(2)
    shown.click("remove 3")
    carried_out(model)
    shown.frame(2)
    shown.click("drop lights")
    assert carried_out(model).state.edits.empty


def test_every_field_of_a_material(shown: Shown) -> None:
    model = shown.model
    shown.click("Materials", "edit material 2")
    carried_out(model)
    shown.frame(2)
    more = ("transmission", "ior", "absorption", "clearcoat", "clearcoat_roughness", "occlusion")
    for name in more:
        shown.click(f"set material 2 {name}")
        carried_out(model)
        shown.frame(2)
    shown.drag("material 2 roughness", -20, 40)
    assert model.state.value("material 2 roughness") > 0.3
    made = model.state.scene.materials[2]
    assert made.transmits and made.coated and {*more} <= {n for n, v in made.arguments().items() if v is not None}
    shown.click("copy materials")
    text = model.requests.pop().text  # type: ignore[union-attr]
    assert "in place of" in text
    names: dict[str, Any] = {"rm": rm, "scene": model.state.base}
    exec(text, names)
    for name in ("roughness", *more):
        value = getattr(made, name)
        assert np.allclose(model.state.values.of(value), getattr(names["material_2"], name).data, atol=1e-5), name
    # A material with a parameter of the file is read from the scene.
    shown.click("edit material 1")
    carried_out(model)
    do.set_param(model, "material 1 specular", 0.75)
    do.copy_edits(model)
    exec(model.requests.pop().text, names)  # type: ignore[union-attr]
    assert float(names["material_1"].specular.data) == 0.75


def test_quality_frame_and_plan(shown: Shown) -> None:
    model = shown.model
    shown.click("Quality")
    shown.drag("accuracy", 0, 60)
    model.requests.clear()
    shown.click("quality tracer")
    shown.drag("quality tracer", 0, 0, down=44)
    assert carried_out(model).state.edits.quality["tracer"] != "auto"
    shown.frame(2)
    shown.click("copy quality")
    names: dict[str, Any] = {"rm": rm, "scene": model.state.base}
    exec(model.requests.pop().text, names)  # type: ignore[union-attr]
    assert names["scene"].quality == model.state.scene.quality
    shown.click("drop quality")
    carried_out(model)
    shown.frame(2)
    model.drawn.whole = True
    shown.click("Frame", "Plan")
    assert Measure() in model.requests and "not possible" not in text_of(model)
    assert not [r for r in model.requests if isinstance(r, Show)]
