"""All arrays of a frame in one file: NumPy's .npz, or OpenEXR with named layers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.frame import Frame
from raymarch.plan import OUTPUTS
from raymarch.scene.images import write_channels

ARRAYS = tuple(name for name in OUTPUTS if name not in ("slice", "cycles"))
"""The arrays of a frame that every driver can draw, and that have no parameter."""


def write_npz(file: Path, frame: Frame) -> None:
    """A compressed .npz with all arrays by name, the time, and the pose of the camera."""
    arrays: dict[str, NDArray[np.generic]] = {name: frame.array(name) for name in ARRAYS}
    arrays["time"] = np.float64(frame.time)  # type: ignore[assignment]
    if frame.pose is not None:
        arrays |= {"camera_position": frame.pose.position, "camera_frame": frame.pose.frame}
        half = frame.pose.half_height
        name, size = ("tan_half_fov", frame.pose.tan_half_fov) if half is None else ("half_height", half)
        arrays[f"camera_{name}"] = np.float64(size)  # type: ignore[assignment]
    with file.open("wb") as out:
        np.savez_compressed(out, **arrays)  # type: ignore[arg-type]


def write_layers(file: Path, frame: Frame) -> None:
    """An OpenEXR file with linear colour in R, G, B, depth in Z, and the other arrays as layers, float32.

    Raises SceneError without the package OpenEXR, and OSError if the file cannot be written.
    """
    channels = {"RGB": frame.color, "Z": frame.depth}
    for name in ARRAYS:
        if name in ("color", "depth"):
            continue
        values = frame.array(name)
        vector = {f"{name}.{axis}": values[..., k] for k, axis in enumerate("XYZ")} if values.ndim == 3 else None
        channels |= vector or {f"{name}.Y": values}
    write_channels(file, channels)
