"""The passes of a plan: draw calls of the full-screen quad into float textures.

A pass is declared here, by what it reads and writes and how often it is drawn. `raymarch.gpu.draw_calls` draws all of
them in one loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.post import PostEffect
from raymarch.scene.quality import Quality


@dataclass(frozen=True, slots=True)
class Output:
    """An array of a frame, as a pass writes it.

    texture, channels : the texture of the pass, and one of its channels or several.
    type : of the array: "f4", "i4", or "?" for True above 1/2.
    hit, miss : a channel of texture 0 that is negative where the ray hit nothing, and the value of the array there.
        None for an array without such a value.
    """

    texture: int
    channels: int | slice
    type: str = "f4"
    hit: int = 0
    miss: float | None = None

    @property
    def needed(self) -> int:
        """The number of channels, from the first one, that have the array."""
        last: int = self.channels.stop if isinstance(self.channels, slice) else self.channels + 1
        return last if self.miss is None else max(last, self.hit + 1)

    def read(self, texels: Callable[[int, int], NDArray[np.float32]]) -> NDArray[Any]:
        """The array, (H, W) or (H, W, channels).

        texels : returns the first channels of a texture of the pass, (H, W, channels), by the number of the texture and
            the number of channels. An array with a `miss` is in texture 0.
        """
        given = texels(self.texture, self.needed)
        found: NDArray[Any] = given[..., self.channels]
        if self.miss is not None:
            missed = given[..., self.hit : self.hit + 1] if found.ndim == 3 else given[..., self.hit]
            found = np.where(missed < 0, np.float32(self.miss), found)
        elif self.type == "?":
            found = found > 0.5
        elif self.type == "i4":
            found = np.rint(found).astype("i4")
        elif found.ndim == 3 and found.shape[-1] < given.shape[-1]:  # channel by channel, in a third of the time
            found = np.empty(found.shape, found.dtype)
            for k in range(found.shape[-1]):
                found[..., k] = given[..., self.channels][..., k]
        return np.ascontiguousarray(found)


@dataclass(frozen=True, slots=True)
class Pass:
    """A draw call of the full-screen quad, or several.

    module : the GLSL module with its `main`.
    writes : the float textures that it writes: the names by which later passes read them. A pass reads every texture
        whose name its text uses.
    outputs : the arrays of a frame that it draws, by name.
    often : "once"; for each "level" of cones; in "steps" of a march, until all rays have terminated; for each "sample".
        Neighbours that are drawn for each sample take turns. An "effect" has the stages that it states.
    history : names by which it reads the textures that it wrote last. Each draw then writes another target.
    when : "" for always. "changed": only if the scene changed since the last picture, with the uniforms of that
        picture. "still": only if it is the picture that its history shows, "moving" only if not.
    sharp : its rays start at the centre of the lens.
    defines : preprocessor names defined in this pass only. shades : True if it computes the colour of surfaces.
    surfaces : True if it calls `surface_normal` or `material_index`. bends : True if it calls `surface_normal`, and
        `relief_at` where a material has relief. counts : True if it reads what a ray has cost.
    notes : True if it keeps samples of a march. tallies : True if it counts evaluations by all rays; it is drawn alone.
    extension : the OpenGL extension that it requires; "" for none.
    effect : the post effect that it draws. Its shader is separate from that of the scene.
    lights : "before", "each" or "after", for passes that add the light of a sample of the picture a few samples of
        light at a time: "each" is drawn until all are added, those before it once for each sample of the picture. They
        read only their own pixel of each other.
    """

    name: str
    module: str
    writes: tuple[str, ...]
    reason: str
    outputs: Mapping[str, Output] = field(default_factory=dict)
    often: str = "once"
    history: tuple[str, ...] = ()
    when: str = ""
    sharp: bool = False
    defines: tuple[str, ...] = ()
    shades: bool = False
    surfaces: bool = False
    bends: bool = False
    counts: bool = False
    notes: bool = False
    tallies: bool = False
    extension: str = ""
    effect: PostEffect | None = None
    lights: str = ""

    @property
    def textures(self) -> int:
        """Number of float colour textures that it writes."""
        return len(self.writes)

    @property
    def pair(self) -> str:
        """The name of the targets that it writes in turns, if it has a history. Passes that write the same share it."""
        return f"{self.writes[0].removeprefix('u_')} history"

    @property
    def head(self) -> tuple[str, ...]:
        """The lines of this pass alone that precede the shader body."""
        wanted = (f"#extension {self.extension} : require",) if self.extension else ()
        return (*wanted, *(f"#define {name}" for name in self.defines))

    def unpack(self, textures: Sequence[NDArray[np.float32]]) -> dict[str, NDArray[Any]]:
        """The arrays by name, from the textures of the pass, each (H, W, 4)."""
        return {name: output.read(lambda k, n: textures[k][..., :n]) for name, output in self.outputs.items()}


CONE: Final = Pass(
    "cone",
    "view/cone",
    ("u_carried",),
    "rays start where their cones ended",
    often="level",
    defines=("CONE",),
    counts=True,
)

_MARCHED = ("u_march", "u_found", "u_more")
MARCH: Final = Pass(
    "march",
    "view/march",
    _MARCHED,
    "rays take a part of their steps in each pass",
    often="steps",
    history=_MARCHED,
    counts=True,
)

SURFACE: Final = Pass(
    "surface",
    "view/surface",
    (),
    "rays are marched and surfaces found once for all lights",
    often="sample",
    lights="before",
)

LIGHT: Final = Pass(
    "light",
    "view/light",
    ("u_lit",),
    "samples of light are added a few at a time",
    often="sample",
    history=("u_lit",),
    shades=True,
    lights="each",
)

SAMPLE: Final = Pass(
    "sample",
    "view/sample",
    ("u_color", "u_surface"),
    "one sample per pixel: colour and visible surface",
    often="sample",
    shades=True,
    surfaces=True,
)

BEFORE: Final = Pass(
    "before",
    "temporal/before",
    ("u_earlier_color", "u_earlier_motion"),
    "positions and colours of this frame's points in the previous frame",
    often="sample",
    when="changed",
)

COLOR: Final = Pass("color", "view/color", ("u_color",), "the picture", {"color": Output(0, slice(3))}, shades=True)

SINGLE: Final = replace(COLOR, outputs={**COLOR.outputs, "done": Output(0, 3, "?")})
"""The picture with one ray per pixel, which also tells whether that ray ran out of steps."""

AVERAGED: Final = replace(
    COLOR,
    module="view/accumulate",
    reason="the picture, averaged over its samples",
    often="sample",
    history=("u_history",),
)

RESOLVE: Final = replace(
    COLOR,
    module="temporal/resolve",
    writes=("u_color", "u_surface"),
    reason="the picture: the new sample blended with the history",
    often="sample",
    history=("u_history", "u_history_surface"),
    when="moving",
    shades=False,
)

MEAN: Final = replace(
    RESOLVE,
    name="mean",
    module="temporal/mean",
    reason="the picture, averaged over its samples while it does not change",
    when="still",
)

DRAWN: Final = {
    "color": COLOR,
    "geometry": Pass(
        "geometry",
        "view/geometry",
        ("u_depth", "u_normal", "u_counts"),
        "depth, normal, material or counts were requested",
        {
            "depth": Output(0, 0, miss=np.inf),
            "normal": Output(1, slice(3)),
            "iterations": Output(0, 2, "i4"),
            "evaluations": Output(0, 3),
            "residual": Output(0, 1),
            "material": Output(1, 3, "i4"),
            "fallbacks": Output(2, 0, "i4"),
            "done": Output(2, 1, "?"),
            "reach": Output(2, 2),
        },
        sharp=True,
        surfaces=True,
        counts=True,
    ),
    "slice": Pass(
        "slice",
        "view/slice",
        ("u_sliced",),
        "the field on a plane was requested",
        {"slice": Output(0, slice(2), hit=2, miss=np.nan)},
        sharp=True,
    ),
    "position": Pass(
        "position",
        "view/position",
        ("u_position",),
        "positions were requested",
        {"position": Output(0, slice(3), hit=3, miss=np.nan)},
        sharp=True,
    ),
    "shading_normal": Pass(
        "shading_normal",
        "view/shading_normal",
        ("u_shading_normal",),
        "normals with relief were requested",
        {"shading_normal": Output(0, slice(3))},
        sharp=True,
        bends=True,
    ),
    "cycles": Pass(
        "cycles",
        "view/cycles",
        ("u_cycles",),
        "clock cycles were requested",
        {"cycles": Output(0, 0)},
        shades=True,
        extension="GL_ARB_shader_clock",
    ),
    "tally": Pass(
        "tally",
        "view/tally",
        ("u_tally",),
        "evaluations of all rays were requested",
        {f"{name}_evaluations": Output(0, k) for k, name in enumerate(("all", "shadow", "occlusion", "bounce"))},
        shades=True,
        tallies=True,
    ),
    "ray": Pass(
        "ray", "view/ray", ("u_sample", "u_end_of_ray"), "the samples of a ray were requested", sharp=True, notes=True
    ),
    "samples": Pass("samples", "view/accumulate", ("u_sum",), "a page that adds samples was requested", shades=True),
    "standalone": Pass(
        "standalone", "view/standalone", ("u_shown",), "a shader for other programs was requested", shades=True
    ),
    "shadertoy_buffer": Pass(
        "shadertoy_buffer", "view/shadertoy_buffer", ("u_sum",), "a buffer of Shadertoy that adds samples", shades=True
    ),
    "shadertoy": Pass("shadertoy", "view/shadertoy", ("u_shown",), "a shader for Shadertoy was requested", shades=True),
}
"""The passes that can be requested, by name."""

ATTACHMENTS: Final = 8
"""Textures that a pass can write with every driver."""

OUTPUTS: Final = tuple(name for drawn in DRAWN.values() if not drawn.tallies for name in drawn.outputs)
"""The arrays that a frame can hold."""

TALLIES: Final = tuple(name for drawn in DRAWN.values() if drawn.tallies for name in drawn.outputs)
"""Counts of evaluations by all rays. They are drawn alone: each evaluation of their shader is counted."""


def picture_passes(
    names: Sequence[str], quality: Quality, changes: bool = False, mixed: bool = False, post: Sequence[PostEffect] = ()
) -> list[Pass]:
    """The requested passes and those that they need, in drawing order, without cones, and before light is split. Post
    effects follow all passes of the scene.

    names : of `DRAWN`. changes : True if the scene reads time or parameters.
    mixed : True if a lens or an open shutter lets a pixel show many surfaces, so that no history can follow them.
    post : the effects of the scene.
    """
    found = [MARCH] if quality.steps_per_pass is not None else []
    effects: list[Pass] = []
    sampled = quality.steps_per_pass is None and (quality.samples > 1 or quality.temporal != "off")
    for name in names:
        if name == "color" and quality.temporal == "reproject" and not mixed:
            found += [SAMPLE, *[BEFORE] * changes, RESOLVE, MEAN]
        elif name == "color":
            found.append(AVERAGED if sampled else SINGLE)
        else:
            found.append(DRAWN[name])
        if name == "color" and post:
            found, effects = changed_by(found, post)
    return [*found, *effects]


def split_lights(passes: Sequence[Pass], texels: int) -> list[Pass]:
    """The passes where the picture adds a few samples of light at a time. texels : number of textures that keep the
    surfaces."""
    found: list[Pass] = []
    for each in passes:
        if each.name == COLOR.name:
            kept = tuple(f"u_surface_{k}" for k in range(texels))
            outputs = {name: output for name, output in each.outputs.items() if name in AVERAGED.outputs}
            found += [replace(SURFACE, writes=kept), LIGHT, replace(AVERAGED, lights="after", outputs=outputs)]
        else:
            found.append(each)
    return found


def with_cones(passes: Sequence[Pass], cones: bool) -> list[Pass]:
    """The passes, after cones if these are marched first."""
    return [CONE] * cones + [p for p in passes if p is not CONE]


def changed_by(passes: Sequence[Pass], post: Sequence[PostEffect]) -> tuple[list[Pass], list[Pass]]:
    """Passes that draw a picture, and those of its post effects. The last one draws the colour of the frame."""
    before = [replace(p, outputs={name: x for name, x in p.outputs.items() if name != "color"}) for p in passes]
    found: list[Pass] = []
    for effect in post:
        number = sum(p.effect is not None and p.effect.LABEL == effect.LABEL for p in found)
        place = f" at {effect.where}" if effect.where else ""
        found.append(
            Pass(
                f"{effect.LABEL} {number + 1}" if number else effect.LABEL,
                effect.MODULE,
                ("u_color",),
                f"needed by {type(effect).__name__}(...){place}",
                often="effect",
                effect=effect,
            )
        )
    found[-1] = replace(found[-1], outputs=COLOR.outputs)
    return before, found


def joining(drawn: Sequence[Pass]) -> dict[str, str]:
    """The modules chosen to reproject the history, each with its reason."""
    history = {"temporal/history": "the history is reprojected"}
    if BEFORE in drawn:
        reason = "the scene reads time or parameters"
        return {**history, "temporal/changed": reason, "temporal/rest": reason}
    return {**history, "temporal/unchanged": "the scene reads neither time nor parameters"}
