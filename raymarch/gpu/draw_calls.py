"""The draw calls of a frame in order: cones from coarse to fine, then the requested passes, once per sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from raymarch.gpu.part import Part, covering
from raymarch.gpu.prepare import Prepared
from raymarch.gpu.program import Program
from raymarch.gpu.resource_cache import ResourceCache
from raymarch.gpu.targets import Target
from raymarch.plan import Pass
from raymarch.plan.schedule import Level

PLASTIC = 1.3247179572447460
"""The real root of x^3 = x + 1; its powers define the two-dimensional sequence of lowest known discrepancy."""


SHARP = ("geometry", "slice")
"""Passes whose rays start at the centre of the lens."""


@dataclass(frozen=True, slots=True)
class DrawCall:
    """A pass with its program, target and uniforms. It can be drawn at once or in tiles.

    `compile` is the time in milliseconds that the driver took to compile the program; 0 if it was cached.
    """

    chosen: Pass
    program: Program
    target: Target
    uniforms: Mapping[str, Any]
    compile: float

    def draw(self, tile: tuple[int, int, int, int] | None = None) -> None:
        """Draw without waiting for the device. tile : as in `Program.draw`."""
        self.program.draw(self.target, self.uniforms, tile)


@dataclass(slots=True)
class History:
    """The state that a frame reuses from earlier frames.

    Attributes
    ----------
    view : the inputs of the cones that were drawn last.
    text : the shader text of the last picture.
    samples : number of samples per pixel that were averaged since the picture changed.
    cones : whether the last picture drew its own cones.
    before : the camera uniforms of the last picture; None if there is none.
    values : all uniforms of the last picture except data textures. shader : its text.
    frames : number of pictures since the history was reset.
    marched : number of march passes of the picture so far. arrived : whether all rays have terminated.
    """

    view: Any = None
    text: str | None = None
    samples: int = 0
    cones: bool = True
    before: Mapping[str, Any] | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    shader: str | None = None
    frames: int = 0
    marched: int = 0
    arrived: bool = False

    def begin(self, view: Any, text: str | None, keep: bool) -> bool:
        """Begin a frame. Returns True if the cones of the last one can be reused.

        view, text : as above; text is None for a frame without a picture. keep : False to reuse nothing.
        """
        kept = keep and view == self.view
        if text is not None:
            if not kept or text != self.text:
                self.samples = 0
            self.marched = self.marched if kept else 0
            self.text, self.cones = text, not kept
        self.view = view
        return kept


def draw_calls_of(
    resources: ResourceCache,
    ready: Prepared,
    uniforms: Mapping[str, Any],
    size: tuple[int, int],
    history: History,
    enough: Callable[[], bool] | None = None,
    at: Callable[[float], Mapping[str, Any]] | None = None,
    part: Part | None = None,
) -> Iterator[DrawCall]:
    """All draw calls of a frame. Updates `history` as if they were drawn.

    at : the uniforms at a time in the opening of the shutter, from -1/2 to 1/2 with 0 for the frame's time; each sample
        has its own. None if the scene does not move while the shutter is open.
    part : the part of a picture that is drawn, of this size; `ready` is then that of `prepared_part`.
    enough : called after each pass of a march that is split into several; True postpones the rest to the next frame.
        Each call must then be drawn before the next is requested. None makes the maximum number of passes.
    """
    keep = ready.plan.scene.quality.temporal != "off"
    kept = history.begin(_view(ready, uniforms, size), ready.texts.get("color"), keep)
    rays = dict(uniforms)
    if part is not None:
        rays["u_corner"] = part.box(size)[:2]
    if ready.plan.marching.cones:
        cones, carried = _cones(resources, ready, uniforms, size, part)
        yield from [] if kept else cones
        rays.update(carried, u_spent=1.0 if history.cones or not keep else 0.0)
    for chosen in ready.plan.passes:
        if chosen.module == "view/accumulate":
            yield from _samples(resources, ready, chosen, rays, size, history, at, part)
        elif chosen.module == "temporal/resolve":
            yield from _joined(resources, ready, chosen, rays, size, history)
            history.values = {name: v for name, v in uniforms.items() if name not in ready.shader.samples}
            history.shader = history.text
        elif chosen.name == "march":
            if not (kept and "color" not in ready.texts):
                history.marched = history.marched if kept else 0
                yield from _marched(resources, ready, chosen, rays, size, history, enough)
            state = resources.pair("march", size, chosen.textures).front
            rays |= {"u_march": (state, 0), "u_found": (state, 1)}
        elif chosen.name not in ("cone", "sample", "before"):
            sharp = {"u_lens": (0.0, 1.0)} if chosen.name in SHARP else {}
            target = resources.target(chosen.name, size, chosen.textures)
            yield _call(resources, ready, chosen, target, {**rays, **sharp})


def _marched(
    resources: ResourceCache,
    ready: Prepared,
    chosen: Pass,
    uniforms: Mapping[str, Any],
    size: tuple[int, int],
    history: History,
    enough: Callable[[], bool] | None,
) -> Iterator[DrawCall]:
    """The passes of a split march, each with some steps of all rays, into alternate targets, until all have
    terminated."""
    plan = ready.plan
    steps_per_pass = plan.scene.quality.steps_per_pass
    assert steps_per_pass is not None
    passes = plan.marching.passes
    pair = resources.pair("march", size, chosen.textures)
    while history.marched < passes:
        steps = min(steps_per_pass, plan.marching.steps - history.marched * steps_per_pass)
        own = {
            **uniforms,
            "march_steps": steps,
            "u_begin": history.marched == 0,
            "u_end": history.marched == passes - 1,
        }
        own |= {"u_march": (pair.front, 0), "u_found": (pair.front, 1), "u_more": (pair.front, 2)}
        yield _call(resources, ready, chosen, pair.back, own)
        pair.swap()
        history.marched += 1
        if enough is not None and history.marched < passes:
            if not resources.count_active(pair):
                history.marched = passes
            elif enough():
                break
    history.arrived = history.marched >= passes


def _view(ready: Prepared, uniforms: Mapping[str, Any], size: tuple[int, int]) -> Any:
    """All inputs of the cones, for comparison: the field, the quality, the camera and all values."""
    read = {name: value for name, value in uniforms.items() if name != "u_time" or ready.shader.uses_time}
    numbers = tuple((name, _content(value)) for name, value in sorted(read.items()))
    constants = tuple((name, *sorted(values.items())) for name, values in sorted(ready.constants.items()))
    return ready.plan.field.body, ready.plan.scene.quality, numbers, constants, size


def _content(value: Any) -> Any:
    """The value of a uniform, for comparison: numbers by their bits, textures by identity."""
    if isinstance(value, int | float | tuple | list | np.ndarray):
        return np.asarray(value, np.float64).tobytes()
    return id(value)


def _call(
    resources: ResourceCache, ready: Prepared, chosen: Pass, target: Target, uniforms: Mapping[str, Any]
) -> DrawCall:
    program, compiling = resources.program(ready, chosen.name)
    own = ready.constants.get(chosen.name)
    return DrawCall(chosen, program, target, {**uniforms, **own} if own else uniforms, compiling)


def _samples(
    resources: ResourceCache,
    ready: Prepared,
    chosen: Pass,
    uniforms: Mapping[str, Any],
    size: tuple[int, int],
    history: History,
    at: Callable[[float], Mapping[str, Any]] | None,
    part: Part | None,
) -> Iterator[DrawCall]:
    """One draw call per sample, into alternate targets. at : as of `draw_calls_of`."""
    pair = resources.pair("history", size)
    first, end = (part and part.samples) or (0, ready.plan.scene.quality.samples)
    for _ in range(first, end):
        own = {
            **uniforms,
            **(at(moment(first + history.samples)) if at is not None else {}),
            "u_history": pair.front,
            "u_keep": history.samples > 0,
            "u_jitter": r2(first + history.samples),
            "u_sample": first + history.samples,
        }
        yield _call(resources, ready, chosen, pair.back, own)
        pair.swap()
        history.samples += 1


def _joined(
    resources: ResourceCache,
    ready: Prepared,
    chosen: Pass,
    uniforms: Mapping[str, Any],
    size: tuple[int, int],
    history: History,
) -> Iterator[DrawCall]:
    """Two draw calls per sample: the sample itself, and its combination with the history.

    If anything except the camera changed since the last frame, a draw between them uses the uniforms of that frame.
    """
    sample = next(p for p in ready.plan.passes if p.name == "sample")
    pair = resources.pair("history", size, chosen.textures)
    target = resources.target(sample.name, size, sample.textures)
    before = next((p for p in ready.plan.passes if p.name == "before"), None)
    camera = {name: uniforms[uniform] for name, uniform in CAMERA.items()}
    known = history.before is not None and not _is_cut(history.before, camera, uniforms["u_far"])
    for _ in range(ready.plan.scene.quality.samples):
        still = history.samples > 0
        jitter = r2(history.samples) if still or not known else halton(history.frames % PERIOD)
        own = {**uniforms, "u_jitter": jitter, "u_sample": history.samples if still else history.frames}
        yield _call(resources, ready, sample, target, own)
        joined = {
            **own,
            "u_color": (target, 0),
            "u_surface": (target, 1),
            "u_history": (pair.front, 0),
            "u_history_surface": (pair.front, 1),
            "u_keep": still or known,
            "u_still": still,
            **{f"u_before_{name}": value for name, value in (history.before or camera).items()},
        }
        if before is not None:
            changed = known and not still and _changed(ready, uniforms, history)
            earlier = resources.target(before.name, size, before.textures)
            if changed:
                there = {**own, **_earlier(resources, ready, own, history), "u_surface": (target, 1)}
                there |= {f"u_now_{name}": value for name, value in camera.items()}
                yield _call(resources, ready, before, earlier, there)
            joined |= {"u_changed": changed, "u_earlier_color": (earlier, 0), "u_earlier_motion": (earlier, 1)}
        yield _call(resources, ready, chosen, pair.back, joined)
        pair.swap()
        history.samples += 1
    history.before = camera
    history.frames += 1


def _scene_values(ready: Prepared) -> set[str]:
    """Names of the uniforms through which the scene can change, except those of the camera."""
    names = {uniform for name, uniform in ready.shader.parameters.items() if name not in ready.plan.twins}
    return names | {"u_lights", "u_sky_light"} | ({"u_time"} if ready.shader.uses_time else set())


def _changed(ready: Prepared, uniforms: Mapping[str, Any], history: History) -> bool:
    """True if the scene differs from that of the last picture."""
    names = _scene_values(ready) & set(uniforms)
    return history.shader == history.text and any(
        _content(uniforms[name]) != _content(history.values[name]) for name in names
    )


def _earlier(
    resources: ResourceCache, ready: Prepared, uniforms: Mapping[str, Any], history: History
) -> dict[str, Any]:
    """The uniforms of the last picture, to replace those of this one."""
    twins = {ready.shader.parameters[name] for name in ready.plan.twins}
    lost = {"u_lights"} if not resources.has_lights(history.values.get("u_lights")) else set()
    return {name: value for name, value in history.values.items() if name in uniforms and name not in twins | lost}


CAMERA = {
    "position": "u_camera_position",
    "frame": "u_camera_frame",
    "tan_half_fov": "u_tan_half_fov",
    "half_height": "u_half_height",
}
"""The uniforms of the camera."""

PERIOD = 16
"""Period of the jitter of a moving picture, in samples: about the length of its history."""


def _is_cut(before: Mapping[str, Any], camera: Mapping[str, Any], far: float) -> bool:
    """True if the camera changed so much between two frames that the history is useless: a rotation of more than 1/3
    radian, a translation of more than a tenth of `far`, or a zoom by a factor of 1.5."""
    turned = float(np.dot(np.asarray(before["frame"])[:, 2], np.asarray(camera["frame"])[:, 2])) < math.cos(1 / 3)
    moved = float(np.linalg.norm(np.subtract(before["position"], camera["position"]))) > 0.1 * far
    before_size, size = (now["tan_half_fov"] or now["half_height"] for now in (before, camera))
    zoomed = not 2 / 3 < before_size / size < 3 / 2
    return turned or moved or zoomed


# Cones

UNREAD = (3, 3)
"""Size of a texture that is bound and not read. Edges are no powers of two, which Mesa treats as another kind of
texture."""


def _cones(
    resources: ResourceCache,
    ready: Prepared,
    uniforms: Mapping[str, Any],
    size: tuple[int, int],
    part: Part | None,
) -> tuple[list[DrawCall], dict[str, Any]]:
    """The draw calls of all cone levels, and the uniforms by which the rays read the last level."""
    plan = ready.plan
    (chosen,) = (p for p in plan.passes if p.name == "cone")
    steps = plan.scene.quality.max_steps
    jittered = plan.marching.jittered
    # Mesa's software renderer recompiles a program for each kind of bound texture, even if it is not read: the first
    # level gets a texture of the same kind as the other levels.
    carried: dict[str, Any] = {"u_carried": resources.target("no cone", UNREAD), "u_carried_cell": (0.0, 0.0)}
    draw_calls = []
    levels = plan.marching.schedule.levels
    whole = size if part is None else part.whole
    boxes = [(0, 0, *level.size(size)) for level in levels]
    if part is not None:
        boxes = covering(part.box(size), whole, levels)
        carried |= {"u_carried_corner": (0.0, 0.0), "u_carried_size": UNREAD}
    for i, level in enumerate(levels):
        target = resources.target(f"cone {i}", boxes[i][2:], chosen.textures)
        cell, footprint = cells(level, whole, jittered)
        own = {
            **uniforms,
            **carried,
            "u_cell": cell,
            "u_footprint": footprint,
            **_cone(footprint, uniforms, "ORTHOGRAPHIC" in plan.variants),
            "march_steps": max(1, round(level.share * steps)),
        }
        if part is not None:
            own["u_corner"] = boxes[i][:2]
        draw_calls.append(_call(resources, ready, chosen, target, own))
        carried = {"u_carried": target, "u_carried_cell": cell}
        if part is not None:
            carried |= {"u_carried_corner": boxes[i][:2], "u_carried_size": level.size(whole)}
    rays = {
        "u_cell": (1.0, 1.0),
        "u_footprint": (0.5, 0.5) if jittered else (0.0, 0.0),
        "u_cone": 0.0,
        "u_cone_start": 0.0,
        "march_steps": plan.marching.steps,
    }
    return draw_calls, {**carried, **rays}


def cells(level: Level, size: tuple[int, int], jittered: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    """Width and height of a level's cells in pixels, and the half extent of the part of a cell that contains rays.

    Rays pass through pixel centres unless they are jittered. If cells consist of entire pixels, no ray passes through
    the outer half pixel of a cell.
    """
    cell, footprint = [], []
    for pixels, count in zip(size, level.size(size), strict=True):
        edge = pixels / count
        cell.append(edge)
        footprint.append(0.5 * (edge - 1.0) if pixels % count == 0 and not jittered else 0.5 * edge)
    return (cell[0], cell[1]), (footprint[0], footprint[1])


def widest(footprint: tuple[float, float], pixel: float) -> float:
    """The largest distance between the unit direction at a cell's centre and that of another of its rays.

    footprint : half extent of the part of a cell that contains rays, in pixels. pixel : width of a pixel at distance 1.

    This is a chord of the unit sphere. For an offset h in the image plane it is at most 2 sin(atan(h / 2)), which is
    reached if the camera's axis bisects it. Padded by 2 ulp for the rounding of directions.
    """
    offset = math.hypot(*footprint) * pixel
    return 2.0 * math.sin(math.atan(0.5 * offset)) + 2.0**-22


def _cone(footprint: tuple[float, float], uniforms: Mapping[str, Any], parallel: bool) -> dict[str, float]:
    """The width of a cell's cone: its radius at the camera, and the growth of the radius.

    A ray that starts at a point of the lens meets the one from its centre in the plane in focus. Both directions differ
    by at most a chord of the unit sphere, and their origins by the radius of the lens.
    """
    pixel = uniforms["u_pixel"]
    lens, focus = uniforms["u_lens"]
    spread = 2.0 * math.sin(0.5 * math.asin(min(lens / focus, 1.0))) * (1.0 + 2.0**-20) if lens else 0.0
    start = lens * (1.0 + 2.0**-20) + (radius(footprint, pixel) if parallel else 0.0)
    return {"u_cone_start": start, "u_cone": spread + (0.0 if parallel else widest(footprint, pixel))}


def radius(footprint: tuple[float, float], pixel: float) -> float:
    """The largest distance between the rays of a cell and its centre's, for parallel rays. Parameters as of `widest`,
    but pixels have one width at all distances. Padded for the rounding of origins."""
    return math.hypot(*footprint) * pixel * (1.0 + 2.0**-10)


def count_draws(ready: Prepared) -> int:
    """The maximum number of draw calls of a frame."""
    plan = ready.plan
    quality = plan.scene.quality
    several = {
        "cone": len(plan.marching.schedule.levels),
        "march": plan.marching.passes,
        "sample": quality.samples,
    }
    joined = {"view/accumulate", "temporal/resolve"}
    return sum(several.get(p.name, quality.samples if p.module in joined else 1) for p in plan.passes)


# The position of each sample's ray in its pixel: low-discrepancy sequences.


def r2(index: int) -> tuple[float, float]:
    """Sample `index` of the R2 sequence (Roberts 2018) in [-0.5, 0.5), shifted so that sample 0 is the centre of the
    pixel."""
    x, y = (0.5 + index / PLASTIC) % 1.0, (0.5 + index / PLASTIC**2) % 1.0
    return x - 0.5, y - 0.5


def moment(index: int) -> float:
    """The time of sample `index` in the opening of the shutter, in [-0.5, 0.5): van der Corput's sequence, shifted so
    that sample 0 is the middle."""
    return (_radical_inverse(index, 2) + 0.5) % 1.0 - 0.5


def halton(index: int) -> tuple[float, float]:
    """Sample `index` of the Halton sequence in bases 2 and 3, in [-0.5, 0.5): for short periods."""
    return _radical_inverse(index + 1, 2) - 0.5, _radical_inverse(index + 1, 3) - 0.5


def _radical_inverse(number: int, base: int) -> float:
    value, place = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        value += digit * place
        place /= base
    return value
