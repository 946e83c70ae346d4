"""The settings that are compared: named axes over the fields of `Quality`, of `Setting`, and of the scene's light."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

from raymarch.cost.variants import VARIANTS, varied
from raymarch.errors import CostError, PlanError, SceneError
from raymarch.plan.marching import PIXEL, SCHEDULES, Marching, refined, unmarched
from raymarch.plan.plan import Plan, marched_otherwise, plan
from raymarch.scene.quality import PRESETS, Quality
from raymarch.scene.scene import Scene
from raymarch.scene.tracer import OwnTracer


@dataclass(frozen=True, slots=True)
class Axis:
    """A field and its candidate values.

    The field is one of `Quality`, `frames` or `scale` of a `Setting`, or one of `raymarch.cost.variants`. Crossed axes
    are combined; the others change one at a time.
    """

    name: str
    values: tuple[Any, ...]
    crossed: bool = False


AXES = (
    Axis("tracer", ("plain", "relaxed", "enhanced", "auto_relaxed", "bracketing"), crossed=True),
    Axis("max_steps", (16, 32, 64, 128, 512), crossed=True),
    Axis("epsilon", (2.0, 0.5, 0.1, 0.02, 0.004)),
    Axis("analytic", (True, False)),
    Axis("bounding_volumes", (True, False)),
    Axis("schedule", ("single", "two", "four", "six", "cone", "cones")),
    Axis("refinement", ("proven", "slope", "none")),
    Axis("normals", ("analytic", "tetrahedron", "central", "forward")),
    Axis("beta", (0.15, 0.3, 0.6)),
    Axis("step_scale", (0.7, 1.0)),
    Axis("samples", (1, 4, 16)),
    Axis("edges", ("samples", "distance")),
    Axis("frames", (4, 16)),
    Axis("scale", (0.5, 2.0)),
    Axis("rays", ("computed", "interpolated")),
    Axis("shadow_steps", (8, 16, 32)),
    Axis("light_samples", (1, 4)),
    Axis("masking", ("correlated", "separable")),
    *(Axis(v.name, v.values) for v in VARIANTS.values()),
)
"""Default axes of `raymarch cost`."""

LIGHT = {"shadow_steps", "light_samples", "masking", *VARIANTS}
"""Axes that change the light, but no hit."""

MARCHING = set("tracer max_steps epsilon omega beta step_scale schedule refinement steps_per_pass".split())
"""Fields of `Quality` that change where hits lie and nothing else of the picture."""

DRAWN = {"frames": (1, 256), "scale": (0.1, 4.0)}
"""Axes that are fields of a `Setting`, and the ends of their ranges."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Settings to render a scene with; the name lists the differences from the base.

    quality : the quality to render with. preset : its name if it is a preset.
    frames : number of frames whose mean is the picture; all of them are timed.
    scale : width of the frame over that of the picture; the picture is resampled from the frame.
    variations : names and values of `raymarch.cost.variants`.
    light : True if the setting changes the light, which errors of depth do not show.
    """

    name: str
    quality: Quality
    preset: str | None = None
    frames: int = 1
    scale: float = 1.0
    variations: tuple[tuple[str, Any], ...] = ()
    light: bool = False

    def of(self, scene: Scene) -> Scene:
        """The scene with this setting. ValueError if a variation does not apply to the scene."""
        made = varied(scene, self.variations)
        if made is None:
            raise ValueError(f"{self.name}: the scene has nothing to change")
        return made.replace(quality=self.quality)

    def size(self, size: tuple[int, int]) -> tuple[int, int]:
        """Size of the frame for a picture of some size."""
        width, height = (max(1, round(self.scale * n)) for n in size)
        return width, height


def axes(names: Sequence[str] | None = None, given: Mapping[str, Sequence[Any]] | None = None) -> tuple[Axis, ...]:
    """The axes to sweep.

    names : use these axes only, all crossed; None is all of AXES.
    given : values that replace the default ones, by name; a field without a default axis is allowed too.

    Raises CostError for an unknown name.
    """
    known = _known()
    own = dict(given or {})
    for name in (*(names or ()), *own):
        if name not in known:
            raise CostError(f"axis {name!r}", legal=", ".join(known))
    defaults = {axis.name: axis for axis in AXES}
    for name, values in own.items():
        defaults[name] = Axis(name, tuple(values), defaults[name].crossed if name in defaults else False)
    if names is None:
        return tuple(defaults.values())
    missing = [name for name in names if name not in defaults]
    if missing:
        raise CostError(f"axis {missing[0]!r} without values", legal=f"--axis {missing[0]}=VALUE,VALUE,...")
    return tuple(replace(defaults[name], crossed=True) for name in names)


def grid(scene: Scene, chosen: Iterable[Axis], size: tuple[int, int] | None = None) -> list[Setting]:
    """The settings of a sweep: the scene's own first, the presets, the crossed axes, then the others one at a time.

    Combinations that `Quality` or the plan rejects, and duplicates for this scene, are left out.
    """
    base = scene.quality
    found: dict[Any, Setting] = {_meant(scene, Setting("base", base), size): Setting("base", base)}
    for name in PRESETS:
        made = Setting(name, base.to_preset(name))
        meant = _meant(scene, made, size)
        found[meant] = replace(found.get(meant, made), preset=name)
    for change in _changes([_with_own(axis, base) for axis in chosen]):
        try:
            made = setting(base, change)
            meant = _meant(scene, made, size)
        except (SceneError, PlanError, ValueError):
            continue
        found.setdefault(meant, made)
    return list(found.values())


def _with_own(axis: Axis, base: Quality) -> Axis:
    """The axis of tracers with the tracer of the scene itself, if that is a function."""
    own = axis.name == "tracer" and isinstance(base.tracer, OwnTracer)
    return replace(axis, values=(*axis.values, base.tracer)) if own else axis


def _changes(chosen: Sequence[Axis]) -> list[dict[str, Any]]:
    crossed, single = [a for a in chosen if a.crossed], [a for a in chosen if not a.crossed]
    combined = itertools.product(*(a.values for a in crossed)) if crossed else []
    changes = [dict(zip((a.name for a in crossed), values, strict=True)) for values in combined]
    return changes + [{axis.name: value} for axis in single for value in axis.values]


def setting(base: Quality, change: Mapping[str, Any]) -> Setting:
    """A setting from changes by axis name. SceneError for illegal values."""
    drawn = {name: value for name, value in change.items() if name in DRAWN}
    variations = tuple((name, value) for name, value in change.items() if name in VARIANTS)
    quality = {name: value for name, value in change.items() if name not in DRAWN and name not in VARIANTS}
    if drawn.get("frames", 1) > 1:
        quality["temporal"] = "accumulate"
    light = bool(LIGHT & change.keys())
    return Setting(named(change), replace(base, **quality), variations=variations, light=light, **drawn)


def _meant(scene: Scene, made: Setting, size: tuple[int, int] | None) -> Any:
    """Key of a setting: equal for two that render the same picture and have the same reference."""
    drawn = None if size is None else made.size(size)
    varied_scene = made.of(scene)
    return settled(varied_scene, made.quality, drawn), made.frames, made.scale, made.variations


@lru_cache(maxsize=128)  # a search and a grid ask for the same settings again and again, and each needs a plan
def settled(scene: Scene, quality: Quality, size: tuple[int, int] | None = None) -> Quality:
    """A quality with the plan's choices for this scene: tracer, schedule, closed forms, boxes and effective epsilon.

    size : of the picture; the plan chooses the schedule by it.
    """
    made = scene.replace(quality=quality)
    planned = marched_otherwise(_planned(scene.replace(quality=unmarched(quality)), size), quality, size)
    tracer = planned.marching.tracer
    shadowed = any(light.shadow for light in scene.lights)
    discs = any(light.soft and light.penumbra == "sampled" for light in scene.lights)
    return replace(
        quality,
        schedule=schedule_of(planned.marching),
        tracer=tracer,
        epsilon=quality.near(refined(made)),
        omega=quality.omega if tracer == quality.tracer else None,
        beta=quality.beta if tracer in ("auto_relaxed", "bracketing") else 0.3,
        shadow_steps=quality.shadow_steps if shadowed and quality.shadow_steps != quality.secondary_steps else None,
        light_samples=quality.light_samples if discs else 1,
        analytic=planned.analytic.used,
        bounding_volumes=quality.bounding_volumes if planned.bounding.used else False,
        masking=quality.masking if any(m.physical for m in scene.materials) else "correlated",
    )


@lru_cache(maxsize=8)
def _planned(scene: Scene, size: tuple[int, int] | None) -> Plan:
    return plan(scene, size=size)


def schedule_of(marching: Marching) -> str:
    """The name of the schedule that the plan chose."""
    levels = tuple(level for level in marching.schedule.levels if level != PIXEL)
    return next(name for name, known in SCHEDULES.items() if known.levels == levels)


def marches_alone(made: Setting, base: Quality) -> bool:
    """True if a setting differs from a quality in the march alone, so that their pictures differ by error only."""
    drawn = (made.frames, made.scale, made.variations) == (1, 1.0, ())
    return drawn and MARCHING.issuperset(differences(made.quality, base))


def differences(quality: Quality, other: Quality) -> list[str]:
    """The names of the fields in which two qualities differ."""
    return [f.name for f in fields(Quality) if getattr(quality, f.name) != getattr(other, f.name)]


def named(change: Mapping[str, Any]) -> str:
    """A short name: "bracketing, 64 steps", "epsilon 0.5"; "base" without changes."""
    words = []
    for name, value in change.items():
        match name:
            case "tracer":
                words.append(str(value))
            case "max_steps" | "frames":
                words.append(f"{value} {name.removeprefix('max_')}")
            case _:
                words.append(f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}")
    return ", ".join(words) or "base"


def parse_values(name: str, text: str) -> tuple[Any, ...]:
    """The values of an axis as written on the command line: numbers, True, False, None, or words."""

    def value(part: str) -> Any:
        try:
            return ast.literal_eval(part)
        except (ValueError, SyntaxError):
            return part

    values = tuple(value(part.strip()) for part in text.split(",") if part.strip())
    if not values:
        raise CostError(f"axis {name!r} without values", legal="NAME=VALUE,VALUE,...")
    for given in values:
        _check_value(name, given)
    return values


def _check_value(name: str, given: Any) -> None:
    """Raise CostError for an axis that is not known, and for a value that it does not take."""
    if name not in _known():
        raise CostError(f"axis {name!r}", legal=", ".join(_known()))
    legal = ""
    if name in VARIANTS:
        legal = "" if VARIANTS[name].is_legal(given) else VARIANTS[name].legal
    elif name in DRAWN:
        (low, high), scale = DRAWN[name], name == "scale"
        if type(given) not in ((int, float) if scale else (int,)) or not low <= given <= high:
            legal = f"{'a number' if scale else 'an integer'} from {low:g} to {high:g}"
    else:
        try:
            replace(Quality(), **{name: given})
        except SceneError as fault:
            legal = "" if name == "omega" else fault.legal  # the range of omega depends on the tracer
    if legal:
        raise CostError(f"axis {name} = {given!r}", legal=legal)


def _known() -> list[str]:
    return [*(f.name for f in fields(Quality)), *DRAWN, *VARIANTS]
