"""The commands: everything that changes the model. Keyboard, mouse, panel and file reloads all go through them."""

from __future__ import annotations

import json
import time as clock_time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from raymarch.errors import RaymarchError, SceneError
from raymarch.export.film import check_film
from raymarch.files import install, written
from raymarch.gpu.views import VIEWS
from raymarch.window import control
from raymarch.window.accuracy import next_stop
from raymarch.window.control import View
from raymarch.window.edits import Edits, params_as_python
from raymarch.window.model import (
    SIDES,
    Close,
    Copy,
    Edit,
    Inspect,
    Interrupt,
    Measure,
    Model,
    Open,
    SavePicture,
    Series,
    Show,
    WriteFilm,
    next_of,
)
from raymarch.window.news import Failed, Fault, Loaded, News, Started, Watching
from raymarch.window.pick import Pick
from raymarch.window.timeline import Timeline
from raymarch.window.undo import redo as redo
from raymarch.window.undo import remember
from raymarch.window.undo import undo as undo
from raymarch.window.writing import write_values as write_values

STEP = 0.02
"""Step of an arrow key as a fraction of the parameter's range; a tenth of it with Shift."""

SECONDS = 2.0
"""Length of a saved sequence in seconds if no loop is set."""

HINT = f"{install('view')} for the panel with sliders and editors"

# The camera


def move(model: Model, movement: Callable[..., View], *by: Any) -> None:
    """Move the camera by a function of `control`."""
    model.state.move(movement(model.state.hold(), *by))


def reset_camera(model: Model) -> None:
    model.state.reset()


def copy_camera(model: Model) -> None:
    copy(model, control.as_python(model.state.hold()), "")


def copy(model: Model, text: str, nothing: str, apart: str = " ") -> None:
    """Put text on the clipboard, or say why there is none."""
    if text:
        model.request(Copy(text))
    model.notice(f"copied{apart}{text}" if text else nothing)


# The time


def change_time(model: Model, change: Callable[[Timeline], Timeline]) -> None:
    """Play, pause, step or jump: apply a method of the timeline."""
    line = model.state.timeline = change(model.state.timeline)
    model.say("time", time=line.time, playing=line.playing)
    if not model.state.animated:
        model.notice("this scene does not depend on time")


def advance(model: Model, seconds: float) -> None:
    """Advance the time of a scene that depends on it."""
    if model.state.animated:
        model.state.timeline = model.state.timeline.advance(seconds)


def set_timeline(model: Model, line: Timeline) -> None:
    model.state.timeline = line


def scrub(model: Model, time: float) -> None:
    model.state.timeline = model.state.timeline.scrub(time)
    model.say("scrub", time=model.state.timeline.time)


def toggle_loop(model: Model) -> None:
    """Loop from 0 to the current time, or stop looping."""
    now, line = model.state.timeline.time, model.state.timeline
    loop = None if line.loop is not None or now <= 0 else (0.0, now)
    model.state.timeline = line.looping(loop)
    model.notice("no loop" if loop is None else f"loop: 0 to {now:.3g} s")


# Views and accuracy


def set_view(model: Model, name: str) -> None:
    model.state.view = name
    model.say("view", name=name)


def next_view(model: Model, step: int) -> None:
    """Show the next array."""
    set_view(model, next_of(list(VIEWS), model.state.view, step))
    model.notice(f"view: {model.state.view}")


def approach(model: Model, number: int) -> None:
    """Change to one of the stops between fast and exact."""
    stop = model.stops[number]
    edit(model, replace(model.state.edits, quality=stop.changes(model.state.base.quality)))
    model.say("stop", name=stop.name, error=stop.error)


def change_accuracy(model: Model, step: int) -> None:
    number = next_stop(model.stops, model.state.scene.quality, step)
    approach(model, number)
    model.notice(model.stops[number].words)


def set_side(model: Model, side: str) -> None:
    """Split the picture: the right side shows the most exact setting or the reference."""
    model.compare.side = side
    model.say("compare", side=side, over=model.compare.over)


def next_side(model: Model, step: int) -> None:
    """Show the next right side of the split picture."""
    set_side(model, next_of(SIDES, model.compare.side, step))
    side = model.compare.side
    words = {"off": "no comparison", "exact": model.stops[-1].words, "truth": "the float64 reference, tile by tile"}
    model.notice(words[side] if side == "off" else f"right side: {words[side]}")


def toggle_over(model: Model, what: str) -> None:
    """Show one of `OVER` over the picture, or hide it."""
    model.compare.over = "off" if model.compare.over == what else what
    model.say("compare", side=model.compare.side, over=model.compare.over)
    words = {
        "off": "nothing over the picture",
        "errors": "errors against the float64 reference, tile by tile",
        "proof": "the proof of each hit, tile by tile: green proved, red contradicted, yellow open",
    }
    model.notice(words[model.compare.over])


def set_divider(model: Model, x: float) -> None:
    """Move the divider of a split picture to a column of the window, in pixels."""
    width, _ = model.area
    model.compare.divider = float(np.clip((x - model.panel_width) / max(width, 1), 0.02, 0.98))


def set_pace(model: Model, budget: float | None = None, samples: int | None = None) -> None:
    """Change the time of a frame in milliseconds, or the rays per pixel of a still picture."""
    model.budget = model.budget if budget is None else float(budget)
    model.samples = model.samples if samples is None else int(samples)


# Parameters


def set_param(model: Model, name: str, value: Any) -> None:
    """Set a parameter, clamped to its range."""
    remember(model, name)
    model.listed_at = clock_time.perf_counter()
    model.state.set(name, value)
    model.say("param", name=name, value=model.state.value(name))


def reset_params(model: Model) -> None:
    remember(model, "all parameters")
    model.state.params.clear()


def reset_param(model: Model, name: str) -> None:
    """Set a parameter to its value in the file."""
    remember(model, f"{name} of the file")
    model.state.params.pop(name, None)
    model.say("param", name=name, value=model.state.value(name))


def select_param(model: Model, step: int) -> None:
    """Select the next parameter for the arrow keys; none after the last."""
    state, names = model.state, list(model.state.specs)
    if not names:
        model.notice("this scene has no Param")
        return
    at = -1 if state.selected is None else names.index(state.selected)
    at = at + step if state.selected is not None or step > 0 else len(names) - 1
    model.listed_at = clock_time.perf_counter()
    state.selected = names[at] if 0 <= at < len(names) else None


def nudge_param(model: Model, direction: int, fine: bool) -> None:
    """Change the selected parameter by a step."""
    name = model.state.selected
    if name is None:
        return
    spec, value = model.state.specs[name], np.asarray(model.state.value(name), np.float64)
    low, high = spec.ends
    span = np.where(np.isfinite(high - low), high - low, np.maximum(np.abs(value), 1.0))
    moved = value + direction * STEP * (0.1 if fine else 1.0) * span
    set_param(model, name, float(moved) if moved.shape == () else tuple(float(v) for v in moved))


def copy_params(model: Model) -> None:
    """Copy the changed parameters of the file as Python."""
    state = model.state
    changed = {name: value for name, value in state.params.items() if name in state.base.parameters}
    copy(model, params_as_python(state.specs, changed), "no parameter was changed", "\n")


# Edits and reloads


def edit(model: Model, edits: Edits) -> None:
    """Apply edits to the scene, if the result can be drawn."""
    try:
        state, _ = model.state.with_scene(model.state.base, edits)
    except RaymarchError as fault:
        model.notice(f"not possible: {fault.what}")
        return
    remember(model, "an edit")
    model.request(Show(state))


def copy_edits(model: Model) -> None:
    state = model.state
    copy(model, state.edits.python(state.base, dict(state.params)), "nothing was edited", "\n")


def take_news(model: Model, news: News) -> None:
    """Handle a report of the reloader."""
    if isinstance(news, Started):
        model.trial = (news.file, clock_time.perf_counter())
        model.say("reloading")
    elif isinstance(news, Watching):
        model.say("watching", files=news.files)
    elif isinstance(news, Failed):
        model.trial, model.closed = None, False
        report(model, news.fault)
    else:
        _load(model, news)


def _load(model: Model, news: Loaded) -> None:
    try:
        state, changes = replace(model.state, file=news.file).with_scene(news.scene, model.state.edits)
    except RaymarchError as fault:
        model.trial = None
        report(model, Fault.of(fault))
        return
    prepared = news.prepared if state.edits.empty else None
    model.request(Show(state, news, prepared, (*changes, *news.words)))


def accept(model: Model, show: Show) -> None:
    """The content of a request was drawn: it replaces the old one."""
    model.state, model.changed_at = show.state, clock_time.perf_counter()
    if show.loaded is not None:
        model.fault = model.pick = model.trial = None
        if show.changes:
            model.notice("\n".join(show.changes))
        return
    edits = show.state.edits
    lights = None if edits.lights is None else [light.kind for light in edits.lights]
    model.say("edited", lights=lights, materials=sorted(edits.materials), quality=edits.quality)


def warn(model: Model, words: Sequence[str]) -> None:
    """Show the warnings about lines of the scene file, if there are any."""
    if words:
        model.notice("\n".join(words))


def refuse(model: Model, show: Show, fault: RaymarchError) -> None:
    """The content of a request cannot be drawn: the old one stays."""
    if show.loaded is None:
        model.notice(f"not possible: {fault.what}")
    else:
        model.trial = None
        report(model, Fault.of(fault))


def report(model: Model, fault: Fault) -> None:
    """Show the error of a scene file."""
    if fault != model.fault:
        model.fault, model.closed = fault, False
        model.say("failed", what=fault.what, legal=fault.legal, file=fault.file, line=fault.line)


def reload(model: Model) -> None:
    model.request(Open())


def open_files(model: Model, files: Sequence[Path]) -> None:
    """Open the first scene file of some files."""
    scenes = [file for file in files if file.suffix == ".py"]
    if not scenes:
        model.notice("drop a scene file: Python that defines a `scene`")
        return
    model.request(Open(scenes[0]))
    model.say("dropped", file=str(scenes[0]))


# Inspection


def inspect(model: Model, x: float, y: float, focus: bool = False) -> None:
    """Ask what is visible at a cursor position, in pixels of the window; `focus` turns the camera to it."""
    model.request(Inspect(x, y, focus))


def take_pick(model: Model, pick: Pick | None, focus: bool) -> None:
    """Show what was found, or make it the target of the camera. None is outside of the picture."""
    if not focus:
        model.pick = pick
        if pick is not None:
            facts = {"distance": pick.distance, "material": pick.material, "evaluations": pick.evaluations}
            position = [float(v) for v in pick.position]
            model.say("pick", pixel=pick.pixel, position=position, normal=pick.normal.tolist(), **facts)
    elif pick is None or not np.isfinite(pick.distance):
        model.notice("nothing is under the cursor")
    else:
        move(model, control.focus, pick.position)
        model.say("focus", point=pick.position.tolist())


def take_truth(model: Model, pick: Pick) -> None:
    """Add the reference values to the pick that is shown."""
    if model.pick is None or model.pick.number != pick.number:
        return
    model.pick, where = pick, pick.where
    facts = {"file": where.file if where else None, "line": where.line if where else None, "trouble": pick.trouble}
    model.say("truth", part=pick.part, distance=pick.true, **facts)


def measure(model: Model) -> None:
    """Ask for the mean evaluations per pixel of the picture once it is complete, if they are not known."""
    shot = model.state.shot()
    if model.evaluations is not None and not shot.same(model.evaluations[0]):
        model.evaluations = None
    if model.evaluations is None and model.drawn.whole and Measure() not in model.requests:
        model.request(Measure())


# Files


def save_picture(model: Model, word: str = "") -> None:
    """Save the complete picture, without panel and messages. The notice of it ends with a word."""
    size = None if model.saved_size == "as shown" else model.saved_pixels
    model.request(SavePicture(_free(model, ".png"), model.state.timeline.time, size, word))


def save_film(model: Model) -> None:
    """Save the loop, or some seconds from the current time, as a film."""
    width, height = model.saved_pixels
    try:
        check_film(film := _free(model, ".mp4"), (width // 2 * 2, height // 2 * 2), model.state.timeline.fps)
    except SceneError as fault:
        model.notice(str(fault))
        return
    save_sequence(model, film)


def save_sequence(model: Model, film: Path | None = None) -> None:
    """Save a sequence: the loop if there is one, else some seconds from the current time.

    A still scene is one picture."""
    if not model.state.animated:
        save_picture(model, ": this scene does not depend on time, and one picture is all of it")
        return
    line = model.state.timeline
    first, last = line.loop or (line.time, line.time + SECONDS)
    folder = _free(model, "")
    try:
        folder.mkdir()
    except OSError as fault:
        model.notice(f"cannot make the folder {folder}: {fault.strerror}")
        return
    model.sequence = Series(folder, first, max(1, round((last - first) * line.fps)), line.fps, film=film)
    model.notice(f"saving {model.sequence.count} pictures in {film or folder} (Esc stops)")


def continue_sequence(model: Model) -> None:
    """Ask for the next picture of the sequence."""
    if (series := model.sequence) is not None:
        file = series.folder / f"frame-{series.done:04d}.png"
        size = None if model.saved_size == "as shown" else model.saved_pixels
        model.request(SavePicture(file, series.first + series.done / series.fps, size))


def saved(model: Model, file: Path, fault: SceneError | None = None, word: str = "") -> None:
    """A picture was saved, or could not be. The notice of it ends with a word."""
    series = model.sequence if model.sequence is not None and model.sequence.folder == file.parent else None
    if fault is not None:
        model.notice(fault.what)
        model.sequence = None if series else model.sequence
    elif series is None:
        model.notice(f"saved {file}{word}")
        model.say("saved", file=str(file))
    else:
        series.done += 1
        if series.done == series.count and series.film is not None:
            model.request(WriteFilm(series.folder, series.film, series.fps))
            model.sequence = None
        elif series.done == series.count:
            model.notice(f"saved {series.count} pictures in {series.folder}")
            model.say("saved", file=str(series.folder), count=series.count)
            model.sequence = None


def save_settings(model: Model) -> None:
    """Save the settings for `raymarch view --settings`."""
    file = _free(model, ".view.json")
    try:
        with written(file) as partial:
            partial.write_text(json.dumps(model.state.settings(), indent=2) + "\n", encoding="utf-8")
    except SceneError as fault:
        saved(model, file, fault)
    else:
        saved(model, file)


def _free(model: Model, ending: str) -> Path:
    """An unused file name in the current folder."""
    names = (Path(f"{model.state.file.stem}-{i}{ending}") for i in count(1))
    return next(name for name in names if not name.exists())


# The window


def toggle_help(model: Model) -> None:
    model.help = not model.help


def toggle_panel(model: Model) -> None:
    """Show or hide the panel."""
    if model.panel is None:
        model.notice(HINT)
    else:
        model.panel = not model.panel
        model.say("panel", shown=model.panel)


def toggle_width(model: Model) -> None:
    """Make the panel narrow or wide."""
    model.narrow = not model.narrow
    model.say("panel", narrow=model.narrow)


def escape(model: Model) -> None:
    """Stop a running trial or sequence, and close messages."""
    model.request(Interrupt())
    model.closed = model.trial is None
    model.notice_text = ""
    if model.sequence is not None:
        model.notice(f"stopped after {model.sequence.done} pictures")
        model.sequence = None
    model.pick, model.help, model.state.selected, model.draft = None, False, None, None


def open_editor(model: Model) -> None:
    """Open the line of the error, else that of the picked point, in the editor."""
    fault, where = model.fault, model.pick.where if model.pick is not None else None
    if fault is not None and fault.file is not None and not model.closed:
        model.request(Edit(Path(fault.file), fault.line or 1))
    elif where is not None:
        model.request(Edit(Path(where.file), where.line))
    else:
        model.request(Edit(model.state.file, 1))


def close(model: Model) -> None:
    model.request(Close())
