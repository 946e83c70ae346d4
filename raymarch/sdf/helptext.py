"""The text of `help(NAME)` for a definition: its docstring, legal values, facts, source line, one example."""

from __future__ import annotations

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


def help_text(definition: Definition) -> str:
    """The docstring of a definition, then its legal values and facts. Facts are those at the defaults, if all exist."""
    facts = None
    if definition.arity == "none":
        with suppress(Exception):  # a fault of the definition is reported when a node is made, with the user's line
            facts = definition.make((), (), {}).facts
    lines = [definition.doc, ""]
    if definition.domains:
        lines += ["Legal values:", *[f"    {n} : {_legal(n, definition)}" for n in definition.domains], ""]
    lines += ["Facts:", *[f"    {name} : {value}" for name, value in _facts(definition, facts).items()]]
    shown = example(definition)
    if shown:
        lines += ["", "Example:", f"    {shown}"]
    return "\n".join(lines)


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
    return " at the defaults" if definition.domains else ""


def _file(definition: Definition) -> str:
    file = Path(definition.where.file)
    return f"raymarch/{file.relative_to(PACKAGE).as_posix()}" if file.is_relative_to(PACKAGE) else file.name


# One line to try

OPERANDS = {("one", 3): "rm.box(1)", ("one", 2): "rm.circle()"}


def example(definition: Definition) -> str:
    """A call that works; empty where the parameters are data or must fit each other."""
    if definition.arity == "many":
        return ""
    given = [OPERANDS[definition.arity, definition.child_dimension]] if definition.arity == "one" else []
    for name, domain in definition.domains.items():
        default = definition.defaults.get(name)
        if default is None:
            default = _some(domain)
        if not isinstance(default, int | float | str | tuple):
            if name in definition.defaults:
                continue
            return ""
        given.append(f"{name}={default!r}")
    own = Path(definition.where.file).is_relative_to(PACKAGE)
    prefix = "" if not own else "rm." if definition.arity == "none" else "rm.sdf."
    return f"{prefix}{definition.name}({', '.join(given)})"


def _some(domain: Domain) -> Any:
    """A legal value of ordinary size."""
    if domain.type is None:
        return int(np.clip(3, domain.low, domain.high)) if domain.holds is int else None
    if domain.type.is_matrix:
        return None
    number = float(np.clip(0.25, domain.low + (0.1 if domain.open else 0.0), domain.high))
    return number if domain.type.size == 1 else (number, *[2.0 * number] * (domain.type.size - 1))
