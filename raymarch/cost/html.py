"""A sweep as one file that any browser shows, with nothing to load from elsewhere."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import Any

from PIL import Image

from raymarch.cost.maps import flip_map, footprint_map
from raymarch.cost.plots import figure, save
from raymarch.cost.sweep import Point, Sweep
from raymarch.cost.text import findings, labelled, table
from raymarch.gpu.frame import srgb

MOST = 6
"""Points that are shown with pictures."""

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1500px; padding: 0 1em; color: #222; }
table { border-collapse: collapse; font-size: 13px; } td, th { padding: 2px 9px; text-align: right; }
td:nth-child(-n+2), th:nth-child(-n+2) { text-align: left; } tr.front { font-weight: 600; background: #eef5ea; }
tr.unsound { color: #999; } figure { display: inline-block; margin: 0 10px 14px 0; vertical-align: top; }
figcaption { font-size: 12px; color: #555; } img { image-rendering: pixelated; max-width: 100%; }
.failed { color: #b00020; font-weight: 600; }
"""


def as_html(made: Sweep, metric: str = "pixels_p99") -> str:
    """The report as text: findings, checks, figures, the table, and pictures with error maps of the points that matter.

    CostError if matplotlib is missing.
    """
    known = made.known
    parts = [
        f"<h1>What accuracy costs: {escape(made.name)}</h1>",
        _sentences(made, metric),
        _image(save(figure(made, metric)), "error against time, evaluations, and both relative to the plain tracer"),
        "<h2>Settings</h2>",
        _table(made, metric),
        "<h2>Pictures</h2>",
        f"<p>The true picture is the mean of {known.samples} float64 rays a pixel, with a mean standard error of "
        f"{known.spread.mean():.2g}. Distances run from 0.0001 (black) to 10 footprints (yellow); missed and false "
        "hits are magenta. FLIP runs from 0 (black) to 1 (yellow).</p>",
        _picture(srgb(known.picture), "the truth"),
        *(_shown(made, p) for p in _chosen(made, metric)),
        "<h2>Measured with</h2>",
        _environment(made.environment),
    ]
    head = f'<meta charset="utf-8"><title>{escape(made.name)}: cost</title><style>{STYLE}</style>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{"".join(parts)}</body></html>\n'


def _sentences(made: Sweep, metric: str) -> str:
    lines = [f"<li>{escape(line)}</li>" for line in findings(made, metric)]
    kinds = {True: "holds", False: '<span class="failed">FAILED</span>'}
    checks = [f"<li>{escape(c.name)}: {kinds[c.holds]}. {escape(c.words)}</li>" for c in made.checks]
    return f"<ul>{''.join(lines)}</ul><h2>The report's own checks</h2><ul>{''.join(checks)}</ul>"


def _table(made: Sweep, metric: str) -> str:
    """The columns of the table that the command prints."""
    drawn = table(made, metric)
    ordered = sorted(made.points, key=lambda p: p.time.value)
    front = {id(p) for p in made.front(metric)}
    head = "".join(f"<th>{escape(str(column.header))}</th>" for column in drawn.columns)
    columns = [list(column.cells) for column in drawn.columns]
    rows = []
    for point, cells in zip(ordered, zip(*columns, strict=True), strict=True):
        kind = "front" if id(point) in front else "" if point.errors.sound else "unsound"
        rows.append(f'<tr class="{kind}">' + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>")
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def _chosen(made: Sweep, metric: str) -> list[Point]:
    """The presets and the scene's own, then the front, as far as there is room."""
    front = made.front(metric)
    ranked = [made.base, *(p for p in made.points if p.setting.preset), *front]
    return list({id(p): p for p in ranked}.values())[:MOST]


def _shown(made: Sweep, point: Point) -> str:
    errors = point.errors
    words = (
        f"{escape(labelled(point))}: {point.time} ms, {errors.pixels_p99:.2g} px (p99), {errors.missed} missed, "
        f"FLIP {errors.flip_p99:.2g} (p99), {point.evaluations:.1f} evaluations a pixel"
    )
    return f"<h3>{words}</h3><div>" + "".join(
        (
            _picture(srgb(point.color), "picture") if point.color is not None else "",
            _picture(footprint_map(made.known, point.depth), "distance from the true hit"),
            _picture(flip_map(made.known, point.color), "FLIP") if point.color is not None else "",
            "</div>",
        )
    )


def _environment(env: dict[str, Any]) -> str:
    rows = []
    for name, value in env.items():
        said = ", ".join(f"{k}: {v}" for k, v in value.items()) if isinstance(value, dict) else str(value)
        rows.append(f"<tr><td>{escape(name)}</td><td>{escape(said)}</td></tr>")
    return f"<table>{''.join(rows)}</table>"


def _picture(pixels: Any, caption: str) -> str:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return _image(stream.getvalue(), caption)


def _image(png: bytes, caption: str) -> str:
    data = base64.b64encode(png).decode()
    words = escape(caption)
    image = f'<img src="data:image/png;base64,{data}" alt="{words}">'
    return f"<figure>{image}<figcaption>{words}</figcaption></figure>"
