"""A rendered frame: an image, arrays by name, and numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from typing import Any, Generic, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.errors import DeviceError, Doubt
from raymarch.expr.convert import switch
from raymarch.gpu.display import ABOVE_ONE, NOT_FINITE, display_of, image_of
from raymarch.gpu.unread import Unread
from raymarch.plan import OUTPUTS
from raymarch.plan.passes import TALLIES
from raymarch.scene.camera import Pose
from raymarch.scene.shown import Shown
from raymarch.scene.tone import ToneMapping, encode


def srgb(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert linear values to 8-bit sRGB (IEC 61966-2-1). Values outside [0, 1] are clipped; NaN becomes 0."""
    return encode(np.clip(np.nan_to_num(linear.astype(np.float64), nan=0.0), 0.0, 1.0))


def all_channels(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where something holds in all channels, (H, W). NumPy reduces a short last axis in ten times as long."""
    return np.asarray(holds[..., 0] & holds[..., 1] & holds[..., 2])


def png(image: Image.Image) -> bytes:
    """An image as a PNG file."""
    out = BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


@dataclass(slots=True)
class Timing:
    """Time of one pass in milliseconds: `draw` by the renderer's clock, `compile` by the driver (0 if cached).

    `first` marks the first draw of a program, which includes deferred compilation; do not compare it with others.
    """

    name: str
    draw: float
    compile: float
    first: bool


T = TypeVar("T", bound=np.generic)


class _Array(Generic[T]):
    """An array of a frame, by the name of the attribute."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, frame: Any, owner: Any = None) -> NDArray[T]:
        found: Any = self if frame is None else frame.array(self._name)
        return found


@dataclass(slots=True, repr=False)
class Frame:
    """One rendered picture. Arrays have shape (H, W) or (H, W, 3); row 0 is the top.

    Arrays that were listed in `outputs` stay on the device until they are accessed, or until the renderer draws the
    next frame or closes, which reads them if the frame is still referenced. Other arrays are rendered on first access;
    the renderer must still be open then.
    """

    size: tuple[int, int]
    time: float
    timings: list[Timing]
    _arrays: dict[str, NDArray[Any]]
    _render: Callable[[str], tuple[Mapping[str, Unread], list[Timing]]] = field(repr=False)
    tone: ToneMapping = field(default_factory=ToneMapping, repr=False)
    complete: bool = True
    """False if some pixels are not drawn, or light was not added; the next frame of the picture goes on."""
    pose: Pose | None = field(default=None, repr=False)
    warnings: Sequence[Doubt] = ()
    """One sentence for each value that is outside its legal range in this frame."""
    _doubts: Callable[[Frame, bool | None], list[Doubt]] | None = field(default=None, repr=False)
    _transparency: Callable[[], tuple[NDArray[np.float32], NDArray[np.float32]]] | None = field(
        default=None, repr=False
    )
    spread: bool = False
    """True if post effects carry light beyond the surfaces."""
    _of: Shown | None = field(default=None, repr=False)
    _unread: dict[str, Unread] = field(default_factory=dict, repr=False)
    _encoded: NDArray[np.uint8] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        names = ", ".join({**self._unread, **self._arrays})
        return f"<Frame {self.size[0]}x{self.size[1]} at time {self.time:g}: {names}; {self.milliseconds:.1f} ms>"

    def __copy__(self) -> Frame:
        return replace(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what was rendered; the renderer stays behind."""
        kept = ("size", "time", "timings", "tone", "complete", "pose", "spread")
        parts: dict[str, Any] = {name: getattr(self, name) for name in kept}
        arrays = {name: self.array(name) for name in {**self._unread, **self._arrays}}
        return _unpickled, (parts | {"_arrays": arrays, "warnings": list(self.warnings)},)

    def doubts(self, steps: bool | None = None) -> list[Doubt]:
        """Reasons to doubt this picture, one sentence each; empty if there are none.

        The checks are: values outside their range, samples that contradict the facts of the user's own definitions,
        colours that are not finite, glass that one random path a pixel shows, surfaces that are clipped to white over
        5 % of the picture (which renders the materials), surfaces that are all nearly black or white, a picture
        without a hit (which renders the depth to confirm), and more than 0.5 % of the rays out of steps.

        Parameters
        ----------
        steps : False to leave out rays out of steps. They are known from the picture, unless a pixel is the mean of
            several rays. True to march a sparse subset of these again; None to leave them out.

        Returns
        -------
        list[str]
            Each also has its parts: `stage`, `what`, `cure` and `where`, the user's line or None.

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        return list(self.warnings) if self._doubts is None else self._doubts(self, steps)

    def array(self, name: str) -> NDArray[Any]:
        """An array by name, one of `raymarch.plan.OUTPUTS` or `raymarch.plan.passes.TALLIES`.

        Returns
        -------
        NDArray[Any]

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        if name in self._arrays:
            return self._arrays[name]
        return self._unread_array(name).array(name)

    def on_device(self, name: str) -> Unread | None:
        """An array on the device, rendered if it was not; None for an array that was given."""
        return None if name in self._arrays else self._unread_array(name)

    def drawn(self, name: str) -> Unread | None:
        """An array that was drawn with the picture; None if it would take a pass."""
        return self._unread.get(name)

    def _unread_array(self, name: str) -> Unread:
        if name not in self._unread:
            unread, timings = self._render(name)
            self._unread.update(unread)
            self.timings += timings
        return self._unread[name]

    def __getattr__(self, name: str) -> NDArray[Any]:
        """An array that has no property."""
        if name in OUTPUTS or name in TALLIES:
            return self.array(name)
        raise AttributeError(f"'Frame' object has no attribute '{name}'")

    color = _Array[np.float32]("Linear RGB, float32, (H, W, 3).")
    depth = _Array[np.float32]("Distance along the ray, float32, (H, W); inf for a miss.")
    normal = _Array[np.float32]("Outward unit normal, float32, (H, W, 3); 0 for a miss.")
    shading_normal = _Array[np.float32](
        "Unit normal that light uses, with bump and normal maps, outward as `normal`, float32, (H, W, 3); 0 for a miss."
    )
    iterations = _Array[np.int32]("Steps of the primary ray and of the cones that contain it, int32, (H, W).")
    evaluations = _Array[np.float32](
        "Field evaluations of the primary ray, plus its portion of those of the cones around it, float32, (H, W)."
    )
    fallbacks = _Array[np.int32]("Steps of the primary ray that were too long and were undone, int32, (H, W).")
    done = _Array[np.bool_]("False where the primary ray ran out of steps, bool, (H, W).")
    reach = _Array[np.float32](
        "Distance that the primary ray reached, float32, (H, W): its hit, or the point where it was closest to a "
        "surface."
    )
    residual = _Array[np.float32]("Upper bound of |field| at the last sample of a hit, float32, (H, W); 0 for a miss.")
    material = _Array[np.int32]("Index into the scene's materials, int32, (H, W); -1 for a miss.")
    slice = _Array[np.float32](
        "Field value and gradient magnitude where the rays intersect a plane, float32, (H, W, 2); NaN elsewhere."
    )
    cycles = _Array[np.float32](
        "Clock cycles that the shader spends on a pixel, from its ray to its colour, float32, (H, W). Work that the "
        "processor does for other pixels in the meantime is included; pixels that are drawn together have the same "
        "count. DeviceError on access if the driver has no GL_ARB_shader_clock."
    )

    @property
    def milliseconds(self) -> float:
        """Draw time of all passes so far in milliseconds, without compilation."""
        return sum(t.draw for t in self.timings)

    @property
    def alpha(self) -> NDArray[np.float32]:
        """Fraction of each pixel in which surfaces, visible lights or fog hide the sky, 0 to 1, float32, (H, W); of as
        many rays as the picture.

        It is rendered on first access; the renderer must still be open then.
        """
        if "alpha" not in self._arrays:
            assert self._transparency is not None
            self._arrays["alpha"], self._arrays["behind"] = self._transparency()
        return self._arrays["alpha"]

    def premultiplied(self) -> NDArray[np.float32]:
        """Linear colour without the sky, times coverage, and coverage, float32, (H, W, 4): premultiplied alpha.

        Light that a post effect carries beyond the surfaces is as opaque as its brightest channel, at most 1.

        Returns
        -------
        NDArray[float32]

        Raises
        ------
        DeviceError : the renderer was closed before the array was drawn.
        """
        covered = np.clip(self.alpha, 0.0, 1.0)[..., None]
        own = self.color - self._arrays["behind"]
        if self.spread:  # light beyond the surfaces: as opaque as it is bright
            covered = np.maximum(covered, np.clip(np.max(own, axis=-1, keepdims=True), 0.0, 1.0))
        return np.concatenate([own, covered], axis=-1).astype(np.float32)

    def _pixels(self) -> NDArray[np.uint8] | None:
        """The picture as the device encodes it, see `Display.light`; None if it does not."""
        if self._encoded is None and "color" not in self._arrays:
            unread = self._unread_array("color")
            if unread.target is None or unread.target.context.driver.is_software:  # NumPy takes no longer there
                return None
            with unread.texture() as target:
                if target is not None:
                    output = unread.chosen.outputs["color"]
                    self._encoded = display_of(target.context).light(target, output, self.tone)
        return self._encoded

    def _count_odd(self) -> tuple[int, int]:
        """Numbers of pixels: with a channel that is not finite, and of the others with all channels above 1."""
        pixels = self._pixels()
        if pixels is not None:
            counts = np.bincount(pixels[..., 3].reshape(-1), minlength=4)
            return int(counts[NOT_FINITE]), int(counts[ABOVE_ONE])
        color = self.color
        with np.errstate(invalid="ignore"):
            low, high = np.min(color), np.max(color)  # NaN if one is
            if high <= 1.0 and np.isfinite(low):
                return 0, 0
            finite = all_channels(np.isfinite(color)) if not (np.isfinite(low) and np.isfinite(high)) else True
            return int(np.sum(np.logical_not(finite))), int(np.count_nonzero(finite & all_channels(color > 1.0)))

    def _repr_png_(self) -> bytes:
        return png(self.image())

    def image(self, alpha: bool = False) -> Image.Image:
        """The picture as 8-bit sRGB, after tone mapping by `tone`.

        Parameters
        ----------
        alpha : make the sky transparent: an RGBA picture whose colours do not contain the sky (straight alpha). Fog
            before the sky is as opaque as it hides the sky. Light that a post effect carries beyond the surfaces is as
            opaque as its brightest channel, at most 1.

        Returns
        -------
        PIL.Image.Image

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        if not switch("image: alpha", alpha):
            pixels = self._pixels()
            return Image.fromarray(self.tone.image(self.color)) if pixels is None else image_of(pixels)
        light = self.premultiplied()
        own, covered = light[..., :3], light[..., 3:]
        surfaces = own / np.maximum(covered, 1.0 / 512.0)
        rgb = self.tone.image(np.maximum(surfaces, 0.0, dtype=np.float32) * (covered > 0.0))
        return Image.fromarray(np.concatenate([rgb, np.rint(255.0 * covered).astype(np.uint8)], axis=-1))


def _unpickled(parts: dict[str, Any]) -> Frame:
    """A frame without its renderer: the arrays that were rendered before it was pickled."""

    def late(name: str = "alpha") -> NoReturn:
        raise not_rendered("this frame was pickled or copied", name)

    return Frame(**parts, _render=late, _transparency=late)


def not_rendered(why: str, name: str) -> DeviceError:
    """The error for an array that is wanted too late."""
    earlier = f"access frame.{name} before"
    if name != "alpha":
        outputs = '("color",)' if name == "color" else f'("color", "{name}")'
        earlier = f"render(scene, outputs={outputs}), or {earlier}"
    return DeviceError(f"{why}, and its array '{name}' was not rendered before", legal=earlier)
