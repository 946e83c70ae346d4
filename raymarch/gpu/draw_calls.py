"""The draw calls of a frame: one loop draws the passes of a plan, each as often as it states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from raymarch.gpu.budget import Budget
from raymarch.gpu.draw_call import CENTRE, DrawCall
from raymarch.gpu.frame_inputs import FrameInputs, content
from raymarch.gpu.history import GridState, History
from raymarch.gpu.interlaced import Interlaced
from raymarch.gpu.part import PicturePart, covering
from raymarch.gpu.prepare import Prepared
from raymarch.gpu.resource_cache import ResourceCache
from raymarch.gpu.sequences import halton, moment, r2
from raymarch.gpu.targets import Target
from raymarch.gpu.turn import Turn
from raymarch.plan import Pass, marching
from raymarch.plan.marching import Level
from raymarch.scene.post import PICTURE, Stage

MOST_BANDS = 32
"""Maximum number of frames over which one pass that adds light is spread."""


class Drawing:
    """The draw calls of a frame. Updates the history as if they were drawn.

    inputs : of all passes. size : of the picture, or of the part.
    budget : the time for a march, or light, that is split into several passes. What does not fit is left to the next
        frame. Each call must then be drawn, and its time added, before the next is requested. None: light is one pass,
        and a march has the maximum number of passes.
    at : the inputs at a time in the opening of the shutter, from -1/2 to 1/2 with 0 for the frame's time; each sample
        has its own. None if the scene does not move while the shutter is open.
    part : the part of a picture that is drawn; `ready` is then that of `prepared_part`.
    grids : the inputs of another plan of the frame, for a picture within a budget that is drawn grid by grid.
    """

    def __init__(
        self,
        resources: ResourceCache,
        ready: Prepared,
        inputs: FrameInputs,
        size: tuple[int, int],
        history: History,
        budget: Budget | None = None,
        at: Callable[[float], FrameInputs] | None = None,
        part: PicturePart | None = None,
        grids: Callable[[Prepared], FrameInputs] | None = None,
    ) -> None:
        self.grids = grids
        self.resources, self.ready, self.inputs, self.size = resources, ready, inputs, size
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
        compared = _compared(self.ready, self.inputs, self.size)
        kept = self.history.begin(compared, self.ready.texts.get("color"), keep)
        interlaced = self._is_interlaced(kept)
        cells = self.ready.cells
        for key, group in groupby(self.ready.plan.passes, key=partial(_joined, interlaced)):
            passes = tuple(group)
            if key is INTERLACED:
                within = self._in_grids()
                yield from Interlaced(within)
                cells = within.ready.cells
                self._before_last = self.budget.spent if self.budget is not None else 0.0
                continue
            for turn in TURNS[passes[0].often](self, passes, kept):
                for chosen in passes:
                    for part in self._parts(chosen, turn):
                        yield from self._drawn(chosen, part)
        if interlaced and self.budget is not None:
            cells.followed(self.budget.spent - self._before_last)
        elif self.budget is not None and self._before_last and self._added:
            self.ready.pace.followed((self.budget.spent - self._before_last) / math.prod(self.size))

    def _is_interlaced(self, kept: bool) -> bool:
        """True if the picture is drawn grid by grid. One that is complete, and was not, stays."""
        history, plan = self.history, self.ready.plan
        able = plan.marching.resumed and marching.interlaced(plan.scene)
        if not able or self.grids is None or "color" not in self.ready.texts:
            return False
        whole = kept and history.march.arrived and not history.grid.used
        if self.budget is not None and self.budget.interlaced and not whole:
            return True
        if history.grid.used:
            history.grid, history.march.passes = GridState(), 0
        return False

    def _in_grids(self) -> Drawing:
        ready, inputs = self.ready.in_grids, self.grids
        assert inputs is not None
        found = Drawing(self.resources, ready, inputs(ready), self.size, self.history, self.budget)
        found.carried, found.kept = self.carried, self.kept
        return found

    def _parts(self, chosen: Pass, turn: Turn) -> Iterator[Turn]:
        """The draws of a pass in a turn. A pass that adds samples of light is drawn until all are added, or the time is
        over; without a budget, once. A sample that lacks light does not replace the mean of earlier ones."""
        history, plan = self.history, self.ready.plan
        count = plan.light_samples(turn.light_turns or self.inputs.light_turns)
        if chosen.lights == "before":
            yield replace(turn, kept=history.light.added > 0 or history.light.rows > 0)
        elif chosen.lights == "after":
            yield replace(turn, kept=not self._added or (not history.light.complete and history.mean.samples > 0))
        elif chosen.lights == "":
            yield turn
        elif plan.marching.resumed and not history.march.arrived:  # rays on their way are shown with the first lights
            history.light.added, history.light.complete = 0, False
            yield _lit(turn, 0, self._next(count)[0])
        elif history.light.added >= count:
            yield replace(turn, kept=True)
        else:
            history.light.count, self._added = count, False
            height, drawn = self.size[1], False
            while history.light.added < count:
                samples, end = self._next(count - history.light.added, drawn=drawn)
                if not samples:
                    break
                begin, drawn = history.light.rows, True
                lit = _lit(turn, history.light.added, history.light.added + samples)
                yield lit if end - begin == height else replace(lit, rows=(begin, end))
                self._timed(samples, (end - begin) / height)
                history.light.rows, history.light.adding = end % height, samples
                if end == height:
                    history.light.added, self._added = history.light.added + samples, True
            history.light.complete = history.light.added >= count

    def _next(self, rest: int, *, drawn: bool = False) -> tuple[int, int]:
        """What the next draw adds: a number of samples of light, of those that are left, up to a row of the picture.
        (0, 0) leaves them to the next frame. drawn : this frame has added some.

        As many samples as fit into the budget, if they take more time than it takes to read the surface. Else so many,
        over several frames. The first draw of a picture is for all its rows, so that there is a picture.
        """
        budget, pace, history, (width, height) = self.budget, self.ready.pace, self.history, self.size
        most = self.ready.plan.scene.quality.lights_per_pass
        if budget is None or isinstance(most, int):
            history.light.rows = 0
            late = budget is not None and budget.over and pace.time(rest) * width * height > budget.left + budget.grace
            if drawn and late:
                return 0, 0
            return min(most, rest) if budget is not None and isinstance(most, int) else rest, height
        left = budget.left / (width * height) - pace.after
        samples = history.light.adding
        if not history.light.rows:
            if pace.time(rest) <= left + budget.grace / (width * height):
                return rest, height
            samples, worth = min(pace.fitting(left), rest), min(pace.worth, rest)
            if not (history.light.added or history.mean.samples):
                return max(samples, 1), height
            if samples >= worth:
                return samples, height
            samples = worth
        share = pace.share(samples, left)
        if drawn and (left <= 0.0 or share * MOST_BANDS < 1.0):
            return 0, 0
        return samples, min(history.light.rows + max(int(share * height), -(-height // MOST_BANDS)), height)

    def _timed(self, samples: int, share: float = 1.0) -> None:
        """Count the pass that was drawn last, which added samples of light to a fraction of the picture."""
        if self.budget is not None:
            if self.budget.last is not None:
                self.ready.pace.add(samples, self.budget.last / (share * math.prod(self.size)))
            self._before_last = self.budget.spent

    def read_by(self, chosen: Pass) -> dict[str, Any]:
        """What earlier passes left to one. The scene's shader gives names that it does not use itself to parameters."""
        own = frozenset(self.ready.shader.parameters.values()) if chosen.effect is None else frozenset[str]()
        return {name: value for name, value in self.carried.items() if name not in own}

    def pair_of(self, chosen: Pass) -> str:
        """The name of the pair of targets of a pass with a history."""
        return f"{self.history.name}{chosen.pair}"

    def _drawn(self, chosen: Pass, turn: Turn) -> Iterator[DrawCall]:
        """The draw call of a pass in a turn, if there is one. Later passes then read what it writes."""
        size = turn.size or self.size
        pair = self.resources.pair(self.pair_of(chosen), size, chosen.textures) if chosen.history else None
        target = pair.back if pair else self.resources.target(turn.target or chosen.name, size, chosen.textures)
        if turn.draws(chosen):
            program, compiling = self.resources.program(self.ready, chosen.name)
            uniforms = {
                **self.inputs.uniforms,
                **self.read_by(chosen),
                **(CENTRE if chosen.sharp else {}),
                **turn.uniforms,
                **((turn.before or {}) if chosen.when == "changed" else {}),
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
        wrote = {name: (written, i) for i, name in enumerate(chosen.writes)}
        self.carried |= wrote if turn.kept or turn.draws(chosen) else {**wrote, **self.carried}


INTERLACED = "interlaced"


def _joined(interlaced: bool, chosen: Pass) -> Any:
    """Neighbours with equal results are drawn in turns."""
    if interlaced and chosen.often != "level" and chosen.effect is None:
        return INTERLACED
    return chosen.often == "sample" or chosen.name


def _lit(turn: Turn, first: int, end: int) -> Turn:
    """The same turn for some samples of light."""
    return replace(turn, uniforms={**turn.uniforms, "u_first_sample": first, "u_end_sample": end})


def _steps(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """The passes of a split march, each with some steps of all rays, until all have terminated."""
    history, plan = drawing.history, drawing.ready.plan
    steps_per_pass, count = plan.scene.quality.steps_per_pass, plan.marching.passes
    assert steps_per_pass is not None
    if kept and "color" not in drawing.ready.texts and not history.grid.used:
        yield Turn({}, kept=True)
        return
    history.march.passes = history.march.passes if kept else 0
    if history.march.passes >= count:
        yield Turn({}, kept=True)
    while history.march.passes < count:
        steps = min(steps_per_pass, plan.marching.steps - history.march.passes * steps_per_pass)
        begin, end = history.march.passes == 0, history.march.passes == count - 1
        yield Turn({"march_steps": steps, "u_begin": begin, "u_end": end})
        history.march.passes += 1
        if drawing.budget is not None and history.march.passes < count:
            if not drawing.resources.count_active(drawing.pair_of(passes[0])):
                history.march.passes = count
            elif drawing.budget.over:
                break
    history.march.arrived = history.march.passes >= count


def _samples(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """One turn for each sample.

    If the history is reprojected and anything except the camera changed since the last frame, a pass between the sample
    and the picture has the uniforms of that frame.
    """
    history, ready, uniforms = drawing.history, drawing.ready, drawing.inputs.uniforms
    reprojected = len(passes) > 1 and not ready.plan.lights_split
    begin, end = (drawing.part and drawing.part.samples) or (0, ready.plan.scene.quality.samples)
    rest = end - begin
    single = ready.plan.marching.resumed  # one ray per pixel, whatever the number of frames
    if ready.plan.lights_split:  # the rest of a frame that ended early
        rest -= history.mean.samples % rest
    camera = {name: uniforms[uniform] for name, uniform in CAMERA.items()}
    earlier = camera if history.earlier.camera is None else history.earlier.camera
    shader = history.mean.text, ready.constants
    known = reprojected and history.earlier.shader == shader and not _is_cut(earlier, camera, uniforms["u_far"])
    cameras = {f"u_before_{name}": value for name, value in earlier.items()} if reprojected else {}
    rests = all(content(earlier[name]) == content(value) for name, value in camera.items())
    for _ in range(rest):
        still, number = history.mean.samples > 0, begin + history.mean.samples
        index = number if still or not known else history.earlier.frames
        then = drawing.at(moment(number)) if drawing.at is not None else None
        own = {
            **({} if then is None else then.uniforms),
            **cameras,
            "footprint_pixels": ready.plan.scene.quality.footprint_of(number),
            "u_jitter": r2(index) if index == number or rests else halton(index % PERIOD),
            "u_sample": index,
            "u_keep": still or known,
            "u_camera_rests": rests,
        }
        compares = known and not still and any(p.when == "changed" for p in passes)
        changed = compares and _changed(ready, uniforms, history)
        before = {f"u_now_{name}": value for name, value in camera.items()} if changed else None
        if before is not None:
            before |= _earlier(drawing.resources, ready, history)
        turns = None if then is None else then.light_turns
        yield Turn({**own, "u_changed": changed}, before=before, light_turns=turns, still=still)
        if not history.light.complete:
            break
        if not single:
            history.mean.samples += 1
            history.light.added = 0
    if drawing.at is not None:  # textures of the samples may have taken the place of those of the frame
        drawing.inputs = drawing.inputs.with_uniforms(drawing.at(0.0).uniforms)
    if reprojected:
        history.earlier.camera, history.earlier.shader = camera, shader
        history.earlier.frames += 1
        history.earlier.uniforms = {name: v for name, v in uniforms.items() if name not in ready.shader.samples}


def _compared(ready: Prepared, inputs: FrameInputs, size: tuple[int, int]) -> Any:
    """All inputs of the cones and of the picture, for comparison: the field, the quality, the camera and all values."""
    left_out = ("u_lights", "u_light_cells", *(() if ready.shader.uses_time else ("u_time",)))  # rows are compared
    constants = tuple((name, *sorted(values.items())) for name, values in sorted(ready.constants.items()))
    return ready.plan.field.body, ready.plan.scene.quality, inputs.content(*left_out), constants, size


def _changed(ready: Prepared, uniforms: Mapping[str, Any], history: History) -> bool:
    """True if the scene, except its camera, differs from that of the last picture."""
    names = {uniform for name, uniform in ready.shader.parameters.items() if name not in ready.plan.twins}
    names |= {"u_lights", "u_sky_light"} | ({"u_time"} if ready.shader.uses_time else set())
    return any(content(uniforms[name]) != content(history.earlier.uniforms[name]) for name in names & set(uniforms))


def _earlier(resources: ResourceCache, ready: Prepared, history: History) -> dict[str, Any]:
    """The uniforms of the last picture, to replace those of this one."""
    twins = {ready.shader.parameters[name] for name in ready.plan.twins}
    lost = (
        {"u_lights", "u_light_cells"} if not resources.has_lights(history.earlier.uniforms.get("u_lights")) else set()
    )
    return {name: value for name, value in history.earlier.uniforms.items() if name not in twins | lost}


CAMERA = {
    "position": "u_camera_position",
    "frame": "u_camera_frame",
    "tan_half_fov": "u_tan_half_fov",
    "half_height": "u_half_height",
}
"""The uniforms of the camera."""

PERIOD = 16
"""Period of the jitter of a moving camera, in samples: about the length of its history."""


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
            **_cone(footprint, drawing.inputs.uniforms, "ORTHOGRAPHIC" in plan.variants),
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
        "u_spent": 1.0 if drawing.history.mean.own_cones or plan.scene.quality.temporal == "off" else 0.0,
    }


def stages_of(chosen: Pass, inputs: FrameInputs, size: tuple[int, int]) -> list[Stage]:
    """The stages of a post effect in a frame with these inputs."""
    assert chosen.effect is not None
    return chosen.effect.stages(inputs.effects[chosen.name], size)


def _effect(drawing: Drawing, passes: tuple[Pass, ...], kept: bool) -> Iterator[Turn]:
    """The stages of a post effect. Each reads the picture, or earlier ones."""
    written = {PICTURE: drawing.carried["u_color"]}
    for number, stage in enumerate(stages_of(passes[0], drawing.inputs, drawing.size)):
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
    stages = sum(len(stages_of(p, drawing.inputs, drawing.size)) for p in effects)
    most = ready.plan.scene.quality.lights_per_pass
    samples = ready.plan.light_samples(drawing.inputs.light_turns) if ready.plan.lights_split else 1
    lights = 1 if drawing.budget is None else -(-samples // (most if isinstance(most, int) else 1))
    turns = (several.get(p.often, 1) * (lights if p.lights == "each" else 1) for p in ready.plan.passes if not p.effect)
    return stages + sum(turns)
