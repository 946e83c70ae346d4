"""Commands, keys and gestures of the mouse: what they do to the model. Without a display."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import Location, SceneError
from raymarch.gpu.prepare import prepare
from raymarch.gpu.views import VIEWS
from raymarch.window import commands as do
from raymarch.window import inputs
from raymarch.window.edits import Edits, editable_lights
from raymarch.window.events import Button, Drop, Key, Move, Scroll
from raymarch.window.inputs import Mouse, flying
from raymarch.window.messages import messages_of
from raymarch.window.model import (
    Close,
    Copy,
    Drawn,
    Inspect,
    Interrupt,
    Measure,
    Model,
    Open,
    SavePicture,
    Show,
    Verdicts,
)
from raymarch.window.news import Failed, Fault, Loaded, Started, Watching
from raymarch.window.pick import Pick
from raymarch.window.state import opened
from tests.window.ball import SCENE, scene_of

FILE = Path("scene.py")


class Said:
    """A log that keeps its events."""

    def __init__(self) -> None:
        self.events: list[tuple[str, dict[str, Any]]] = []

    def say(self, event: str, **facts: Any) -> None:
        self.events.append((event, facts))


@pytest.mark.parametrize(
    ("size", "density", "wide", "narrow"),
    [(960, 1.0, 300, 200), (600, 1.0, 240, 200), (480, 1.0, 200, 200), (300, 1.0, 180, 180), (960, 2.0, 400, 400)],
)
def test_the_panel_leaves_most_of_a_small_window_to_the_picture(size, density, wide, narrow):
    model = model_of(panel=True, density=density)
    model.size = (size, 270)
    assert model.panel_width == wide and model.area == (size - wide, 270)
    model.narrow = True
    assert model.panel_width == narrow
    model.panel = False
    assert model.area == (size, 270)


def model_of(text: str = SCENE, **changes: Any) -> Model:
    log: Any = Said()
    return Model(opened(FILE, scene_of(text), {}, 1.6), log=log, size=(320, 200), **changes)


def press(model: Model, *names: str, shift: bool = False, control: bool = False) -> None:
    for name in names:
        inputs.press(model, Key(name, True, shift, control, 0))


def carried_out(model: Model) -> Show:
    """Take the one request to show a content, as the main loop does if it can be drawn."""
    (show,) = model.requests
    assert isinstance(show, Show)
    model.requests.clear()
    do.accept(model, show)
    return show


def text_of(model: Model) -> str:
    return "\n".join(message.text for message in messages_of(model, 0.0))


MOVING = SCENE.replace("ball | floor", "ball.translate((rm.time, 0, 0)) | floor")


def test_gestures_move_the_camera() -> None:
    model = model_of()
    mouse = Mouse(model)

    def drag(button: int = 0, shift: bool = False) -> tuple[bool, bool]:
        """Whether position and target of the camera were moved."""
        before = model.state.hold()
        mouse.take(Move(100, 100))
        mouse.take(Button(button, True, shift, False))
        mouse.take(Move(102, 101))  # not yet a drag
        assert model.state.hold().position is before.position
        mouse.take(Move(130, 110))
        mouse.take(Button(button, False, shift, False))
        after = model.state.hold()
        return not np.allclose(before.position, after.position), not np.allclose(before.target, after.target)

    assert drag() == (True, False)  # an orbit
    assert drag(shift=True) == drag(button=2) == (True, True)  # a pan
    assert drag(button=1) == (False, True)  # a turn
    distance = model.state.hold().distance
    mouse.take(Scroll(0, 2))
    assert np.isclose(model.state.hold().distance, 0.81 * distance) and model.state.moved and not model.requests
    press(model, "r")
    assert not model.state.moved and np.allclose(model.state.pose().position, (0, 1, 6))


def test_a_click_inspects_and_f_focuses() -> None:
    model = model_of()
    mouse = Mouse(model, pixel=lambda x, y: (2 * x, 2 * y))
    for event in (Move(10, 20), Button(0, True, False, False), Move(12, 21), Button(0, False, False, False)):
        mouse.take(event)
    mouse.take(Key("f", True, False, False, 0))
    assert list(model.requests) == [Inspect(24, 42), Inspect(24, 42, focus=True)]
    point = np.array([0.3, 0.2, 0.9])
    pick = Pick(1, (3, 4), 5.0, point, np.array([0.0, 0, 1]), 1, 20, 30)
    do.take_pick(model, pick, True)
    assert model.pick is None and np.allclose(model.state.hold().target, point)
    do.take_pick(model, pick, False)
    do.take_truth(model, replace(pick, number=2, part="other"))
    assert model.pick is pick
    do.take_truth(model, replace(pick, true=5.001, true_normal=pick.normal, part="sphere", where=Location("s.py", 4)))
    assert "sphere\ts.py:4" in text_of(model) and "0.001 apart" in text_of(model)
    do.take_pick(model, replace(pick, distance=np.inf), True)
    assert "nothing is under the cursor" in text_of(model)
    press(model, "escape")
    assert model.pick is None


def test_held_keys_fly() -> None:
    assert flying({"w", "d"}.__contains__) == (1, 1, 0)
    assert flying({"s", "q", "left_shift"}.__contains__) == (-4, 0, -4)
    assert flying({"s", "right_alt"}.__contains__) == (0, 0, 0)


def test_the_divider_of_a_split_picture_is_dragged() -> None:
    model = model_of(panel=True)
    model.size = (750, 400)
    assert model.area == (450, 400)
    mouse = Mouse(model)
    press(model, "k")
    assert model.compare.side == "exact" and model.divider == 525
    before = model.state.hold()
    for event in (Move(522, 90), Button(0, True, False, False), Move(595, 80), Button(0, False, False, False)):
        mouse.take(event)
    assert model.divider == 595 and model.state.hold().position is before.position
    do.set_divider(model, 10_000)
    assert 0.9 < model.compare.divider < 1
    press(model, "k")
    assert model.compare.side == "truth" and model.compare.reference
    assert "float64 reference, 0 % computed" in text_of(model)
    press(model, "k")
    assert model.compare.side == "off" and not model.compare.reference
    press(model, "o")
    assert model.compare.over == "errors" and model.compare.reference
    press(model, "t")
    assert model.compare.over == "proof" and not model.compare.reference and "proof of each hit" in text_of(model)
    press(model, "t")
    assert model.compare.over == "off"
    model.verdicts = Verdicts(99_999, 0, 1, 200_000)
    assert "proved: 99.99 %, 0 contradicted, 1 open; 50 % judged" in text_of(model)


def test_a_copied_camera_runs_as_it_is() -> None:
    model = model_of()
    press(model, "c")
    (copied,) = model.requests
    assert isinstance(copied, Copy)
    camera = eval(copied.text, {"rm": rm})
    assert np.allclose(camera.pose(model.state.values, None).position, (0, 1, 6)) and copied.text in text_of(model)


def test_views_go_round() -> None:
    model = model_of()
    seen = []
    for _ in VIEWS:
        press(model, "v")
        seen.append(model.state.shot().view)
    assert sorted(seen) == sorted(VIEWS) and seen[-1] == "final"
    press(model, "v", shift=True)
    assert model.state.view == list(VIEWS)[-1]


def test_keys_change_parameters() -> None:
    model = model_of()
    press(model, "right")  # none is selected
    assert not model.state.params
    press(model, "n", *["right"] * 5)
    assert np.isclose(model.state.value("radius"), 1.15) and "> radius\t1.15   (0.5 to 2)" in text_of(model)
    press(model, "left", shift=True)
    assert np.isclose(model.state.value("radius"), 1.147)
    press(model, *["right"] * 99)
    assert model.state.value("radius") == 2.0
    do.copy_params(model)
    assert model.requests[-1] == Copy('rm.Param("radius", 2, min=0.5, max=2)')
    press(model, "n")
    assert model.state.selected is None
    do.reset_params(model)
    assert model.state.value("radius") == 1.0 and not [r for r in model.requests if isinstance(r, Show)]
    none = model_of("import raymarch as rm\nscene = rm.Scene(rm.sphere())\n")
    press(none, "n")
    assert "no Param" in text_of(none)


def test_parameters_stand_in_the_order_of_the_file(tmp_path: Path) -> None:
    from raymarch.scene.file import load

    file = tmp_path / "scene.py"
    lines = [f'{name} = rm.Param("{name}", 1.0, 0.5, 2.0)' for name in ("third", "first", "second")]
    text = "\n".join(["import raymarch as rm", *lines, "ball = rm.sphere(first) | rm.box((second, third, 1))"])
    file.write_text(text + "\nscene = rm.Scene(ball, lights=[rm.Sun(intensity=0.5)])\n")
    scene = load(file)
    assert list(opened(file, scene, {}, 1.0).specs) == ["third", "first", "second"]
    edited, _ = opened(file, scene, {}, 1.0).with_scene(scene, Edits(lights=editable_lights(scene)))
    assert list(edited.specs)[:3] == ["third", "first", "second"] and "light 1 intensity" in edited.specs


def test_keys_change_the_time() -> None:
    model = model_of(MOVING)
    do.advance(model, 0.5)
    press(model, "space")
    do.advance(model, 0.5)
    assert model.state.shot().time == 0.5
    press(model, ".", ".")
    assert np.isclose(model.state.timeline.time, 17 / 30)
    press(model, ",", "home")
    assert model.state.timeline.time == 0.0
    do.scrub(model, 2.0)
    press(model, "l")
    assert model.state.timeline.loop == (0.0, 2.0)
    press(model, "l")
    assert model.state.timeline.loop is None
    still = model_of()
    press(still, "space")
    do.advance(still, 1.0)
    assert "does not depend on time" in text_of(still) and still.state.shot().time == 0.0


def test_accuracy_changes_the_quality_alone() -> None:
    model = model_of()
    press(model, "x")
    assert carried_out(model).state.scene.quality == rm.Quality.preset("fine")
    assert model.state.edits.quality and "fine: error up to" in text_of(model)
    press(model, "x", shift=True)
    carried_out(model)
    assert model.state.edits.empty and model.state.scene is model.state.base


def test_an_edit_is_accepted_or_refused() -> None:
    model = model_of()
    lights = editable_lights(model.state.base)
    do.edit(model, Edits(lights=lights))
    carried_out(model)
    do.set_param(model, "light 1 intensity", 0.25)
    do.copy_edits(model)
    names: dict[str, Any] = {"rm": rm, "scene": model.state.base}
    exec(model.requests.pop().text, names)  # type: ignore[union-attr]
    assert float(names["scene"].lights[0].intensity.data) == 0.25
    do.edit(model, replace(model.state.edits, quality={"max_steps": 0}))
    assert not model.requests and "not possible: " in text_of(model)
    do.edit(model, Edits(lights=()))
    show = model.requests.pop()
    assert isinstance(show, Show)
    do.refuse(model, show, SceneError("the driver gives up"))
    assert model.state.edits.lights == lights and "not possible: the driver gives up" in text_of(model)


def loaded(text: str, file: Path = FILE) -> Loaded:
    scene = scene_of(text)
    return Loaded(scene, prepare(scene, size=(32, 20)), file)


def test_a_reload_keeps_camera_parameters_and_edits() -> None:
    model = model_of()
    do.move(model, lambda view: replace(view, position=view.position + 1.0))
    do.set_param(model, "radius", 1.9)
    do.take_news(model, Started(FILE))
    assert model.trial is not None and "testing for" in messages_of(model, model.trial[1] + 1)[0].text
    before, camera = model.state, model.state.camera
    do.take_news(model, loaded(SCENE.replace("1.0, 0.5, 2.0", "1.0, 0.5, 1.5")))
    assert model.state is before  # until it is drawn
    assert carried_out(model).prepared is not None
    assert model.state.camera is camera and model.state.moved and model.state.value("radius") == 1.5
    assert "radius = 1.9 lies outside its new range; it is 1.5 now" in text_of(model) and model.trial is None
    do.edit(model, Edits(lights=()))
    carried_out(model)
    do.take_news(model, loaded(SCENE, Path("other.py")))
    show = carried_out(model)
    assert show.prepared is None and not model.state.scene.lights and model.state.file == Path("other.py")


def test_a_broken_file_leaves_the_picture_and_says_why(tmp_path: Path) -> None:
    model = model_of()
    before, fault = model.state, Fault("box: size = -1", "positive", str(tmp_path / "x.py"), 5)
    for _ in range(2):
        do.take_news(model, Started(FILE))
        do.take_news(model, Failed(fault))
    assert model.state is before and model.trial is None and "x.py:5\nbox: size = -1\n(positive)" in text_of(model)
    said: Any = model.log
    assert [event for event, _ in said.events].count("failed") == 1
    do.take_news(model, loaded(SCENE))
    show = model.requests.pop()
    assert isinstance(show, Show)
    do.refuse(model, show, SceneError("it cannot be compiled"))
    assert "it cannot be compiled" in text_of(model)
    do.take_news(model, loaded(SCENE))
    carried_out(model)
    assert model.fault is None and text_of(model) == ""
    do.take_news(model, Watching(("a.py",)))
    assert said.events[-1] == ("watching", {"files": ("a.py",)})


def test_pictures_sequences_and_settings_are_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene-1.png").touch()
    model = model_of(MOVING)
    do.scrub(model, 0.1)
    press(model, "p")
    assert model.requests.pop() == SavePicture(Path("scene-2.png"), 0.1)
    press(model, "l")
    press(model, "p", shift=True)
    for i in range(3):
        do.continue_sequence(model)
        assert model.requests.pop() == SavePicture(Path(f"scene-1/frame-{i:04d}.png"), i / 30)
        do.saved(model, Path(f"scene-1/frame-{i:04d}.png"), None)
    assert model.sequence is None and "saved 3 pictures in scene-1" in text_of(model)
    press(model, "p", shift=True)
    do.saved(model, Path("scene-2/frame-0000.png"), SceneError("cannot write 'scene-2/frame-0000.png': no space"))
    assert model.sequence is None and "cannot write 'scene-2/frame-0000.png': no space" in text_of(model)
    press(model, "p", shift=True)
    press(model, "escape")
    assert model.sequence is None and "stopped after 0 pictures" in text_of(model)
    press(model, "s", control=True)
    settings = json.loads((tmp_path / "scene-1.view.json").read_text())
    again = model_of(MOVING)
    again.state.restore(settings)
    assert again.state.settings() == settings and again.state.timeline.time == model.state.timeline.time


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("camera",), [1]),
        (("camera", "position"), [0.0, 0.0, 1e300]),
        (("camera", "position"), ["0", 1.0, 2.0]),
        (("camera", "position"), 3.0),
        (("camera", "fov"), "45"),
        (("params",), []),
        (("time",), True),
        (("time",), 10**400),
        (("view",), ["color"]),
    ],
)
def test_hostile_settings_are_refused(path: tuple[str, ...], value: Any) -> None:
    model = model_of(MOVING)
    settings = copy.deepcopy(model.state.settings())
    *parents, last = path
    at = settings
    for name in parents:
        at = at[name]
    at[last] = value
    with pytest.raises(SceneError):
        model.state.restore(settings)


def test_other_keys_ask_the_main_loop() -> None:
    model = model_of()
    press(model, "f5", "escape", "tab")
    press(model, "q", control=True)
    assert list(model.requests) == [Open(), Interrupt(), Close()]
    assert "pip install imgui-bundle" in text_of(model)  # there is no panel
    model.panel = False
    press(model, "tab", "h")
    assert model.panel and messages_of(model, 0.0)[0].corner == "middle" and "wheel" in text_of(model)
    press(model, "f1")
    assert not model.help
    mouse = Mouse(model)
    model.requests.clear()
    mouse.take(Drop((Path("a.txt"), Path("b.py"))))
    mouse.take(Drop((Path("a.txt"),)))
    assert list(model.requests) == [Open(Path("b.py"))] and "drop a scene file" in text_of(model)


def test_a_measurement_is_asked_for_once_a_picture() -> None:
    model = model_of()
    do.measure(model)
    assert not model.requests  # the picture is not complete
    model.drawn = Drawn(whole=True)
    do.measure(model)
    do.measure(model)
    assert list(model.requests) == [Measure()]
    model.requests.clear()
    model.evaluations = (model.state.shot(), 12.0)
    do.measure(model)
    assert not model.requests
    do.move(model, lambda view: replace(view, position=view.position + 1.0))
    do.measure(model)
    assert list(model.requests) == [Measure()] and model.evaluations is None


def test_a_value_out_of_its_range_is_said() -> None:
    text = SCENE.replace("    camera=", '    lights=[rm.Sun(rm.Param("sun", (0, 1, 0)))],\n    camera=')
    model = model_of(text)
    model.plan = prepare(model.state.progressive, size=(32, 20)).plan
    assert text_of(model) == ""
    do.set_param(model, "sun", (0, 0, 0))
    (message,) = messages_of(model, 0.0)
    assert "Sun: sun_direction" in message.text and message.kind == "busy"


@pytest.mark.parametrize("change", [lambda m: do.set_param(m, "no", 1), lambda m: do.set_param(m, "radius", (1, 2))])
def test_a_wrong_parameter_is_an_error(change: Callable[[Model], None]) -> None:
    with pytest.raises(SceneError, match="parameter"):
        change(model_of())


def test_pictures_are_saved_in_a_chosen_size() -> None:
    model = model_of()
    for chosen, size in (("as shown", None), ("2 x", (640, 400)), ("1920x1080", (1920, 1080))):
        model.saved_size = chosen
        press(model, "p")
        request = model.requests.pop()
        assert isinstance(request, SavePicture) and request.size == size
