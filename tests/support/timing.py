"""Times of frames, for the drivers of tests/lab."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import raymarch as rm
from raymarch.gpu.context import Context


def frame_times(renderer: rm.Renderer, scenes: Mapping[str, rm.Scene], frames: int) -> dict[str, list[float]]:
    """Milliseconds of CPU time of some frames of each scene, drawn in turn and read back."""
    times: dict[str, list[float]] = {name: [] for name in scenes}
    for _ in range(frames):
        for name, scene in scenes.items():
            begin = time.process_time()
            _ = renderer.render(scene).color
            times[name].append(1e3 * (time.process_time() - begin))
    return times


def cpu_time(context: Context, draw: Callable[[], object]) -> float:
    """Milliseconds of CPU time until the device is idle."""
    context.finish()
    begin = time.process_time()
    draw()
    context.finish()
    return 1e3 * (time.process_time() - begin)
