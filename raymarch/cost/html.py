"""A sweep as one self-contained HTML file."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import Any

import numpy as np
from PIL import Image
from rich.table import Table

from raymarch.cost.html_style import SCRIPT, STYLE
from raymarch.cost.maps import FLIP_SCALE, FOOTPRINT_SCALE, flip_map, footprint_map
from raymarch.cost.plots import panels, save
from raymarch.cost.sweep import Point, Sweep
from raymarch.cost.text import findings, held_against, in_table, labelled, light_table, lights_of, table
from raymarch.gpu.frame import srgb
from raymarch.gpu.scale import Scale

MOST = 6
"""Number of points that are shown with pictures."""
STOPS = 12
"""Colours of a legend's gradient."""


def as_html(made: Sweep, metric: str = "pixels_p99") -> str:
    """The report as text: findings, checks, figures, tables, and pictures with error maps of the points that matter.

    CostError if matplotlib is missing.
    """
    env, (width, height) = made.environment, made.known.size
    parts = [
        f"<h1>What accuracy costs: {escape(made.name)}</h1>",
        f'<p class="soft">{width}x{height} pixels, {len(made.points)} settings, {made.repeats} frames of each; '
        f"{escape(env['driver']['renderer'])}, {escape(env['clock']['kind'])}, {escape(env['date'][:10])}</p>",
        _sentences(made, metric),
        "<h2>Error against time</h2>",
        _figures(made, metric),
        "<h2>Settings</h2>",
        '<p class="soft">A dot marks settings that no other beats in both time and error; grey rows miss hits. '
        "A click on a heading sorts.</p>",
        _table(made, metric, table(made, metric), in_table(made, metric)),
        _light(made, metric),
        "<h2>Pictures</h2>",
        _pictures(made, metric),
        "<h2>Measured with</h2>",
        _environment(env),
    ]
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(made.name)}: cost</title><style>{STYLE}</style>"
    )
    body = "".join(parts)
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{body}<script>{SCRIPT}</script></body></html>\n'


def _sentences(made: Sweep, metric: str) -> str:
    lines = [line for line in findings(made, metric) if not line.startswith("CHECK FAILED")]
    kinds = {
        True: '<span class="holds">&#10003; holds</span>',
        False: '<span class="failed">&#10007; FAILED</span>',
    }
    checks = [f"<li>{kinds[c.holds]} {escape(c.name)}: {escape(c.words)}</li>" for c in made.checks]
    said = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<ul>{said}</ul><h2>The report\'s own checks</h2><ul class="checks">{"".join(checks)}</ul>'


def _figures(made: Sweep, metric: str) -> str:
    drawn = [_image(save(figure), words) for words, figure in panels(made, metric)]
    return f'<div class="figures">{"".join(drawn)}</div>'


def _table(made: Sweep, metric: str, drawn: Table, points: list[Point]) -> str:
    """A table of the command line as HTML; `points` are its rows."""
    front = {id(p) for p in made.front(metric)}
    head = "".join(f"<th>{escape(str(column.header))}</th>" for column in drawn.columns)
    columns = [list(column.cells) for column in drawn.columns][1:]
    rows = []
    for point, cells in zip(points, zip(*columns, strict=True), strict=True):
        kind = "front" if id(point) in front else "" if point.errors.sound else "unsound"
        mark = "&#9679;" if id(point) in front else ""
        shown = "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
        rows.append(f'<tr class="{kind}"><td>{mark}</td>{shown}</tr>')
    content = f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody>"
    return f'<div class="scroll"><table class="sortable">{content}</table></div>'


def _light(made: Sweep, metric: str) -> str:
    drawn = light_table(made, metric)
    if drawn is None:
        return ""
    words = (
        "Other settings of light and shadow: all evaluations of the field and its gradient per pixel, with those of "
        "shadows; and the error of the picture. Forms of soft shadows are compared with the shadow of the light's "
        "whole disc."
    )
    listed = _table(made, metric, drawn, lights_of(made, metric))
    return f'<h2>Light and shadow</h2><p class="soft">{words}</p>{listed}'


# Pictures


def _pictures(made: Sweep, metric: str) -> str:
    known = made.known
    words = f"mean of {known.samples} float64 rays per pixel, mean standard error {known.spread.mean():.2g}"
    truth = f'<div class="point truth"><h3>Reference</h3><p class="says">{words}</p>'
    return "".join(
        (
            '<div class="scales">',
            _legend(FOOTPRINT_SCALE, "distance from the true hit in pixel footprints; magenta: missed or false"),
            _legend(FLIP_SCALE, "FLIP: perceived difference"),
            "</div>",
            truth,
            _picture(srgb(known.picture), "reference picture"),
            "</div>",
            *(_shown(made, p, metric) for p in _chosen(made, metric)),
        )
    )


def _chosen(made: Sweep, metric: str) -> list[Point]:
    """The presets and the scene's own setting, then the front, up to the limit."""
    front = made.front(metric)
    ranked = [made.base, *(p for p in made.points if p.setting.preset), *front]
    return list({id(p): p for p in ranked}.values())[:MOST]


def _shown(made: Sweep, point: Point, metric: str) -> str:
    errors = point.errors
    words = (
        f"{point.time} ms; {errors.pixels_p99:.2g} px (p99); {errors.missed} missed, {errors.false} false hits; "
        f"FLIP {errors.flip_p99:.2g} (p99) against {held_against(point, made)}; {point.evaluations:.1f} evaluations"
    )
    badge = '<span class="badge">front</span>' if any(p is point for p in made.front(metric)) else ""
    maps = [_picture(footprint_map(point.known, point.depth), "distance from the true hit")]
    if point.color is not None:
        maps.insert(0, _picture(srgb(point.color), "picture"))
        maps.append(_picture(flip_map(point.known, point.color), "FLIP"))
    heading = f'<h3>{escape(labelled(point))}{badge}</h3><p class="says">{escape(words)}</p>'
    return f'<div class="point">{heading}<div class="maps">{"".join(maps)}</div></div>'


def _legend(scale: Scale, words: str) -> str:
    """A bar of a scale's colours with its marks."""
    position = np.linspace(0.0, 1.0, STOPS)
    values = (
        10.0 ** (np.log10(scale.low) + position * np.log10(scale.high / scale.low)) if scale.kind == "log" else position
    )
    colors = ", ".join("rgb({},{},{})".format(*np.rint(255 * c).astype(int)) for c in scale.colored(values))
    ticks = "".join(f"<span>{value:.3g}</span>" for value in scale.ticks)
    bar = f'<div class="bar" style="background: linear-gradient(90deg, {colors})"></div>'
    return f'<div>{bar}<div class="ticks">{ticks}</div><div class="soft">{escape(words)}</div></div>'


def _environment(env: dict[str, Any]) -> str:
    rows = []
    for name, value in env.items():
        said = ", ".join(f"{k}: {v}" for k, v in value.items()) if isinstance(value, dict) else str(value)
        rows.append(f"<tr><td></td><td>{escape(name.replace('_', ' '))}</td><td>{escape(said)}</td></tr>")
    return f'<div class="scroll"><table class="plain"><tbody>{"".join(rows)}</tbody></table></div>'


def _picture(pixels: Any, caption: str) -> str:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return _image(stream.getvalue(), caption)


def _image(png: bytes, caption: str) -> str:
    data = base64.b64encode(png).decode()
    words = escape(caption)
    image = f'<img src="data:image/png;base64,{data}" alt="{words}">'
    return f"<figure>{image}<figcaption>{words}</figcaption></figure>"
