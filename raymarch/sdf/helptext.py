"""The text of `help(NAME)` for a definition: its docstring, legal values, facts, source line, one example."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from raymarch.sdf.domain import Domain

if TYPE_CHECKING:
    from raymarch.sdf.definition import Definition
    from raymarch.sdf.facts import Facts

PACKAGE = Path(__file__).parents[1]


def _sources(table: Mapping[str, str]) -> dict[str, str]:
    """One entry for each of the names of a row."""
    return {name: text for names, text in table.items() for name in names.split()}


SOURCES = _sources(
    {
        "sphere box plane torus cylinder cone": "Hart 1996",
        "capsule infinite_cylinder infinite_cone line rounded_box box_frame slab triangle quad rhombus pyramid link "
        "hexagonal_prism triangular_prism capped_torus rounded_cylinder rounded_hull round_cone disc solid_angle "
        "cut_sphere cut_hollow_sphere death_star vesica": "Quilez 2008, distance functions",
        "circle rectangle rounded_rectangle polygon flat_triangle trapezoid regular_polygon star cross stroke polyline "
        "ring arc pie heart flat_vesica egg moon": "Quilez 2008, 2D distance functions",
        "ellipsoid ellipse": "Conn, Gould and Toint 2000, the step of a trust region",
        "superquadric": "Barr 1981",
        "bezier bezier_tube polyline_tube": "Quilez 2008, quadratic Bezier curves",
        "helix": "Hart 1996, the bound of a solid by its Lipschitz constant",
        "blob": "Mercury 2016",
        "tetrahedron octahedron dodecahedron icosahedron truncated_tetrahedron truncated_cube truncated_octahedron "
        "cuboctahedron rhombicuboctahedron truncated_dodecahedron truncated_icosahedron icosidodecahedron": "Coxeter "
        "1973, Wythoff's construction",
        "menger sierpinski": "Mandelbrot 1982",
        "mandelbulb": "White and Nylander 2009",
        "julia": "Hart, Sandin and Kauffman 1989",
        "mandelbox": "Lowe 2010",
        "apollonian": "Quilez 2008, fractals",
        "gyroid": "Schoen 1970",
        "schwarz_p schwarz_d": "Schwarz 1890",
        "neovius": "Neovius 1883",
        "lidinoid": "Lidin and Larsson 1990",
    }
)
"""The work in the literature that a shape or its formula comes from."""


def help_text(definition: Definition) -> str:
    """The docstring of a definition in the sections of NumPy, with legal values, facts, a source and an example."""
    facts = None
    if definition.arity == "none":
        with suppress(Exception):  # a fault of the definition is reported when a node is made, with the user's line
            facts = definition.make((), (), {} if _has_defaults(definition) else _values(definition) or {}).facts
    summary, meant, notes = _parts(definition)
    lines = [*summary, ""]
    operands = {"none": [], "one": ["node : the solid."], "many": ["nodes : the solids."]}[definition.arity]
    if definition.domains or operands:
        lines += ["Parameters", "----------", *operands]
        for name in definition.domains:
            lines += [f"{name} : {_legal(name, definition)}", *_wrapped(meant.get(name, ""))]
        lines += [""]
    lines += ["Returns", "-------", "Node", ""]
    if definition.domains or operands:
        what = "a value that is not legal" if definition.check is None else "values that are not legal or do not fit"
        lines += ["Raises", "------", f"SceneError : {what}.", ""]
    lines += ["Notes", "-----", *([*notes, ""] if notes else [])]
    lines += ["Facts:", *[f"    {name} : {value}" for name, value in _facts(definition, facts).items()]]
    if definition.name in SOURCES:
        lines += ["", "References", "----------", f"{SOURCES[definition.name]}; see docs/bibliography.md."]
    if lines_of_example := _example(definition):
        lines += ["", "Examples", "--------", *lines_of_example]
    return "\n".join(lines)


def _parts(definition: Definition) -> tuple[list[str], dict[str, str], list[str]]:
    """The first paragraph of a docstring, its sentences about each parameter, and the rest."""
    first, *rest = definition.doc.split("\n\n")
    names = "|".join(map(re.escape, definition.domains)) or "$^"
    entry = re.compile(rf"(?:^|(?<=[.,)] )|(?<=\n))((?:{names})(?:, (?:{names}))*) : ")
    meant: dict[str, str] = {}
    notes: list[str] = []
    for paragraph in rest:
        found = list(entry.finditer(paragraph))
        if not found or found[0].start():
            notes += ["", *paragraph.splitlines()] if notes else paragraph.splitlines()
            continue
        ends = [match.start() for match in found[1:]] + [len(paragraph)]
        for match, end in zip(found, ends, strict=True):
            words = " ".join(paragraph[match.end() : end].split())
            meant |= dict.fromkeys(match[1].split(", "), words[:1].upper() + words[1:])
    return first.splitlines(), meant, notes


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 116, initial_indent="    ", subsequent_indent="    ")


def _legal(name: str, definition: Definition) -> str:
    domain = definition.domains[name]
    unit = f"; {domain.unit}" if domain.unit not in ("", "count", "integer", "power") else ""
    one = ", or one number for all" if domain.stretch else ""
    plain = isinstance(definition.defaults.get(name), int | float | str | tuple)
    default = f"; default {definition.defaults[name]!r}" if plain else ""
    return f"{domain.legal}{one}{unit}{default}"


def _facts(definition: Definition, facts: Facts | None) -> Mapping[str, str]:
    found = {"exactness": _exactness(definition, facts), "Lipschitz": _lipschitz(definition, facts)}
    if facts is not None:
        lower, upper = (f"({', '.join(f'{v:.4g}' for v in corner)})" for corner in (facts.lower, facts.upper))
        found["bounds"] = f"{lower} to {upper}{_at_defaults(definition)}"
        found["symmetry"] = ", ".join(facts.symmetry) or "none"
        found["convex"] = "yes" if facts.convex else "no"
    elif definition.arity != "none":
        found["bounds"] = "follow from the operands"
    found["source"] = f"{_file(definition)}, line {definition.where.line}"
    return found


def _exactness(definition: Definition, facts: Facts | None) -> str:
    if definition.arity != "none":
        if callable(definition.exactness):
            return "by the operands and parameters"
        return "that of the operands" if definition.exactness == "exact" else f"{definition.exactness} at best"
    if not callable(definition.exactness):
        return definition.exactness
    return "by its parameters" if facts is None else f"{facts.exactness}{_at_defaults(definition)}"


def _lipschitz(definition: Definition, facts: Facts | None) -> str:
    if definition.lipschitz is None:
        return "that of the operands"
    if not callable(definition.lipschitz):
        steep = float(definition.lipschitz)
    elif facts is not None:
        steep = facts.divisor
    else:
        return "by the operands and parameters; the field is divided by it, see node.facts.divisor"
    if definition.exactness == "estimate":
        return "none (an estimate)"
    return "1" if steep <= 1.0 else f"{steep:.4g}{_at_defaults(definition)}, by which the field is divided"


def _at_defaults(definition: Definition) -> str:
    if not definition.domains:
        return ""
    return " at the defaults" if _has_defaults(definition) else " in the example"


def _has_defaults(definition: Definition) -> bool:
    """True if a call needs no arguments."""
    return definition.domains.keys() <= definition.defaults.keys()


def _file(definition: Definition) -> str:
    file = Path(definition.where.file)
    return f"raymarch/{file.relative_to(PACKAGE).as_posix()}" if file.is_relative_to(PACKAGE) else file.name


# One line to try


OPERANDS = {("one", 3): "rm.box(1)", ("one", 2): "rm.circle()"}


def _example(definition: Definition) -> list[str]:
    """The lines of the example; none for a definition that refuses its values."""
    shown = example(definition)
    if not shown or definition.arity != "none":
        return [f">>> node = {shown}"] if shown else []
    with suppress(Exception):  # as above
        return [f">>> {shown}.exactness", repr(definition.make((), (), _values(definition) or {}).exactness)]
    return []


def example(definition: Definition) -> str:
    """A call that works; empty where the parameters are data or must fit each other."""
    values = None if definition.arity == "many" else _values(definition)
    if values is None:
        return ""
    given = [OPERANDS[definition.arity, definition.child_dimension]] if definition.arity == "one" else []
    given += [f"{name}={value!r}" for name, value in values.items()]
    own = Path(definition.where.file).is_relative_to(PACKAGE)
    prefix = "" if not own else "rm." if definition.arity == "none" else "rm.sdf."
    return f"{prefix}{definition.name}({', '.join(given)})"


CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0))
"""Points of an example, in the order of the parameters."""


def _values(definition: Definition) -> dict[str, Any] | None:
    """Values that are plain text, defaults where there are any; None if a parameter without default is data."""
    found: dict[str, Any] = {}
    corners = iter(CORNERS)
    for name, domain in definition.domains.items():
        default = definition.defaults.get(name)
        if default is None and domain.points:
            default = tuple(corner[: domain.points] for corner in CORNERS[:3])
        elif default is None:
            default = _some(domain, next(corners, CORNERS[0]))
        if isinstance(default, int | float | str | tuple):
            found[name] = default
        elif name not in definition.defaults:
            return None
    return found


def _some(domain: Domain, corner: tuple[float, ...]) -> Any:
    """A legal value of ordinary size. corner : the point for a parameter that is one."""
    if domain.type is None:
        return int(np.clip(3, domain.low, domain.high)) if domain.holds is int else None
    if domain.type.is_matrix:
        return None
    number = float(np.clip(0.25, domain.low + (0.1 if domain.open else 0.0), domain.high))
    if domain.type.size == 1:
        return number
    return (number, *[2.0 * number] * (domain.type.size - 1)) if domain.low >= 0.0 else corner[: domain.type.size]
