"""A sweep as one self-contained HTML page: the answer, an interactive plot, pictures, effects and tables."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from rich.table import Table

from raymarch.cost.answer import code, figures, sentence, titled
from raymarch.cost.effects import Effect
from raymarch.cost.errors import picture_difference
from raymarch.cost.explorer import page_data
from raymarch.cost.location import location
from raymarch.cost.maps import FLIP_SCALE, FOOTPRINT_SCALE, WRONG, band_colors
from raymarch.cost.rivals import ratio, reach
from raymarch.cost.sweep import Point, Sweep
from raymarch.cost.text import (
    findings,
    first_frames,
    in_table,
    judged,
    labelled,
    light_table,
    lights_of,
    proof_words,
    table,
)
from raymarch.errors import CostError
from raymarch.files import import_optional
from raymarch.gpu.scale import Scale


def templates() -> Any:
    """The environment of the page's templates. CostError if jinja2 is not installed."""
    jinja2 = import_optional("the page", "jinja2", "report", CostError)
    return jinja2.Environment(loader=jinja2.FunctionLoader(_text), autoescape=True, undefined=jinja2.StrictUndefined)


def as_html(made: Sweep, metric: str = "pixels_p99", effects: Sequence[Effect] = ()) -> str:
    """The page as text. It needs nothing from elsewhere.

    effects : of the same scene, see `raymarch.cost.effects.ablate`. CostError if jinja2 is missing.
    """
    page = templates().get_template("explorer.html")
    where = location(made.base)
    data = json.dumps(page_data(made, metric, effects), separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return str(
        page.render(
            name=made.name,
            style=_text("explorer.css"),
            script=_text("explorer.js"),
            data=data.replace("<", "\\u003c"),  # no markup can end the script early
            sentence=sentence(made),
            answers=_cards(made),
            dearest=dearest(effects),
            effects=effects,
            note=made.note,
            judged=judged(made),
            first_frames=first_frames(made),
            proof=proof_words(made),
            rays=made.known.samples,
            aliasing=_aliasing(made),
            where=where.words,
            base=labelled(made.base),
            bands=where.bands,
            figures=figures,
            failed=[c for c in made.checks if not c.holds],
            checks=made.checks,
            findings=[line for line in findings(made, metric) if not line.startswith("CHECK FAILED")],
            tables=list(_tables(made, metric)),
            environment=_environment(made.environment),
            pixels_legend=_legend(FOOTPRINT_SCALE) | {"wrong": _css(WRONG)},
            flip_legend=_legend(FLIP_SCALE),
        )
    )


def _aliasing(made: Sweep) -> str:
    """FLIP of the reference at one ray per pixel against its picture, for 99 % of the pixels; "" if they are one."""
    known = made.known
    return figures(float(np.percentile(picture_difference(known, known.color), 99))) if known.samples > 1 else ""


def dearest(effects: Sequence[Effect]) -> str:
    """The effect that costs most, or the only one, in words; "" without effects."""
    if not effects:
        return ""
    most = max(effects, key=lambda e: e.milliseconds.value)
    time, alone = most.milliseconds, len(effects) == 1
    if time.low <= 0:
        most = max(effects, key=lambda e: e.evaluations)
        count = f"{figures(most.evaluations)} per camera ray" if most.evaluations > 0 else ""
        if alone:
            return f"Its one effect, {most.name}, has no certain cost in time here{count and '; evaluations: '}{count}."
        most_by = f"; by evaluations, {most.name} costs most: {count}"
        return f"No effect has a certain cost in time here{count and most_by}."
    cost = f"{figures(time.value)} ms, {most.share:.0%} of a frame"
    if alone:
        return f"Its one effect, {most.name}, costs {cost}."
    return f"Of its effects, {most.name} costs most: {cost}."


def _cards(made: Sweep) -> list[dict[str, Any]]:
    """The answers, one for each setting, and the most accurate setting."""
    cards = titled(made)
    index = {id(p): k for k, p in enumerate(made.points)}
    return [
        {
            "title": title[0].upper() + title[1:],
            "ms": figures(point.time.value),
            "times": _compared(point, cards[0][1]),
            "tracer": point.tracer,
            "error": figures(reach(point)),
            "worst": location(point),
            "code": code(point),
            "index": index[id(point)],
        }
        for title, point in cards
    ]


def _compared(point: Point, first: Point) -> str:
    """The time of a setting relative to the first one."""
    if point is first:
        return ""
    found = ratio(point, first)
    doubt = ", within the noise" if found.low <= 1.0 <= found.high else ""
    return f"{found.value:.2g}× the time{doubt}"


def _tables(made: Sweep, metric: str) -> Any:
    words = (
        "Fastest first. A dot marks the front: no other setting is both faster and more accurate. Grey rows miss hits."
    )
    yield _table(f"All {len(made.points)} settings", words, made, metric, table(made, metric), in_table(made, metric))
    drawn = light_table(made, metric)
    if drawn is not None:
        words = (
            "All evaluations of the field and its gradient per pixel, with those of shadows, and the error of the "
            "picture. Forms of soft shadows are compared with the shadow of the light's whole disc."
        )
        yield _table("Settings of light and shadow", words, made, metric, drawn, lights_of(made, metric))


def _table(title: str, words: str, made: Sweep, metric: str, drawn: Table, points: list[Point]) -> dict[str, Any]:
    """A table of the command line for the page; `points` are its rows."""
    front = {id(p) for p in made.front(metric)}
    columns = [[str(cell) for cell in column.cells] for column in drawn.columns][1:]
    rows = [
        {
            "front": id(point) in front,
            "kind": "front" if id(point) in front else "" if point.errors.sound else "unsound",
            "cells": cells,
        }
        for point, cells in zip(points, zip(*columns, strict=True), strict=True)
    ]
    return {"title": title, "words": words, "heads": [str(c.header) for c in drawn.columns], "rows": rows}


def _legend(scale: Scale) -> dict[str, Any]:
    """The bands of a scale with the positions of their ticks in per cent."""
    ticks = [{"at": f"{100 * float(scale.normalized(value)):.4g}", "text": figures(value)} for value in scale.ticks]
    return {"colors": [_css(c) for c in band_colors(scale)], "ticks": ticks, "wrong": ""}


def _css(color: Any) -> str:
    return "rgb({},{},{})".format(*(int(c) for c in color))


def _environment(env: dict[str, Any]) -> list[tuple[str, str]]:
    return [
        (name.replace("_", " "), ", ".join(f"{k}: {v}" for k, v in value.items()) if isinstance(value, dict) else value)
        for name, value in env.items()
    ]


def _text(name: str) -> str:
    return files("raymarch.cost").joinpath("page", name).read_text(encoding="utf-8")
