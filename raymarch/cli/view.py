"""`raymarch view`: the live window."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import Annotated

import typer

from raymarch.cli.common import CommandError, NoMeasured, SceneFile, Settings, errors, parse_settings, parse_size
from raymarch.cli.presets import Preset, check_preset
from raymarch.files import check_apart, read_json, reading

SLOW = 2.0
"""Seconds after which the start is reported: a scene file may take long, or never end."""


@contextmanager
def _said_if_slow(text: str) -> Iterator[None]:
    """Print a line on the error stream if the block takes longer than `SLOW`."""
    timer = Timer(SLOW, lambda: errors.say(text))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def run(
    scene: SceneFile,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height of the window.")] = "960x540",
    set_: Settings = None,
    time: Annotated[float | None, typer.Option(help="Value of `time` at the start, in seconds.")] = None,
    quality: Preset = None,
    budget: Annotated[
        float, typer.Option(metavar="MS", help="Frame time while something moves, in milliseconds.")
    ] = 33.0,
    samples: Annotated[int, typer.Option(min=1, max=4096, help="Rays per pixel of a still picture.")] = 16,
    panel: Annotated[bool, typer.Option(help="Show the panel at the start, if its extra is installed.")] = True,
    settings: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Load camera, parameters, time and view that the window saved.")
    ] = None,
    cost: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Measurements of raymarch cost --json: X goes from fast to exact by them."),
    ] = None,
    osc: Annotated[
        str | None,
        typer.Option(
            metavar="PORT", help="Set parameters by OSC messages: /NAME VALUE, by UDP. ADDRESS:PORT for others."
        ),
    ] = None,
    midi: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Set parameters by the controllers of a MIDI input; 'virtual' makes one."),
    ] = None,
    demo_seconds: Annotated[
        float | None,
        typer.Option(metavar="N", help="Close after N seconds; exit with code 2 if the scene has an error."),
    ] = None,
    log: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write events as lines of JSON, for scripts.")
    ] = None,
    no_measured: NoMeasured = False,
) -> None:
    _check(budget, demo_seconds, time)
    check_apart([os.path.abspath(file) for file in (scene, settings, cost) if file is not None], [log], CommandError)
    from raymarch.window.accuracy import MEASURED, Stop, measured_stops
    from raymarch.window.outside import listening
    from raymarch.window.viewer import Viewer  # imports glfw: only when a window opens

    stops: tuple[Stop, ...] = ()
    if cost is not None:
        measured = read_json("--cost", cost, MEASURED, CommandError)
        with reading("--cost", cost, MEASURED, CommandError):
            stops = measured_stops(measured)
    check_preset(quality)
    params, shape = parse_settings(set_ or []), parse_size(size)
    outside = listening(osc, midi)
    try:
        with _said_if_slow(f"loading {scene} (Ctrl+C to stop)"):
            viewer = Viewer(scene, shape, params, budget, settings, log, samples, panel, stops, time, outside, quality)
        code = viewer.run(demo_seconds)
    finally:
        outside.close()
    if code == 2 and viewer.model.fault is not None:  # the message in the window is gone
        errors.say(viewer.model.fault.text())
    sys.exit(code)


def _check(budget: float, demo_seconds: float | None, time: float | None) -> None:
    if not 1.0 <= budget <= 10_000.0:
        raise CommandError(f"--budget {budget:g}", legal="1 to 10000 milliseconds")
    if demo_seconds is not None and not 0.0 <= demo_seconds <= 86_400.0:
        raise CommandError(f"--demo-seconds {demo_seconds:g}", legal="0 to 86400")
    if time is not None and not math.isfinite(time):
        raise CommandError(f"--time {time:g}", legal="a finite number of seconds")
