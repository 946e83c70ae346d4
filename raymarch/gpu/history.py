"""The state that a frame reuses from earlier frames, one class for each concern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(slots=True)
class MarchState:
    """A march over several frames: number of passes so far, and whether all rays have terminated."""

    passes: int = 0
    arrived: bool = False


@dataclass(slots=True)
class GridState:
    """A picture within a budget of time, as far as it is drawn; see `raymarch.gpu.interlaced`.

    used : whether the last picture is such a one. order : which grids it has. number : of grids that are complete.
    drawn : number of passes of the next grid that are complete. cells : of the next pass that are drawn. rows : of its
    grid that are shown.
    """

    used: bool = False
    order: int = 0
    number: int = 0
    drawn: int = 0
    cells: int = 0
    rows: int = 0

    def next_pass(self) -> None:
        """All cells of a pass are drawn."""
        self.cells = self.rows = 0

    def next_grid(self) -> None:
        """All passes of a grid are drawn."""
        self.number, self.drawn = self.number + 1, 0


@dataclass(slots=True)
class LightState:
    """Light that is added over several frames.

    added : number of samples of light that were added to the current sample of the picture. count : of all; see
        `Plan.light_samples`. complete : whether all were added, or a pass adds all.
    rows : number of rows of the picture that already have the next samples of light, if a pass takes several frames.
    adding : number of these samples.
    """

    added: int = 0
    count: int = 1
    complete: bool = True
    rows: int = 0
    adding: int = 0


@dataclass(slots=True)
class MeanState:
    """The last picture, which frames without a picture do not change.

    inputs : of its cones, for comparison. text : its shader. samples : number of samples per pixel since it changed.
    own_cones : whether it drew its own cones.
    """

    inputs: Any = None
    text: str | None = None
    samples: int = 0
    own_cones: bool = True


@dataclass(slots=True)
class EarlierPicture:
    """The last picture, as far as the history is reprojected from it.

    camera : its camera; None if there is none. uniforms : all, except data textures. shader : its text, and what
        replaces its numbers. frames : number of pictures since the history was reset.
    """

    camera: Mapping[str, Any] | None = None
    uniforms: Mapping[str, Any] = field(default_factory=dict)
    shader: Any = None
    frames: int = 0


@dataclass(slots=True)
class History:
    """The state that a frame reuses from earlier frames.

    name : put before the names of its targets. cones : the inputs of the cones that were drawn last.
    """

    name: str = ""
    cones: Any = None
    mean: MeanState = field(default_factory=MeanState)
    march: MarchState = field(default_factory=MarchState)
    grid: GridState = field(default_factory=GridState)
    light: LightState = field(default_factory=LightState)
    earlier: EarlierPicture = field(default_factory=EarlierPicture)

    def begin(self, inputs: Any, text: str | None, keep: bool) -> bool:
        """Begin a frame. Returns True if the cones of the last one can be reused.

        inputs : of the cones, for comparison. text : of the shader; None for a frame without a picture.
        keep : False to reuse nothing.
        """
        kept, mean = keep and inputs == self.cones, self.mean
        self.cones = inputs
        if text is not None:
            same = keep and inputs == mean.inputs and text == mean.text
            self.mean = MeanState(inputs, text, mean.samples if same else 0, not kept)
            self.march.passes = self.march.passes if kept else 0
            self.light.complete = True
            if not (kept and same):
                self.grid = GridState()
                self.light.added = self.light.rows = 0
        return kept
