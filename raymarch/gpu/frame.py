"""A rendered frame: an image, arrays by name, and numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.scene.camera import Pose
from raymarch.scene.tone import ToneMapping, encode

Arrays: TypeAlias = Mapping[str, NDArray[Any]]


def srgb(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """Linear values to 8-bit sRGB (IEC 61966-2-1); what lies outside [0, 1] is clipped."""
    return encode(np.clip(np.nan_to_num(linear.astype(np.float64), nan=0.0), 0.0, 1.0))


@dataclass(slots=True)
class Timing:
    """Milliseconds of one pass: `draw` by the renderer's clock, `compile` of the driver if it was needed now.

    `first` marks the first draw of a program, in which drivers finish their work; do not compare it with others.
    """

    name: str
    draw: float
    compile: float
    first: bool


@dataclass(slots=True)
class Frame:
    """One picture. Arrays are (H, W) or (H, W, 3) with row 0 at the top.

    Arrays that were not asked for ahead are rendered when first accessed; the renderer must still be open then.
    """

    size: tuple[int, int]
    time: float
    timings: list[Timing]
    _arrays: dict[str, NDArray[Any]]
    _render: Callable[[str], tuple[Arrays, list[Timing]]] = field(repr=False)
    tone: ToneMapping = field(default_factory=ToneMapping, repr=False)
    complete: bool = True
    """False if rays are still on their way, which the next frame of the same picture goes on with."""
    pose: Pose | None = field(default=None, repr=False)
    warnings: Sequence[str] = ()
    """Values of this frame that are out of their legal range, a sentence each."""
    _doubts: Callable[[Frame, bool], list[str]] | None = field(default=None, repr=False)

    def doubts(self, steps: bool = False) -> list[str]:
        """Why this picture may not be what was meant, a sentence each; empty if nothing speaks against it.

        Values out of their range, colours that are not finite, a picture without a hit (which is marched once more to
        be sure). steps : also whether too many rays ran out of steps, for which some rays are marched once more.
        """
        return list(self.warnings) if self._doubts is None else self._doubts(self, steps)

    def array(self, name: str) -> NDArray[Any]:
        """An array by its name, one of `raymarch.plan.OUTPUTS`."""
        if name not in self._arrays:
            arrays, timings = self._render(name)
            self._arrays.update(arrays)
            self.timings += timings
        return self._arrays[name]

    @property
    def color(self) -> NDArray[np.float32]:
        """Linear RGB, float32, (H, W, 3)."""
        return self.array("color")

    @property
    def depth(self) -> NDArray[np.float32]:
        """Distance along the ray, float32, (H, W); infinite where nothing was hit."""
        return self.array("depth")

    @property
    def normal(self) -> NDArray[np.float32]:
        """Outward unit normal, float32, (H, W, 3); 0 where nothing was hit."""
        return self.array("normal")

    @property
    def iterations(self) -> NDArray[np.int32]:
        """Steps of the primary ray and of the cones around it, int32, (H, W)."""
        return self.array("iterations")

    @property
    def evaluations(self) -> NDArray[np.float32]:
        """Evaluations of the field by the primary ray and, shared out, by the cones around it, float32, (H, W)."""
        return self.array("evaluations")

    @property
    def fallbacks(self) -> NDArray[np.int32]:
        """Steps of the primary ray that proved too long and were undone, int32, (H, W)."""
        return self.array("fallbacks")

    @property
    def done(self) -> NDArray[np.bool_]:
        """False where the primary ray ran out of steps, bool, (H, W)."""
        return self.array("done")

    @property
    def reach(self) -> NDArray[np.float32]:
        """How far the primary ray came, float32, (H, W): to its hit, or to where it was nearest to a surface."""
        return self.array("reach")

    @property
    def residual(self) -> NDArray[np.float32]:
        """Size of the field at the last sample, float32, (H, W)."""
        return self.array("residual")

    @property
    def material(self) -> NDArray[np.int32]:
        """Index into the scene's materials, int32, (H, W); -1 where nothing was hit."""
        return self.array("material")

    @property
    def slice(self) -> NDArray[np.float32]:
        """The field and the size of its gradient where the rays meet a plane, float32, (H, W, 2); NaN elsewhere."""
        return self.array("slice")

    @property
    def cycles(self) -> NDArray[np.float32]:
        """Clock cycles of the processor from a pixel's ray to its colour, float32, (H, W).

        What the processor does for others meanwhile counts too: pixels that are drawn together share their number.
        DeviceError on access if the driver has no GL_ARB_shader_clock.
        """
        return self.array("cycles")

    @property
    def milliseconds(self) -> float:
        """Time of the passes drawn so far, without compilation."""
        return sum(t.draw for t in self.timings)

    def image(self) -> Image.Image:
        """The picture as 8-bit sRGB, its light brought to the screen by `tone`."""
        return Image.fromarray(self.tone.image(self.color))


def unpack(name: str, textures: list[NDArray[np.float32]]) -> dict[str, NDArray[Any]]:
    """The arrays that a pass's textures hold, by name."""
    if name == "color":
        return {"color": textures[0][..., :3].copy()}
    if name == "cycles":
        return {"cycles": textures[0][..., 0].copy()}
    if name == "slice":
        met = textures[0][..., 2:3] >= 0
        return {"slice": np.where(met, textures[0][..., :2], np.float32(np.nan))}
    march, surface, more = textures
    depth = march[..., 0]
    return {
        "depth": np.where(depth < 0, np.float32(np.inf), depth),
        "residual": march[..., 1].copy(),
        "iterations": np.rint(march[..., 2]).astype(np.int32),
        "evaluations": march[..., 3].copy(),
        "fallbacks": more[..., 0].astype(np.int32),
        "done": more[..., 1] > 0.5,
        "reach": more[..., 2].copy(),
        "normal": surface[..., :3].copy(),
        "material": surface[..., 3].astype(np.int32),
    }
