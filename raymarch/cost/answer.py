"""The short answer of a sweep: the fastest settings within 0.5, 0.05 and 0.005 pixels."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.cost.rivals import candidates, chosen, most_exact, reach
from raymarch.cost.sweep import Point, Sweep

BOUNDS = (0.5, 0.05, 0.005)
"""Errors in pixels that the answer is given for."""


def answers(made: Sweep, bounds: Sequence[float] = BOUNDS) -> list[tuple[float, Point]]:
    """The bounds in pixels, coarsest first, each with the setting to recommend within it; bounds that no setting meets
    are left out. Empty if nothing is hit."""
    if made.blank:
        return []
    able = [made.base] if closed(made) else candidates(made)
    found: list[tuple[float, Point]] = []
    for bound in sorted(bounds):
        within = [p for p in able if reach(p) <= bound]
        if within:
            found.append((bound, chosen(within, made, found[-1][1] if found else None)))
    return found[::-1]


def finest(made: Sweep) -> Point | None:
    """The most exact setting to recommend; None if no setting finds every hit, or nothing is hit."""
    if made.blank:
        return None
    if closed(made):
        return made.base
    able = candidates(made)
    return most_exact(able, made) if able else None


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
    if made.blank:
        return (
            f"{where}, a frame of {made.name} takes {_time(made.base, made)} and shows no surface, as the reference "
            "does: no hit has an error, and no setting is recommended."
        )
    found, best = answers(made), finest(made)
    if best is None:
        return f"{where}, no setting finds every hit of {made.name}{_everywhere(made)}: see the table."
    error = figures(reach(best))
    if not found:
        doubt = " Its field is an estimate, which proves neither these hits nor those of the reference."
        return (
            f"{where}, no setting draws {made.name} within {BOUNDS[0]} px{_everywhere(made)}: the most accurate one, "
            f"{best.name}, is within {error} px and takes {_time(best, made)} a frame.{doubt if made.estimate else ''}"
        )
    if closed(made):
        return (
            f"{where}, a frame of {made.name} takes {_time(best, made)}, and marching settings change neither time nor "
            f"error: every ray is solved in closed form, within {error} px."
        )
    settings = grouped(found)
    parts = [f"{_time(point, made)} {phrase(bounds)}" for bounds, point in settings]
    if len(settings) == 1 and best is settings[0][1]:
        whose = "the scene's own setting" if best is made.base else f"the setting {best.name}"
        others = "no other is surely faster or more exact"
        return f"{where}, a frame of {made.name} takes {parts[0]} with {whose}; {others}."
    parts[0] = f"a frame of {made.name} takes {parts[0]}"
    if best is found[-1][1]:
        end = f"; no setting is surely more exact than that one, {error} px."
    else:
        end = f"; the most exact setting, {error} px, takes {_time(best, made)}."
    return f"{where}, {', '.join(parts)}{end}"


def _everywhere(made: Sweep) -> str:
    return " in all views" if made.views else ""


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
        f"  {title:{widest}}  {_milliseconds(point):>8}  {figures(reach(point)):>9} px  {code(point)}"
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


def _milliseconds(point: Point) -> str:
    return f"{figures(point.time.value)} ms"


def _time(point: Point, made: Sweep) -> str:
    """The time of a frame; evaluations if no times were taken."""
    if made.untimed:
        return f"{figures(point.evaluations)} evaluations per pixel"
    return f"{_milliseconds(point)}{' of CPU time' * by_cpu(made)}"


def by_cpu(made: Sweep) -> bool:
    """True if the times are CPU time, because the driver renders on the CPU."""
    return bool(made.environment["clock"]["kind"] == "CPU time")


def device(made: Sweep) -> str:
    """The name of the renderer without its version."""
    return str(made.environment["driver"]["renderer"]).split(" (")[0]


def figures(value: float, digits: int = 2) -> str:
    """A number with significant digits, two by default, and no exponent: 0.00091, 8.4, 120."""
    if value == 0 or value != value:
        return "0" if value == 0 else "-"
    if abs(value) >= 100:
        return f"{value:.0f}"
    return f"{float(f'{value:.{digits}g}'):.{8 + digits}f}".rstrip("0").rstrip(".")
