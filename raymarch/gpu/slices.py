"""Slices: the field value and its gradient magnitude on a plane."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import numbers, short
from raymarch.gpu.scale import Scale, nice
from raymarch.scene.camera import Pose
from raymarch.scene.scene import Scene
from raymarch.scene.value import Value, value

SCALE = Scale("|gradient| - 1", -1.0, 1.0, colors="coolwarm")
APART = 8.0
"""Minimum distance of contour lines in pixels, where the field has its typical gradient in the picture."""
FLAT = 1e-3
"""Where the field changes by less than this fraction of the contour spacing per pixel, rounding would place the lines,
so that none is drawn."""


@value
class Slice(Value):
    """The plane dot(normal, p) = offset: the output "slice" of `Renderer.render` with its parameter.

    Parameters
    ----------
    normal : a direction of any length > 0; it is kept with length 1, and the offset divided by its length.
    offset : the plane's distance from the origin along the normal, times the length of `normal`.

    Raises
    ------
    SceneError : that is no plane.
    """

    output: ClassVar[str] = "slice"

    normal: tuple[float, float, float]
    offset: float

    def __init__(self, normal: tuple[float, float, float], offset: float = 0.0) -> None:
        legal = "three numbers, not all 0, and a number"
        given = np.append(numbers("Slice: normal", normal, legal), numbers("Slice: offset", offset, legal))
        length = float(np.linalg.norm(given[:3])) if given.shape == (4,) else 0.0
        if not (np.all(np.isfinite(given)) and length > 0.0):
            raise SceneError(f"Slice: normal = {short(normal)}, offset = {short(offset)}", legal=legal)
        if abs(length - 1.0) > 1e-15:
            given = given / length
        x, y, z, away = map(float, given)
        self._set(normal=(x, y, z), offset=away)

    @staticmethod
    def facing(scene: Scene, pose: Pose) -> Slice:
        """The plane through the centre of the bounded parts, normal to the axis closest to the view direction."""
        axis = int(np.argmax(np.abs(pose.frame[:, 2])))
        subject = scene.subject
        middle = 0.0 if subject is None else 0.5 * float(subject.lower[axis] + subject.upper[axis])
        x, y, z = (1.0 if k == axis else 0.0 for k in range(3))
        return Slice((x, y, z), middle)

    def uniforms(self, origin: NDArray[np.float64]) -> dict[str, Any]:
        """The uniforms of the pass, in coordinates relative to `origin`."""
        return {"u_slice": (*self.normal, self.offset - float(origin @ self.normal))}


def spacing(distance: NDArray[np.floating]) -> float:
    """The contour spacing that keeps lines apart: 1, 2 or 5 times a power of ten. `distance` is (H, W), NaN where the
    ray misses the plane."""
    steps = _per_pixel(distance)
    steps = steps[np.isfinite(steps)]
    steps = steps[steps > FLAT * steps.max(initial=0.0)]
    return nice(APART * float(np.median(steps))) if steps.size else 1.0


def slice_picture(distance: NDArray[np.floating], slope: NDArray[np.floating]) -> NDArray[np.float64]:
    """A slice as sRGB, (H, W, 3), from field value and gradient magnitude, (H, W), NaN where the ray misses the plane.

    The colour is the gradient magnitude minus 1, on `SCALE`. The surface is a black line, two pixels wide. Contour
    lines, `spacing` apart, are grey and one pixel wide, and vanish where they would be closer than 4 pixels. The inside
    of the solid is darker. Rays that miss the plane are black.
    """
    met = np.isfinite(distance)
    value = np.where(met, distance, 0.0).astype(np.float64)
    shown = SCALE.colored(np.where(met, slope, 1.0) - 1.0)
    shown *= np.where(value < 0.0, 0.72, 1.0)[..., None]
    pixel = np.maximum(np.nan_to_num(_per_pixel(distance), nan=0.0), 1e-30)
    step = spacing(distance)
    nearest = np.abs(value - step * np.rint(value / step)) / pixel
    dense = np.clip(step / pixel / 4.0 - 1.0, 0.0, 1.0) * (pixel > FLAT * step)
    shown *= 1.0 - (0.45 * dense * np.clip(1.0 - nearest, 0.0, 1.0))[..., None]
    shown *= np.clip(np.abs(value) / pixel - 0.5, 0.0, 1.0)[..., None]
    shown[~met] = 0.0
    return shown


def _per_pixel(distance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Change of the field value from one pixel to the next, (H, W)."""
    parts = [np.gradient(distance, axis=k) if n > 1 else np.zeros(distance.shape) for k, n in enumerate(distance.shape)]
    return np.asarray(np.hypot(*parts), np.float64)
