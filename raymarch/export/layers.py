"""All arrays of a frame in one file: NumPy's .npz, or OpenEXR with named layers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raymarch.gpu.frame import Frame
from raymarch.plan import OUTPUTS
from raymarch.scene.images import exr_package

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
    OpenEXR = exr_package(file)
    channels = {"RGB": np.ascontiguousarray(frame.color, np.float32), "Z": np.ascontiguousarray(frame.depth)}
    for name in ARRAYS:
        if name in ("color", "depth"):
            continue
        values = np.asarray(frame.array(name), np.float32)
        if values.ndim == 3:
            channels |= {f"{name}.{axis}": np.ascontiguousarray(values[..., k]) for k, axis in enumerate("XYZ")}
        else:
            channels[f"{name}.Y"] = np.ascontiguousarray(values)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File(header, channels) as made:
            made.write(str(file))
    except RuntimeError as fault:  # the library raises it for every fault of a file
        raise OSError(" ".join(str(fault).split())) from fault
