"""Write docs/api.md from docstrings, the functions and classes that draw, measure and export: python docs/api.py"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import raymarch as rm
from raymarch import errors
from raymarch.expr import maths

HERE = Path(__file__).parent

SECTIONS: dict[str, tuple[str, ...]] = {
    "Pictures": ("render", "studio", "Renderer", "Frame", "show", "figure", "Slice"),
    "Reference and proof": ("truth", "Truth", "raycast", "Hits", "prove", "Proof", "probe", "Probe"),
    "One ray": ("plot_ray", "ray_samples", "RaySamples", "floor_evaluations"),
    "Solids between points": ("tube", "cone_between", "round_cone_between"),
    "Files": ("export", "triangulate", "measure", "Measures", "render_frames"),
    "Expressions": (
        *("value_noise", "gradient_noise", "worley", "fbm", "turbulence", "ridged"),
        *("hash", "colormap"),
    ),
    "Your own parts": ("shape", "operator", "Node", "DirectionSample", "TracerState", "Texture"),
    "Errors": tuple(errors.__all__),
}
"""Headings, and the public names below each."""

FUNCTIONS = sorted({*maths.__all__, "plane_fold", "box_fold", "ball_fold"} - set(SECTIONS["Expressions"]))
"""Functions of expressions, numbers and arrays, each a row of a table."""

METHODS: dict[str, tuple[str, ...]] = {
    "Measures": ("thickness", "distance"),
    "Renderer": ("render", "resize", "forget", "close"),
    "Frame": ("image", "array", "doubts"),
    "Proof": ("image", "as_dict"),
}
"""The methods of a class that are listed."""

MADE_BY_OTHERS = (
    "Frame",
    "TracerState",
    "Truth",
    "Hits",
    "Measures",
    "RaySamples",
    "Proof",
    "Probe",
    "Texture",
    "Node",
)
"""Classes whose instances other functions return."""

ENTRY = re.compile(r"^(\w+(?:, \w+)*) : (.*)$")


def page() -> str:
    """The text of docs/api.md."""
    text = [
        "# Functions that draw, measure and export",
        "",
        "After this page you know what each public function takes, returns and raises. `help(rm.render)` prints it.",
        "Solids are listed in [all nodes](nodes.md), the parts of a scene in [their parameters](parts.md).",
        "",
        "`python docs/api.py` generates this page from the docstrings.",
    ]
    for title, names in SECTIONS.items():
        text += ["", f"## {title}"]
        if title == "Expressions":
            text += ["", "| call | value |", "|---|---|", *map(row, FUNCTIONS)]
        for name in names:
            text += described(name, getattr(rm, name), "###")
            for method in METHODS.get(name, ()):
                text += described(f"{name}.{method}", getattr(getattr(rm, name), method), "####")
    return "\n".join(text) + "\n"


def row(name: str) -> str:
    """The row of a function of expressions: its call, and the first paragraph of its docstring."""
    given = getattr(rm, name)
    if not callable(given):
        return f"| `rm.{name}` | {given:.6g} |"
    first = (inspect.getdoc(given) or "").partition("\n\n")[0]
    meaning = " ".join(first.split()).replace("|", "\\|")
    return f"| `{signature(name, given)}` | {meaning} |"


def described(name: str, given: object, heading: str) -> list[str]:
    """Heading, call and docstring of a function or class, as Markdown lines."""
    text = ["", f"{heading} {name}", ""]
    call = signature(name, given)
    if call:
        text += ["```text", call, "```", ""]
    return text + markdown(inspect.getdoc(given) or "")


def signature(name: str, given: object) -> str:
    """The call with its defaults; "" for what is not called by users."""
    if name in MADE_BY_OTHERS or (inspect.isclass(given) and issubclass(given, Exception)):
        return ""
    assert callable(given)
    own = [q for q in inspect.signature(given).parameters.values() if q.name != "self"]
    shown = [str(q.replace(annotation=inspect.Parameter.empty)) for q in own]
    for i, q in enumerate(own):
        if q.kind is q.KEYWORD_ONLY:
            shown.insert(i, "*")
            break
    return f"{name if '.' in name else 'rm.' + name}({', '.join(shown)})"


def markdown(doc: str) -> list[str]:
    """A docstring of this package as Markdown: entries become lists, headings become bold."""
    lines: list[str] = []
    listed = fenced = False
    for line in re.sub(r"\n(\w[\w ]*)\n-{3,}\n", r"\n**\1**\n\n", f"\n{doc}\n").strip().splitlines():
        entry = ENTRY.match(line)
        if entry is not None:
            if not listed and lines and lines[-1]:
                lines.append("")
            names = ", ".join(f"`{name}`" for name in entry[1].split(", "))
            lines.append(f"- {names}: {entry[2]}")
            listed = True
        elif listed and line.startswith("    "):
            lines.append(f"  {line.strip()}" if not line.strip().startswith("- ") else f"    {line.strip()}")
        elif line.startswith((">>>", "...")) and not fenced:
            lines += ["```pycon", line]
            fenced = True
        elif fenced and not line:
            lines += ["```", ""]
            fenced = False
        else:
            if listed and line:
                lines.append("")
            listed = listed and not line
            lines.append(line)
    lines = [line for i, line in enumerate(lines) if line or (i and lines[i - 1])]
    return [*lines, "```"] if fenced else lines


if __name__ == "__main__":
    (HERE / "api.md").write_text(page(), encoding="utf-8")
