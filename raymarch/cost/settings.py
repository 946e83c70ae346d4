"""The settings that are compared: named axes over the fields of `Quality`."""

from __future__ import annotations

import ast
import copy
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from raymarch.errors import CostError, SceneError
from raymarch.plan.marching import trusted
from raymarch.plan.plan import plan
from raymarch.plan.schedule import PIXEL, SCHEDULES
from raymarch.scene.quality import PRESETS, Quality
from raymarch.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class Axis:
    """A field of `Quality` and the values that are tried. Crossed axes are combined with each other; of the rest one
    value at a time is changed."""

    name: str
    values: tuple[Any, ...]
    crossed: bool = False


AXES = (
    Axis("tracer", ("plain", "relaxed", "enhanced", "auto_relaxed", "front"), crossed=True),
    Axis("max_steps", (16, 32, 64, 128, 512), crossed=True),
    Axis("epsilon", (2.0, 0.5, 0.1, 0.02, 0.004)),
    Axis("schedule", ("single", "two", "four", "six", "cone", "cones")),
    Axis("correction", ("proven", "slope", "none")),
    Axis("normals", ("analytic", "tetrahedron", "central", "forward")),
    Axis("beta", (0.15, 0.3, 0.6)),
    Axis("step_scale", (0.7, 1.0)),
    Axis("shadow_steps", (16, 64, 256)),
    Axis("occlusion_samples", (2, 5, 10)),
    Axis("light_samples", (1, 4, 16)),
    Axis("samples", (1, 4, 16)),
    Axis("rays", ("computed", "interpolated")),
    Axis("scale", (0.5, 1.0)),
)
"""What `raymarch cost` tries. A name that is no field of `Quality` is passed over."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A quality under a name that says in what it differs from the base; and the preset that it is, if it is one."""

    name: str
    quality: Quality
    preset: str | None = None


def axes(names: Sequence[str] | None = None, given: Mapping[str, Sequence[Any]] | None = None) -> tuple[Axis, ...]:
    """The axes to sweep.

    Parameters
    ----------
    names : only these of them, all crossed; None is all that `Quality` has a field for.
    given : values in place of the default ones, by name; a field that has no default axis may be named too.

    Raises CostError for what is no field of `Quality`.
    """
    known = [f.name for f in fields(Quality)]
    own = dict(given or {})
    for name in (*(names or ()), *own):
        if name not in known:
            raise CostError(f"axis {name!r}", legal=f"a field of Quality: {', '.join(known)}")
    defaults = {axis.name: axis for axis in AXES if axis.name in known}
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

    Combinations that `Quality` refuses, and those that come to the same for this scene, are left out.
    """
    base = scene.quality
    chosen = list(chosen)
    crossed, single = [a for a in chosen if a.crossed], [a for a in chosen if not a.crossed]
    changes: list[dict[str, Any]] = [{}]
    changes += [
        dict(zip((a.name for a in crossed), combination, strict=True))
        for combination in itertools.product(*(a.values for a in crossed))
        if crossed
    ]
    changes += [{axis.name: value} for axis in single for value in axis.values]
    found: dict[Quality, Setting] = {settled(scene, base, size): Setting("base", base)}
    for name in PRESETS:
        quality = Quality.preset(name)
        meant = settled(scene, quality, size)
        found[meant] = replace(found.get(meant, Setting(name, quality)), preset=name)
    for change in changes:
        try:
            quality = replace(base, **change)
        except SceneError:
            continue
        meant = settled(scene, quality, size)
        found.setdefault(meant, Setting(named(change), quality))
    return list(found.values())


def settled(scene: Scene, quality: Quality, size: tuple[int, int] | None = None) -> Quality:
    """A quality with what the plan makes of it for this scene: the tracer and the schedule that are taken, the epsilon
    that is meant. `size` of the picture, by which the plan chooses the schedule."""
    marching = plan(with_quality(scene, quality), size=size).marching
    tracer = marching.tracer
    certified = trusted(with_quality(scene, quality))
    levels = tuple(level for level in marching.schedule.levels if level != PIXEL)
    schedule = next(name for name, known in SCHEDULES.items() if known.levels == levels)
    omega = quality.omega if tracer == quality.tracer else None
    scale = quality.step_scale if tracer == "plain" else 1.0
    beta = quality.beta if tracer in ("auto_relaxed", "front") else 0.3
    return replace(
        quality,
        schedule=schedule,
        tracer=tracer,
        epsilon=quality.near(certified),
        omega=omega,
        step_scale=scale,
        beta=beta,
    )


def with_quality(scene: Scene, quality: Quality) -> Scene:
    """The same scene with another quality; the given one stays as it is."""
    made = copy.copy(scene)
    made.quality = quality
    return made


def named(change: Mapping[str, Any]) -> str:
    """A short name: "front 64 steps", "epsilon 0.5"; "base" where nothing changes."""
    words = []
    for name, value in change.items():
        match name:
            case "tracer":
                words.append(str(value))
            case "max_steps":
                words.append(f"{value} steps")
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
        try:
            replace(Quality(), **{name: given})
        except SceneError as fault:
            if name != "omega":  # whose range depends on the tracer
                raise CostError(f"axis {name} = {given!r}", legal=fault.legal) from None
        except TypeError:
            raise CostError(f"axis {name!r}", legal=f"a field of Quality: {_names()}") from None
    return values


def _names() -> str:
    return ", ".join(f.name for f in fields(Quality))
