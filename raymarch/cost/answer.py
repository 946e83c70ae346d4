"""The short answer of a sweep: the fastest settings within 0.5, 0.05 and 0.005 pixels."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.cost.settings import differences
from raymarch.cost.sweep import Point, Sweep

BOUNDS = (0.5, 0.05, 0.005)
"""Errors in pixels that the answer is given for."""
METRIC = "pixels_p99"
"""The error that is bounded: 99 % of the hits away from silhouettes lie within it."""
REST = 10.0
"""Of the other hits, all but one in a thousand lie within this many times the bound. So a whole face that is wrong is
not hidden by a large floor that is right."""
MARCHING = set("tracer max_steps epsilon omega beta step_scale schedule refinement steps_per_pass".split())
"""Fields of `Quality` that change where hits lie and nothing else of the picture."""


def candidates(made: Sweep) -> list[Point]:
    """The sound settings that change the marching alone, so that their pictures differ from the scene's by error only.

    Fewer rays per pixel, other normals or another resolution would be cheaper in ways that the distance of hits does
    not show.
    """
    base = made.base.setting.quality
    return [
        p
        for p in made.comparable(METRIC)
        if p.error(METRIC) < float("inf")
        and (p.setting.frames, p.setting.scale, p.setting.variations) == (1, 1.0, ())
        and MARCHING.issuperset(differences(p.setting.quality, base))
    ]


def reach(point: Point) -> float:
    """The least bound in pixels that a setting keeps: 99 % of its hits within it, and 99.9 % within ten times of it."""
    rest = point.errors.pixels_p999 / REST
    return max(point.error(METRIC), 0.0 if rest != rest else rest)


def answers(made: Sweep, bounds: Sequence[float] = BOUNDS) -> list[tuple[float, Point]]:
    """The bounds in pixels, coarsest first, each with the fastest setting within it; bounds that no setting meets are
    left out."""
    able = [made.base] if closed(made) else candidates(made)
    found = []
    for bound in bounds:
        within = [p for p in able if reach(p) <= bound]
        if within:
            found.append((bound, min(within, key=lambda p: (p.time.value, reach(p)))))
    return found


def finest(made: Sweep) -> Point | None:
    """The most accurate setting; None if no setting finds every hit."""
    if closed(made):
        return made.base
    return min(candidates(made), key=lambda p: (reach(p), p.time.value), default=None)


def closed(made: Sweep) -> bool:
    """True if the scene's own setting solves every ray in closed form, so that no setting of the marching matters."""
    base = made.base
    return base.evaluations == 0 and base.errors.pixels > 0 and base.errors.sound


def sentence(made: Sweep) -> str:
    """The answer in words, with the size, the device and the time of the measurement."""
    width, height = made.known.size
    where = f"At {width}×{height} on this machine ({device(made)})"
    if made.moment is not None:
        where += f", {made.moment:g} s into the animation"
    found, best = answers(made), finest(made)
    if best is None:
        return f"{where}, no setting finds every hit of {made.name}: see the table."
    error = figures(best.error(METRIC))
    if not found:
        doubt = " Its field is an estimate, which proves neither these hits nor those of the reference."
        return (
            f"{where}, no setting draws {made.name} within {BOUNDS[0]} px: the most accurate one, {best.name}, is "
            f"within {error} px and takes {_time(best)} a frame.{doubt if made.estimate else ''}"
        )
    if closed(made):
        return (
            f"{where}, a frame of {made.name} takes {_time(best)}, and marching settings change neither time nor "
            f"error: every ray is solved in closed form, within {error} px."
        )
    parts = [f"{_time(point)} {phrase(bounds)}" for bounds, point in grouped(found)]
    parts[0] = f"a frame of {made.name} takes {parts[0]}"
    if best is found[-1][1]:
        end = f"; no setting is more exact than that one, {error} px."
    else:
        end = f"; the most exact setting, {error} px, takes {_time(best)}."
    return f"{where}, {', '.join(parts)}{end}"


def titled(made: Sweep) -> list[tuple[str, Point]]:
    """The answers and the most accurate setting: each setting once, after what it is."""
    found = [(phrase(bounds), point) for bounds, point in grouped(answers(made))]
    if found and closed(made):
        found = [("solved in closed form", made.base)]
    best = finest(made)
    if best is not None and all(point is not best for _, point in found):
        found.append(("the most exact setting", best))
    return found


def advice(made: Sweep) -> list[str]:
    """The answers as lines of a terminal: what a setting reaches, its time, its error and its Python."""
    found = titled(made)
    widest = max((len(title) for title, _ in found), default=0)
    return [
        f"  {title:{widest}}  {_time(point):>8}  {figures(point.error(METRIC)):>9} px  {code(point)}"
        for title, point in found
    ]


def code(point: Point) -> str:
    """The Python that renders with a setting."""
    return f"rm.{point.setting.quality!r}"


def grouped(found: Sequence[tuple[float, Point]]) -> list[tuple[tuple[float, ...], Point]]:
    """The answers by their settings: one setting may be the fastest within several bounds."""
    points = {id(point): point for _, point in found}
    return [(tuple(bound for bound, p in found if p is point), point) for point in points.values()]


def phrase(bounds: Sequence[float]) -> str:
    """The least of some error bounds in words: "within 0.05 px". A setting within it is within the others."""
    return f"within {figures(min(bounds))} px"


def _time(point: Point) -> str:
    return f"{figures(point.time.value)} ms"


def device(made: Sweep) -> str:
    """The name of the renderer without its version."""
    return str(made.environment["driver"]["renderer"]).split(" (")[0]


def figures(value: float) -> str:
    """A number with two significant digits and no exponent: 0.00091, 8.4, 120."""
    if value == 0 or value != value:
        return "0" if value == 0 else "-"
    if abs(value) >= 100:
        return f"{value:.0f}"
    return f"{float(f'{value:.2g}'):.10f}".rstrip("0").rstrip(".")
