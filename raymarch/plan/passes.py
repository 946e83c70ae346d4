"""The passes of a plan: draw calls of the full-screen quad into float textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from raymarch.scene.quality import Quality

OUTPUTS: Final = (
    *("color", "depth", "normal", "iterations", "evaluations", "residual", "material", "fallbacks"),
    *("done", "reach", "slice", "cycles"),
)
"""The arrays that a frame can hold."""


@dataclass(frozen=True, slots=True)
class Pass:
    """One draw call of the full-screen quad.

    module : the GLSL module with its `main`. textures : number of float colour textures that it writes.
    defines : preprocessor names defined in this pass only. shades : True if it computes the colour of surfaces.
    extension : the OpenGL extension that it requires; "" for none.
    """

    name: str
    module: str
    textures: int
    reason: str
    defines: tuple[str, ...] = ()
    shades: bool = False
    extension: str = ""

    @property
    def head(self) -> tuple[str, ...]:
        """The lines of this pass alone that precede the shader body."""
        wanted = (f"#extension {self.extension} : require",) if self.extension else ()
        return (*wanted, *(f"#define {name}" for name in self.defines))


CONE: Final = Pass("cone", "view/cone", 1, "rays start where their cones ended", ("CONE",))

MARCH: Final = Pass("march", "view/march", 3, "rays take a part of their steps in each pass")

SAMPLE: Final = Pass("sample", "view/sample", 2, "one sample per pixel: colour and visible surface", shades=True)

BEFORE: Final = Pass(
    "before", "temporal/before", 2, "positions and colours of this frame's points in the previous frame"
)

RESOLVE: Final = Pass("color", "temporal/resolve", 2, "the picture: the new sample blended with the history")

DRAWN: Final = {
    "color": Pass("color", "view/color", 1, "the picture", shades=True),
    "geometry": Pass("geometry", "view/geometry", 3, "depth, normal, material or counts were requested"),
    "slice": Pass("slice", "view/slice", 1, "the field on a plane was requested"),
    "cycles": Pass(
        "cycles", "view/cycles", 1, "clock cycles were requested", shades=True, extension="GL_ARB_shader_clock"
    ),
    "samples": Pass("samples", "view/accumulate", 1, "a page that adds samples was requested", shades=True),
    "standalone": Pass("standalone", "view/standalone", 1, "a shader for other programs was requested", shades=True),
    "shadertoy_buffer": Pass(
        "shadertoy_buffer", "view/shadertoy_buffer", 1, "a buffer of Shadertoy that adds samples", shades=True
    ),
    "shadertoy": Pass("shadertoy", "view/shadertoy", 1, "a shader for Shadertoy was requested", shades=True),
}
"""The passes that can be requested, by name."""


def passes_of(
    names: Sequence[str], quality: Quality, cones: bool, changes: bool = False, mixed: bool = False
) -> list[Pass]:
    """The requested passes and those that they need, in drawing order.

    names : of `DRAWN`. cones : True if cones are marched first. changes : True if the scene reads time or parameters.
    mixed : True if a lens or an open shutter lets a pixel show many surfaces, so that no history can follow them.
    """
    found = [CONE] if cones else []
    found += [MARCH] if quality.steps_per_pass is not None else []
    sampled = quality.steps_per_pass is None and (quality.samples > 1 or quality.temporal != "off")
    for name in names:
        drawn = DRAWN[name]
        if name == "color" and quality.temporal == "reproject" and not mixed:
            found += [SAMPLE, BEFORE, RESOLVE] if changes else [SAMPLE, RESOLVE]
        elif name == "color" and sampled:
            found.append(replace(drawn, module="view/accumulate", reason="the picture, averaged over its samples"))
        else:
            found.append(drawn)
    return found


def joining(drawn: Sequence[Pass]) -> dict[str, str]:
    """The modules chosen to reproject the history, each with its reason."""
    history = {"temporal/history": "the history is reprojected"}
    if BEFORE in drawn:
        return {**history, "temporal/changed": "the scene reads time or parameters"}
    return {**history, "temporal/unchanged": "the scene reads neither time nor parameters"}
