"""The data of the explorer page: points, effects and pictures, as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from raymarch.cost.answer import answers, by_cpu, code, finest
from raymarch.cost.effects import Effect
from raymarch.cost.location import location
from raymarch.cost.maps import flip_map, footprint_map, under_map
from raymarch.cost.pictures import Pictures, Pixels
from raymarch.cost.settings import differences
from raymarch.cost.sweep import METRICS, Point, Sweep
from raymarch.cost.text import held_against, labelled
from raymarch.gpu.frame import srgb

PLOTTED = ("pixels_p99", "pixels_max", "normal_p99", "flip_p99")
"""Errors that the page plots, and the one that the front is computed by."""
COSTS = {
    "ms": ("time of a frame", "ms"),
    "evaluations": ("evaluations of the field per pixel", ""),
    "shader_bytes": ("size of the shader", "bytes"),
    "first_ms": ("first frame after compilation", "ms"),
}
"""Costs that the page plots: description and unit."""


def page_data(made: Sweep, metric: str, effects: Sequence[Effect]) -> dict[str, Any]:
    """Everything that the page's script shows."""
    pictures = Pictures()
    reference = pictures.add(srgb(made.known.picture))
    under = under_map(made.known)
    errors = {name: METRICS[name] for name in PLOTTED} | {"wrong": ("missed and false hits", "")}
    errors |= {metric: METRICS[metric]}
    bounds = {id(point): bound for bound, point in reversed(answers(made))}
    matter = {id(p) for p in made.front(metric)} | set(bounds) | {id(p) for p in made.points if p.setting.preset}
    best = finest(made)
    costs = COSTS | ({"ms": ("CPU time of a frame", "ms")} if by_cpu(made) else {})
    points = [_point(p, made, pictures, errors, under, p is made.base or id(p) in matter) for p in made.points]
    for given, point in zip(made.points, points, strict=True):
        point["bound"] = bounds.get(id(given))
        point["finest"] = best is given
    return {
        "name": made.name,
        "size": list(made.known.size),
        "metric": metric,
        "errors": {name: {"label": label, "unit": unit} for name, (label, unit) in errors.items()},
        "costs": {name: {"label": label, "unit": unit} for name, (label, unit) in costs.items()},
        "reference": reference,
        "points": points,
        "effects": [_effect(e, pictures) for e in effects],
        "pictures": pictures.uris(),
    }


def _point(
    point: Point, made: Sweep, pictures: Pictures, errors: Any, under: Pixels, important: bool
) -> dict[str, Any]:
    where, time = location(point), point.time
    known = point.errors.as_dict() | {"wrong": point.errors.missed + point.errors.false}
    found: dict[str, Any] = {
        "name": labelled(point),
        "preset": point.setting.preset,
        "base": point is made.base,
        "tracer": point.tracer,
        "schedule": point.schedule,
        "changes": changes(point, made.base),
        "sound": point.errors.sound,
        "light": point.setting.light,
        "comparable": point.known is made.known,
        "against": held_against(point, made),
        "code": code(point),
        "errors": {name: known[name] for name in errors},
        "costs": {
            "ms": time.value,
            "evaluations": point.evaluations,
            "shader_bytes": point.shader_bytes,
            "first_ms": point.first_ms,
        },
        "interval": [time.low, time.high],
        "where": where.words,
        "worst": [where.column + 0.5, where.row + 0.5, where.largest],
        "map": pictures.add(footprint_map(point.known, point.depth, under), important, peaks=True),
        "picture": None,
        "flip": None,
    }
    if point.color is not None and point.difference is not None:
        found["picture"] = pictures.add(srgb(point.color), important)
        found["flip"] = pictures.add(flip_map(point.known, point.difference, under), important, peaks=True)
    return found


def changes(point: Point, base: Point) -> list[str]:
    """The axes in which a setting differs from the scene's own, in words."""
    own, others = point.setting, base.setting
    names = differences(own.quality, others.quality)
    names += [name for name in ("frames", "scale") if getattr(own, name) != getattr(others, name)]
    if "frames" in names and "temporal" in names:
        names.remove("temporal")
    return [name.replace("_", " ") for name in (*names, *(name for name, _ in own.variations))]


def _effect(effect: Effect, pictures: Pictures) -> dict[str, Any]:
    time = effect.milliseconds
    return {
        "name": effect.name,
        "ms": time.value,
        "interval": [time.low, time.high],
        "share": effect.share,
        "evaluations": effect.evaluations,
        "shader_bytes": effect.shader_bytes,
        "flip": effect.flip_mean,
        "with": pictures.add(srgb(effect.color)),
        "without": pictures.add(srgb(effect.color_without)),
    }
