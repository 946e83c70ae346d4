"""The views of `raymarch render --view`: those of the GPU, those that need the reference, and their colour bars."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.cli.common import CommandError
from raymarch.export.stills import Shown, view_of
from raymarch.gpu.frame import Frame
from raymarch.gpu.prepare import Wanted
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.scale import with_bar
from raymarch.gpu.slices import Slice
from raymarch.gpu.views import VIEWS
from raymarch.scene.scene import Scene

CHOICES: Mapping[str, tuple[str, ...]] = {
    **VIEWS,
    "error": ("depth",),
    "nonfinite": ("color",),
    "lipschitz": ("color",),
}
"""The arrays that each view needs."""


def shown(
    renderer: Renderer,
    frame: Frame,
    view: str,
    scene: Scene,
    params: Mapping[str, Any],
    progress: Callable[[float], None] | None = None,
) -> Shown:
    """A view of a frame that a renderer has just drawn. `progress` is called with the fraction of a probe that is
    done."""
    if view in ("nonfinite", "lipschitz"):
        return _probed(renderer, view, scene, frame.time, params, progress)
    if view == "error":
        return _compared(frame, scene, params)
    return view_of(frame, view, scene)


def _probed(
    renderer: Renderer,
    view: str,
    scene: Scene,
    time: float,
    params: Mapping[str, Any],
    progress: Callable[[float], None] | None,
) -> Shown:
    from raymarch.gpu import probe, reports  # only these views use them
    from raymarch.gpu import probe_pictures as pictures

    if view == "nonfinite":
        faults = probe.find_faults(renderer, scene, time, params, progress)
        lines = reports.summary(faults.reports)
        return Shown(partial(pictures.fault_picture, faults), partial(pictures.fault_numbers, faults), lines)
    slopes = probe.find_slopes(renderer, scene, time, params, progress)
    lines = reports.summary(slopes.reports)
    return Shown(partial(pictures.slope_picture, slopes), partial(pictures.slope_numbers, slopes), lines)


def _compared(frame: Frame, scene: Scene, params: Mapping[str, Any]) -> Shown:
    from raymarch.cost import maps  # only this view uses the reference

    def image() -> Image.Image:
        return with_bar(maps.error_picture(maps.errors_of(frame, scene, params)), maps.ERROR_SCALE)

    def numbers() -> NDArray[np.float32]:
        errors = maps.errors_of(frame, scene, params)
        return np.repeat(errors[..., None], 3, axis=-1).astype(np.float32)

    return Shown(image, numbers)


def check_view(view: str, slice_: str | None) -> tuple[Wanted, ...]:
    """The arrays that a view needs, with the plane of --slice. CommandError for an invalid plane or view."""
    if view not in CHOICES:
        raise CommandError(f"--view {view}", legal=", ".join(CHOICES))
    if slice_ is None:
        return CHOICES[view]
    if view != "slice":
        raise CommandError(f"--slice together with --view {view}", legal="--view slice")
    return (parse_slice(slice_),)


def parse_slice(text: str) -> Slice:
    """Parse a plane: "y=0.5", or a normal and an offset, "1,0,1=0.5"."""
    side, equals, offset = text.partition("=")
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    try:
        normal = axes.get(side.strip()) or tuple(float(part) for part in side.split(","))
        x, y, z = normal
        if not equals or not np.all(np.isfinite([x, y, z, float(offset)])) or (x, y, z) == (0.0, 0.0, 0.0):
            raise ValueError
        return Slice((x, y, z), float(offset))
    except ValueError:
        raise CommandError(
            f"--slice {text}", legal="x, y or z, or a normal such as 1,0,1, then = and a number: y=0.5"
        ) from None
