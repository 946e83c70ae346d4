"""Changes of the scene by a reload or an edit: a new scene is drawn before it replaces the old one."""

from __future__ import annotations

import time as clock_time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from raymarch.errors import RaymarchError
from raymarch.window.edits import Edits
from raymarch.window.overlay import Message
from raymarch.window.reload import Failed, Fault, Loaded, Started, Watching

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer


def take_news(viewer: Viewer, now: float) -> None:
    """Handle the results of threads since the last turn of the loop."""
    for news in viewer.reloader.latest():
        if isinstance(news, Started):
            viewer.reloading = now
            viewer.log.say("reloading")
        elif isinstance(news, Watching):
            viewer.log.say("watching", files=news.files)
        elif isinstance(news, Failed):
            viewer.reloading = None
            _fail(viewer, news.fault)
        else:
            _swap(viewer, news, now)
    found = viewer.inquiry.latest()
    if found is not None and viewer.pick is not None and found.number == viewer.pick.number:
        viewer.pick = found
        where = found.where
        viewer.log.say(
            "truth",
            part=found.part,
            file=where.file if where else None,
            line=where.line if where else None,
            distance=found.true,
            trouble=found.trouble,
        )


def _swap(viewer: Viewer, news: Loaded, now: float) -> None:
    """Draw the new scene, and replace the old one if that succeeds."""
    before = replace(viewer.state, params=dict(viewer.state.params))
    compiled = viewer.renderer.compiled
    try:
        scene = viewer.edits.apply(news.scene)
        changes = viewer.state.adopt(scene, scene.parameters)
        if scene is news.scene:
            viewer.renderer.adopt(viewer.state.progressive, news.prepared)
        else:
            _overlay(viewer)
        start = clock_time.perf_counter()
        viewer.picture.step(viewer.state.shot(), viewer.screen.size, False)
        first = 1e3 * (clock_time.perf_counter() - start)
    except RaymarchError as fault:
        viewer.state = before
        trouble(viewer, fault)
        return
    viewer.state.file, viewer.base, viewer.fault, viewer.pick = news.file, news.scene, None, None
    viewer.window.title(titled(news.file))
    for text in changes:
        viewer.notice(text)
    compile_ms = viewer.picture.drawn.compile
    parts = {**news.ms, "compile": compile_ms, "first frame": first - compile_ms}
    total = None if viewer.reloading is None else 1e3 * (clock_time.perf_counter() - viewer.reloading)
    viewer.changed_at, viewer.reloading = now, None
    viewer.present()
    viewer.log.say("loaded", ms=parts, total=total, compiled=viewer.renderer.compiled - compiled)
    viewer.tell_frame()


def change(viewer: Viewer, edits: Edits) -> None:
    """Apply edits to the scene, if the result can be drawn."""
    before, viewer.wanted = replace(viewer.state, params=dict(viewer.state.params)), None
    try:
        scene = edits.apply(viewer.base)
        viewer.state.adopt(scene, scene.parameters)
        if not edits.empty:
            _overlay(viewer)
        viewer.picture.step(viewer.state.shot(), viewer.screen.size, False)
    except RaymarchError as fault:
        viewer.state = before
        viewer.notice(f"not possible: {fault.what}")
        return
    viewer.edits, viewer.changed_at = edits, clock_time.perf_counter()
    lights = None if edits.lights is None else [light.kind for light in edits.lights]
    viewer.log.say("edited", lights=lights, materials=sorted(edits.materials), quality=edits.quality)
    if viewer.panel is not None:
        viewer.panel.active = 3
    viewer.present()


def _overlay(viewer: Viewer) -> None:
    """Prepare a scene with edits. It had no trial, so it is compiled here."""
    shown = viewer.state.progressive
    ready, _ = viewer.overlaid.fit(viewer.renderer.prepared(shown))
    viewer.renderer.adopt(shown, ready)
    if not viewer.renderer.resources.knows(ready):
        viewer.announce(Message("compiling", "busy", "bottom left"))


def _fail(viewer: Viewer, fault: Fault) -> None:
    viewer.fault = fault
    viewer.log.say("failed", what=fault.what, legal=fault.legal, file=fault.file, line=fault.line)


def trouble(viewer: Viewer, fault: RaymarchError) -> None:
    """Report a scene that loads but cannot be drawn."""
    where = fault.where
    found = Fault(fault.what, fault.legal, where.file if where else None, where.line if where else None)
    if found != viewer.fault:
        _fail(viewer, found)


def titled(file: Path) -> str:
    """The title of the window."""
    return f"raymarch: {file.name} (H: keys)"
