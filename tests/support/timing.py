"""Times of frames, for the drivers of tests/lab."""

from __future__ import annotations

import time
from collections.abc import Mapping

import raymarch as rm


def frame_times(renderer: rm.Renderer, scenes: Mapping[str, rm.Scene], frames: int) -> dict[str, list[float]]:
    """Milliseconds of CPU time of some frames of each scene, drawn in turn and read back."""
    times: dict[str, list[float]] = {name: [] for name in scenes}
    for _ in range(frames):
        for name, scene in scenes.items():
            begin = time.process_time()
            _ = renderer.render(scene).color
            times[name].append(1e3 * (time.process_time() - begin))
    return times
