"""The passes of a plan: draws of the full-screen quad into float textures."""

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
    """One draw of the full-screen quad: its outputs, and how many colour textures it fills.

    defines : names that the preprocessor knows in this pass alone.
    shades : True if it gives surfaces their colour. extension : of OpenGL, that it cannot do without; "" for none.
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
        """Its own lines before the shader's text."""
        wanted = (f"#extension {self.extension} : require",) if self.extension else ()
        return (*wanted, *(f"#define {name}" for name in self.defines))


CONE: Final = Pass("cone", "view/cone", 1, "rays start where the cones around them ended", ("CONE",))

MARCH: Final = Pass("march", "view/march", 3, "rays take some steps in each pass, and go on in the next")

SAMPLE: Final = Pass("sample", "view/sample", 2, "one sample of each pixel, and what it saw", shades=True)

BEFORE: Final = Pass("before", "temporal/before", 2, "what this frame sees, where it was in the frame before")

RESOLVE: Final = Pass("color", "temporal/resolve", 2, "the picture: the sample, and what earlier frames saw there")

DRAWN: Final = {
    "color": Pass("color", "view/color", 1, "the picture", shades=True),
    "geometry": Pass("geometry", "view/geometry", 3, "depth, normal, material or counts were asked for"),
    "slice": Pass("slice", "view/slice", 1, "the field over a plane was asked for"),
    "cycles": Pass(
        "cycles", "view/cycles", 1, "clock cycles were asked for", shades=True, extension="GL_ARB_shader_clock"
    ),
}
"""What can be asked for, by name."""


def passes_of(names: Sequence[str], quality: Quality, cones: bool, changes: bool = False) -> list[Pass]:
    """The passes that draw what is asked for, and those that they need, in the order in which they are drawn.

    changes : True if the scene reads time or parameters.
    """
    found = [CONE] if cones else []
    found += [MARCH] if quality.steps_per_pass is not None else []
    sampled = quality.steps_per_pass is None and (quality.samples > 1 or quality.temporal != "off")
    for name in names:
        drawn = DRAWN[name]
        if name == "color" and quality.temporal == "reproject":
            found += [SAMPLE, BEFORE, RESOLVE] if changes else [SAMPLE, RESOLVE]
        elif name == "color" and sampled:
            found.append(replace(drawn, module="view/accumulate", reason="the picture, averaged over its samples"))
        else:
            found.append(drawn)
    return found


def joining(drawn: Sequence[Pass]) -> list[tuple[str, str]]:
    """The modules by which samples and frames are joined, each with its reason."""
    modules = {p.module for p in drawn}
    if "temporal/resolve" in modules:
        reason = "what earlier frames saw is found again where it went"
        moved = "changed" if BEFORE.module in modules else "unchanged"
        return [(f"temporal/{name}", reason) for name in ("finite", "history", "reproject", "clip", moved)]
    return [("temporal/finite", "samples are averaged")] if "view/accumulate" in modules else []
