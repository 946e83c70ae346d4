"""The draw calls of a frame: one loop draws the passes of a plan, each as often as it states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from raymarch.gpu.budget import Budget
from raymarch.gpu.part import Part, covering
from raymarch.gpu.prepare import Prepared
from raymarch.gpu.program import Program
from raymarch.gpu.resource_cache import ResourceCache
from raymarch.gpu.targets import Target
from raymarch.plan import Pass
from raymarch.plan.marching import Level
from raymarch.scene.post import PICTURE, Stage

PLASTIC = 1.3247179572447460
"""The real root of x^3 = x + 1; its powers define the two-dimensional sequence of lowest known discrepancy."""

CENTRE: Mapping[str, Any] = {"u_lens": (0.0, 1.0)}
"""The uniforms of a pass whose rays start at the centre of the lens."""


MOST_BANDS = 32
"""Maximum number of frames over which one pass that adds light is spread."""


@dataclass(frozen=True, slots=True)
class DrawCall:
    """A pass with its program, target and uniforms. It can be drawn at once or in tiles.

    `compile` is the time in milliseconds that the driver took to compile the program; 0 if it was cached. `part` is the
    tile that it is about; None for the whole target.
    """

    chosen: Pass
    program: Program
    target: Target
    uniforms: Mapping[str, Any]
    compile: float
    part: tuple[int, int, int, int] | None = None

    def draw(self, tile: tuple[int, int, int, int] | None = None) -> None:
        """Draw without waiting for the device. tile : as in `Program.draw`; None draws `part`."""
        self.program.draw(self.target, self.uniforms, tile or self.part)


@dataclass(slots=True)
class History:
    """The state that a frame reuses from earlier frames.

    name : put before the names of its targets.
    view : the inputs of the cones that were drawn last.
    shown : the same of the last picture, which frames without a picture do not change. text : its shader text.
    samples : number of samples per pixel that were averaged since the picture changed.
    cones : whether the last picture drew its own cones.
    before : the camera uniforms of the last picture; None if there is none.
    values : all uniforms of the last picture except data textures. shader : its text, and what replaces its numbers.
    frames : number of pictures since the history was reset.
    marched : number of march passes of the picture so far. arrived : whether all rays have terminated.
    lit : number of samples of light that were added to the current sample of the picture, of `lights`; see
        `Plan.light_samples`. lighted : whether all were, or a pass adds all. rows : number of rows of the picture that
        already have the next samples of light, if a pass takes several frames. adding : number of these samples.
    """

    name: str = ""
    view: Any = None
    shown: Any = None
    text: str | None = None
    samples: int = 0
    cones: bool = True
    before: Mapping[str, Any] | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    shader: Any = None
    frames: int = 0
    marched: int = 0
    arrived: bool = False
    lit: int = 0
    lights: int = 1
    lighted: bool = True
    rows: int = 0
    adding: int = 0

    def begin(self, view: Any, text: str | None, keep: bool) -> bool:
        """Begin a frame. Returns True if the cones of the last one can be reused.

        view, text : as above; text is None for a frame without a picture. keep : False to reuse nothing.
        """
        kept = keep and view == self.view
        if text is not None:
            same = keep and view == self.shown and text == self.text
            self.samples = self.samples if same else 0
            self.marched = self.marched if kept else 0
            self.lit, self.rows = (self.lit, self.rows) if kept and same else (0, 0)
            self.lighted = True
            self.shown, self.text, self.cones = view, text, not kept
        self.view = view
        return kept


@dataclass(frozen=True, slots=True)
class Turn:
    """A draw of each pass of a group.

    uniforms : of this turn. size : of the target; None for that of the picture. target : its name; "" for the pass's.
    before : all uniforms of the last picture, if the scene changed since. kept : use what was drawn earlier.
    rows : the first row that is drawn, and the one after the last; None for all. A pass with a history reads the
        earlier one until its last row is drawn.
    """

    uniforms: Mapping[str, Any]
    size: tuple[int, int] | None = None
    target: str = ""
    before: Mapping[str, Any] | None = None
    kept: bool = False
    rows: tuple[int, int] | None = None


class Drawing:
    """The draw calls of a frame. Updates the history as if they were drawn.

    uniforms : of all passes. size : of the picture, or of the part.
    budget : the time for a march, or light, that is split into several passes. What does not fit is left to the next
        frame. Each call must then be drawn, and its time added, before the next is requested. None: light is one pass,
        and a march has the maximum number of passes.
    at : the uniforms at a time in the opening of the shutter, from -1/2 to 1/2 with 0 for the frame's time; each sample
        has its own. None if the scene does not move while the shutter is open.
    part : the part of a picture that is drawn; `ready` is then that of `prepared_part`.
    """

    def __init__(
        self,
        resources: ResourceCache,
        ready: Prepared,
        uniforms: Mapping[str, Any],
        size: tuple[int, int],
        history: History,
        budget: Budget | None = None,
        at: Callable[[float], Mapping[str, Any]] | None = None,
        part: Part | None = None,
    ) -> None:
        self.resources, self.ready, self.uniforms, self.size = resources, ready, uniforms, size
        self.history, self.budget, self.at, self.part = history, budget, at, part
        self._before_last = 0.0  # milliseconds of the frame up to the passes that follow those that add light
        self._added = True  # whether this frame adds light to the whole picture
        self.carried: dict[str, Any] = {"footprint_pixels": ready.plan.scene.quality.footprint}
        if part is not None:
            self.carried["u_corner"] = part.box(size)[:2]
        """Uniforms that passes leave to later ones, and the textures that were written last, by name."""
        self.kept: dict[str, tuple[Pass, Target]] = {}
        """Passes whose arrays are those of an earlier frame, with their targets, by name."""

    def __iter__(self) -> Iterator[DrawCall]:
        keep = self.ready.plan.scene.quality.temporal != "off"
        view = _view(self.ready, self.uniforms, self.size)
        kept = self.history.begin(view, self.ready.texts.get("color"), keep)
        for _, group in groupby(self.ready.plan.passes, key=lambda p: p.often == "sample" or p.name):
            passes = tuple(group)
            for turn in TURNS[passes[0].often](self, passes, kept):
                for chosen in passes:
                    for part in self._parts(chosen, turn):
                        yield from self._drawn(chosen, part)
        if self.budget is not None and self._before_last and self._added:
            self.ready.pace.followed((self.budget.spent - self._before_last) / math.prod(self.size))

    def _parts(self, chosen: Pass, turn: Turn) -> Iterator[Turn]:
        """The draws of a pass in a turn. A pass that adds samples of light is drawn until all are added, or the time is
        over; without a budget, once. A sample that lacks light does not replace the mean of earlier ones."""
        history, plan = self.history, self.ready.plan
        count = plan.light_samples(turn.uniforms.get("light_turns", self.uniforms.get("light_turns", 1)))
        if chosen.lights == "before":
            yield replace(turn, kept=history.lit > 0 or history.rows > 0)
        elif chosen.lights == "after":
            yield replace(turn, kept=not self._added or (not history.lighted and history.samples > 0))
        elif chosen.lights == "":
            yield turn
        elif plan.marching.resumed and not history.arrived:  # rays on their way are shown with the first lights
            history.lit, history.lighted = 0, False
            yield _lit(turn, 0, self._next(count)[0])
        elif history.lit >= count:
            yield replace(turn, kept=True)
        else:
            history.lights, self._added = count, False
            height, drawn = self.size[1], False
            while history.lit < count:
                samples, end = self._next(count - history.lit, drawn=drawn)
                if not samples:
                    break
                begin, drawn = history.rows, True
                lit = _lit(turn, history.lit, history.lit + samples)
                yield lit if end - begin == height else replace(lit, rows=(begin, end))
                self._timed(samples, (end - begin) / height)
                history.rows, history.adding = end % height, samples
                if end == height:
                    history.lit, self._added = history.lit + samples, True
            history.lighted = history.lit >= count

    def _next(self, rest: int, *, drawn: bool = False) -> tuple[int, int]:
        """What the next draw adds: a number of samples of light, of those that are left, up to a row of the picture.
        (0, 0) leaves them to the next frame. drawn : this frame has added some.

        As many samples as fit into the budget, if they take more time than it takes to read the surface. Else so many,
        over several frames. The first draw of a picture is for all its rows, so that there is a picture.
        """
        budget, pace, history, (width, height) = self.budget, self.ready.pace, self.history, self.size
        most = self.ready.plan.scene.quality.lights_per_pass
        if budget is None or isinstance(most, int):
            history.rows = 0
            late = budget is not None and budget.over and pace.time(rest) * width * height > budget.left + budget.grace
            if drawn and late:
                return 0, 0
            return min(most, rest) if budget is not None and isinstance(most, int) else rest, height
        left = budget.left / (width * height) - pace.after
        samples = history.adding
        if not history.rows:
            if pace.time(rest) <= left + budget.grace / (width * height):
                return rest, height
            samples, worth = min(pace.fitting(left), rest), min(pace.worth, rest)
            if not (history.lit or history.samples):
                return max(samples, 1), height
            if samples >= worth:
                return samples, height
            samples = worth
        share = pace.share(samples, left)
        if drawn and (left <= 0.0 or share * MOST_BANDS < 1.0):
            return 0, 0
        return samples, min(history.rows + max(int(share * height), -(-height // MOST_BANDS)), height)

    def _timed(self, samples: int, share: float = 1.0) -> None:
        """Count the pass that was drawn last, which added samples of light to a fraction of the picture."""
        if self.budget is not None:
            if self.budget.last is not None:
                self.ready.pace.add(samples, self.budget.last / (share * math.prod(self.size)))
            self._before_last = self.budget.spent

    def _read_by(self, chosen: Pass) -> dict[str, Any]:
        """What earlier passes left to one. The scene's shader gives names that it does not use itself to parameters."""
        own = frozenset(self.ready.shader.parameters.values()) if chosen.effect is None else frozenset[str]()
        return {name: value for name, value in self.carried.items() if name not in own}

    def pair_of(self, chosen: Pass) -> str:
        """The name of the pair of targets of a pass with a history."""
        return f"{self.history.name}{chosen.name} history"

    def _drawn(self, chosen: Pass, turn: Turn) -> Iterator[DrawCall]:
        """The draw call of a pass in a turn, if there is one. Later passes then read what it writes."""
        size = turn.size or self.size
        pair = self.resources.pair(self.pair_of(chosen), size, chosen.textures) if chosen.history else None
        target = pair.back if pair else self.resources.target(turn.target or chosen.name, size, chosen.textures)
        if not (turn.kept or (chosen.changed and turn.before is None)):
            program, compiling = self.resources.program(self.ready, chosen.name)
            uniforms = {
                **self.uniforms,
                **self._read_by(chosen),
                **(CENTRE if chosen.sharp else {}),
                **turn.uniforms,
                **((turn.before or {}) if chosen.changed else {}),
                **({name: (pair.front, i) for i, name in enumerate(chosen.history)} if pair else {}),
                **self.ready.constants.get(chosen.name, {}),
            }
            rows = turn.rows and (0, turn.rows[0], size[0], turn.rows[1] - turn.rows[0])
            yield DrawCall(chosen, program, target, uniforms, compiling, rows)
            if pair and (turn.rows is None or turn.rows[1] == size[1]):
                pair.swap()
        written = pair.front if pair else target
        if turn.kept and chosen.outputs:
            self.kept[chosen.name] = (chosen, written)
        self.carried |= {name: (written, i) for i, name in enumerate(chosen.writes)}


def _lit(turn: Turn, first: int, end: int) -> Turn:
    """The same turn for some samples of light."""
    return replace(turn, uniforms={**turn.uniforms, "u_first_sample": first, "u_end_sample": end})


def _steps(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """The passes of a split march, each with some steps of all rays, until all have terminated."""
    history, plan = drawing.history, drawing.ready.plan
    steps_per_pass, count = plan.scene.quality.steps_per_pass, plan.marching.passes
    assert steps_per_pass is not None
    if kept and "color" not in drawing.ready.texts:
        yield Turn({}, kept=True)
        return
    history.marched = history.marched if kept else 0
    if history.marched >= count:
        yield Turn({}, kept=True)
    while history.marched < count:
        steps = min(steps_per_pass, plan.marching.steps - history.marched * steps_per_pass)
        begin, end = history.marched == 0, history.marched == count - 1
        yield Turn({"march_steps": steps, "u_begin": begin, "u_end": end})
        history.marched += 1
        if drawing.budget is not None and history.marched < count:
            if not drawing.resources.count_active(drawing.pair_of(passes[0])):
                history.marched = count
            elif drawing.budget.over:
                break
    history.arrived = history.marched >= count


def _samples(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """One turn for each sample.

    If the history is reprojected and anything except the camera changed since the last frame, a pass between the sample
    and the picture has the uniforms of that frame.
    """
    history, ready, uniforms = drawing.history, drawing.ready, drawing.uniforms
    reprojected = len(passes) > 1 and not ready.plan.lights_split
    begin, end = (drawing.part and drawing.part.samples) or (0, ready.plan.scene.quality.samples)
    rest = end - begin
    single = ready.plan.marching.resumed  # one ray per pixel, whatever the number of frames
    if ready.plan.lights_split:  # the rest of a frame that ended early
        rest -= history.samples % rest
    camera = {name: uniforms[uniform] for name, uniform in CAMERA.items()}
    earlier = camera if history.before is None else history.before
    shader = history.text, ready.constants
    known = reprojected and history.shader == shader and not _is_cut(earlier, camera, uniforms["u_far"])
    cameras = {f"u_before_{name}": value for name, value in earlier.items()} if reprojected else {}
    for _ in range(rest):
        still, number = history.samples > 0, begin + history.samples
        own = {
            **(drawing.at(moment(number)) if drawing.at is not None else {}),
            **cameras,
            "footprint_pixels": ready.plan.scene.quality.footprint_of(number),
            "u_jitter": r2(number) if still or not known else halton(history.frames % PERIOD),
            "u_sample": number if still or not known else history.frames,
            "u_keep": still or known,
            "u_still": still,
        }
        changed = known and not still and any(p.changed for p in passes) and _changed(ready, uniforms, history)
        before = {f"u_now_{name}": value for name, value in camera.items()} if changed else None
        if before is not None:
            before |= _earlier(drawing.resources, ready, history)
        yield Turn({**own, "u_changed": changed}, before=before)
        if not history.lighted:
            break
        if not single:
            history.samples += 1
            history.lit = 0
    if drawing.at is not None:  # textures of the samples may have taken the place of those of the frame
        drawing.uniforms = {**drawing.uniforms, **drawing.at(0.0)}
    if reprojected:
        history.before, history.shader = camera, shader
        history.frames += 1
        history.values = {name: v for name, v in uniforms.items() if name not in ready.shader.samples}


def _view(ready: Prepared, uniforms: Mapping[str, Any], size: tuple[int, int]) -> Any:
    """All inputs of the cones and of the picture, for comparison: the field, the quality, the camera and all values."""
    left_out = {"u_lights", "u_light_cells"} | (set() if ready.shader.uses_time else {"u_time"})  # light_rows are read
    read = {name: value for name, value in uniforms.items() if name not in left_out}
    numbers = tuple((name, _content(value)) for name, value in sorted(read.items()))
    constants = tuple((name, *sorted(values.items())) for name, values in sorted(ready.constants.items()))
    return ready.plan.field.body, ready.plan.scene.quality, numbers, constants, size


def _content(value: Any) -> Any:
    """The value of a uniform, for comparison: numbers by their bits, textures by identity."""
    if isinstance(value, int | float | tuple | list | np.ndarray):
        return np.asarray(value, np.float64).tobytes()
    return id(value)


def _changed(ready: Prepared, uniforms: Mapping[str, Any], history: History) -> bool:
    """True if the scene, except its camera, differs from that of the last picture."""
    names = {uniform for name, uniform in ready.shader.parameters.items() if name not in ready.plan.twins}
    names |= {"u_lights", "u_sky_light"} | ({"u_time"} if ready.shader.uses_time else set())
    return any(_content(uniforms[name]) != _content(history.values[name]) for name in names & set(uniforms))


def _earlier(resources: ResourceCache, ready: Prepared, history: History) -> dict[str, Any]:
    """The uniforms of the last picture, to replace those of this one."""
    twins = {ready.shader.parameters[name] for name in ready.plan.twins}
    lost = {"u_lights", "u_light_cells"} if not resources.has_lights(history.values.get("u_lights")) else set()
    return {name: value for name, value in history.values.items() if name not in twins | lost}


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


def _levels(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """The levels of cones, from coarse to fine. The rays read the last one."""
    plan, part, carried = drawing.ready.plan, drawing.part, drawing.carried
    jittered, levels = plan.marching.jittered, plan.marching.schedule.levels
    # Mesa's software renderer recompiles a program for each kind of bound texture, even if it is not read: the first
    # level gets a texture of the same kind as the other levels.
    carried |= {"u_carried": drawing.resources.target("no cone", UNREAD), "u_carried_cell": (0.0, 0.0)}
    whole = drawing.size if part is None else part.whole
    boxes = [(0, 0, *level.size(drawing.size)) for level in levels]
    if part is not None:
        boxes = covering(part.box(drawing.size), whole, levels)
        carried |= {"u_carried_corner": (0.0, 0.0), "u_carried_size": UNREAD}
    for i, level in enumerate(levels):
        cell, footprint = cells(level, whole, jittered)
        own = {
            "u_cell": cell,
            "u_footprint": footprint,
            **_cone(footprint, drawing.uniforms, "ORTHOGRAPHIC" in plan.variants),
            "march_steps": max(1, round(level.share * plan.scene.quality.max_steps)),
            **({} if part is None else {"u_corner": boxes[i][:2]}),
        }
        yield Turn(own, boxes[i][2:], f"cone {i}", kept=kept)
        carried["u_carried_cell"] = cell
        if part is not None:
            carried |= {"u_carried_corner": boxes[i][:2], "u_carried_size": level.size(whole)}
    carried |= {
        "u_cell": (1.0, 1.0),
        "u_footprint": (0.5, 0.5) if jittered else (0.0, 0.0),
        "u_cone": 0.0,
        "u_cone_start": 0.0,
        "march_steps": plan.marching.steps,
        "u_spent": 1.0 if drawing.history.cones or plan.scene.quality.temporal == "off" else 0.0,
    }


def stages_of(chosen: Pass, uniforms: Mapping[str, Any], size: tuple[int, int]) -> list[Stage]:
    """The stages of a post effect in a frame, of which these are the uniforms."""
    assert chosen.effect is not None
    own = f"{chosen.name}."
    return chosen.effect.stages({n.removeprefix(own): v for n, v in uniforms.items() if n.startswith(own)}, size)


def _effect(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """The stages of a post effect. Each reads the picture, or earlier ones."""
    written = {PICTURE: drawing.carried["u_color"]}
    for number, stage in enumerate(stages_of(passes[0], drawing.uniforms, drawing.size)):
        reads = {name: written[index] for name, index in stage.reads.items()}
        yield Turn({**stage.uniforms, **reads}, stage.size, f"{passes[0].name} {number}")
        written[number] = drawing.carried["u_color"]


TURNS: Mapping[str, Callable[[Drawing, tuple[Pass, ...], bool], Iterator[Turn]]] = {
    "once": lambda drawing, passes, kept: iter([Turn({})]),
    "level": _levels,
    "steps": _steps,
    "sample": _samples,
    "effect": _effect,
}
"""How often passes are drawn, by `Pass.often`."""


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


def count_draws(drawing: Drawing) -> int:
    """The maximum number of draw calls of a frame."""
    ready = drawing.ready
    marching = ready.plan.marching
    several = {
        "level": len(marching.schedule.levels),
        "steps": marching.passes,
        "sample": ready.plan.scene.quality.samples,
    }
    effects = [p for p in ready.plan.passes if p.effect is not None]
    stages = sum(len(stages_of(p, drawing.uniforms, drawing.size)) for p in effects)
    most = ready.plan.scene.quality.lights_per_pass
    samples = ready.plan.light_samples(drawing.uniforms.get("light_turns", 1)) if ready.plan.lights_split else 1
    lights = 1 if drawing.budget is None else -(-samples // (most if isinstance(most, int) else 1))
    turns = (several.get(p.often, 1) * (lights if p.lights == "each" else 1) for p in ready.plan.passes if not p.effect)
    return stages + sum(turns)


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
