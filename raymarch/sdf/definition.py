"""Definitions: the objects that `@shape` and `@operator` make from a short Python function.

A definition is traced once, on symbols, when it is first used; every node made from it shares the result. It enters a
registry, where the fluent methods, the generic tests and the documentation find it by name.
"""

from __future__ import annotations

import inspect
import math
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Concatenate, Literal, ParamSpec, TypeAlias

import numpy as np

from raymarch.errors import Location, SceneError
from raymarch.expr.calls import bad_call, checked
from raymarch.expr.convert import described, short
from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function, trace
from raymarch.expr.intervals import INTERVALS, Interval
from raymarch.expr.node import Expr, const, expr, make, var
from raymarch.expr.types import BOOL, FLOAT, MAT2, MAT3, VEC2, VEC3, VECTORS, Type, vector
from raymarch.expr.vocabulary import length, vec2, vec3, vec4
from raymarch.expr.walk import find, free_variables, substitute, topological
from raymarch.sdf.builder import Builder
from raymarch.sdf.domain import Domain, Fits, domain_of, interval_of_value
from raymarch.sdf.facts import Exactness, Facts, worst
from raymarch.sdf.node import Node, called_by_nodes, children_first
from raymarch.sdf.regions import Motion, Regions

__all__ = ["operator", "shape"]

P = ParamSpec("P")
Child: TypeAlias = Callable[[Expr], Expr]
Rule: TypeAlias = Callable[..., Any]
Dimension: TypeAlias = Literal[2, 3, "any"]
Placing: TypeAlias = Literal["rigid", "scale", "stretch", "deform", "offset", "select", "union", "blend", ""]
"""How an operator passes distances on.

"rigid": the child's value at p, moved, turned or reflected. "scale": that at p moved, turned and divided by a factor,
times the factor. "stretch": that at an affine map of p, which enlarges some lengths more than others, times a factor.
"deform": that at a map of p which is not affine, within the child's reach. "offset": the child's value, or its size,
plus a length. "select": at each point the value of a child, or its negative, at a point of equal distances. "union":
the least value of the children. "blend": the same, lowered where two values are close. The tests of
`tests/sdf/test_traits.py` hold each by numbers.
"""

PLACED = ("rigid", "scale", "stretch")
"""Those of the form `child(q)` or `factor * child(q)`, where q is an affine map of p; see `Definition.placement`."""


@dataclass(frozen=True, slots=True)
class ChildFacts:
    """The facts of a child, as an operator's functions of facts receive them: expressions in place of numbers.

    `box` stands for any point of the child's box at once, so `child.box + offset` is the moved box;
    `lower` and `upper` are its corners. `lipschitz` and `spread` are those of the field that the operator receives:
    the undivided one, whose constant may exceed 1, if the operator does more than scale and choose distances.
    `centre` is that of the box; `radii` and `swell` are those of `Facts`.
    """

    box: Expr
    lower: Expr
    upper: Expr
    lipschitz: Expr
    spread: Expr
    centre: Expr
    radii: Expr
    swell: Expr

    def within(self, margin: Any = 0.0) -> list[tuple[Expr, Expr]]:
        """Centre and radii about it that hold all points at which the child's field is no larger than a margin >= 0."""
        return [(self.centre, self.radii + self.swell * margin)]

    def grown(self, distance: Any) -> tuple[Expr, Expr]:
        """Corners of a box around all points at which the child's field is no larger than a distance >= 0."""
        margin = self.spread * distance
        return self.lower - margin, self.upper + margin


@dataclass(eq=False, slots=True)
class Definition:
    """A shape (no children) or an operator (one child, or any number of them)."""

    name: str
    called: str
    """The name by which a user calls it: that of the public function, or of the method."""
    source: Callable[..., Any]
    dimension: int
    child_dimension: int
    arity: str
    exactness: Exactness | Rule
    lipschitz: float | Rule | None
    bounds: Rule | None
    symmetry: str | Rule
    spread: float | Rule | None
    convex: bool | Rule
    radii: Rule | None
    motion: Rule | None
    check: Rule | Fits | None
    associative: bool
    cuts: bool
    placing: Placing | Rule
    shift: Rule | None
    domains: Mapping[str, Domain]
    defaults: Mapping[str, Any]
    where: Location
    doc: str
    flat: Definition | None = None
    """The same definition for flat children, where it serves both; this one then serves the solid ones."""
    _templates: dict[Any, Function] = field(default_factory=dict)
    _facts: dict[Any, tuple[Program, bool, int, Motion | None]] = field(default_factory=dict)

    def make(self, children: Sequence[Node], args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> Node:
        """A node: parameters checked. Its facts are derived when they are first read, unless they may be refused."""
        if self.flat is not None and children and all(isinstance(c, Node) and c.dimension == 2 for c in children):
            return self.flat.make(children, args, kwargs)
        for child in children:
            if not isinstance(child, Node):
                raise SceneError(f"{self.called} of {described(child)}", legal="a node such as sphere()")
            if child.dimension != self.child_dimension:
                what = f"{self.called} of a {child.dimension}D field ({child.name})"
                other = next((c for c in children if isinstance(c, Node) and c.dimension != child.dimension), None)
                if other is not None and self.flat is not None:
                    what += f" and a {other.dimension}D field ({other.name})"
                    raise SceneError(what, legal="all 2D or all 3D")
                raise SceneError(what, legal=f"a {self.child_dimension}D field")
        params = self._bind(args, kwargs)
        node = Node(self, tuple(children), params)
        if self.check is not None:
            self.require([] if isinstance(self.check, Fits) else [c.facts for c in children], params)
        if callable(self.lipschitz):
            derive_facts(node)
        else:
            self._facts_of(len(children), params)
        return node

    def _bind(self, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> dict[str, Any]:
        names = list(self.domains)
        given = {**dict(zip(names, args, strict=False)), **kwargs}
        needed = self.domains.keys() - self.defaults.keys()
        if len(given) < len(args) + len(kwargs) or not needed <= given.keys() <= self.domains.keys():
            first = self.domains[names[0]].type if names else None
            vector = first is not None and first.is_vector and len(args) == first.size
            fault = bad_call(self.called, names, needed, args, kwargs, len(names), vector, self.usage)
            assert fault is not None
            raise fault
        given = {**self.defaults, **given}
        return {name: domain.accept(self.called, name, given[name]) for name, domain in self.domains.items()}

    @property
    def usage(self) -> str:
        """The call signature, without defaults that are data."""
        plain = {n: value for n, value in self.defaults.items() if isinstance(value, int | float | str | tuple)}
        shown = [f"{n}={plain[n]!r}" if n in plain else n for n in self.domains]
        return f"{self.called}({', '.join(shown)})"

    # The field

    def template(self, n_children: int, params: Mapping[str, Any]) -> Function:
        """The traced definition; children appear in it as `apply` expressions."""
        statics = self.statics(params)
        key = (n_children, statics)
        if key not in self._templates:
            symbols = [("p", vector(self.dimension)), *self._symbols()]
            children = [self._caller(i) for i in range(n_children)]
            extra = () if self.arity == "none" else (children if self.arity == "many" else children[0],)

            on_symbols = _reordered(self.source, extra, dict(statics), list(self.domains))
            traced = trace(self.called, on_symbols, symbols, self.source.__code__)
            if traced.type is not FLOAT:
                what = f"{self.called} gives a {traced.type}"
                raise SceneError(what, legal="a distance, one number", where=self.where)
            hidden = [loop for loop in find([traced.body], "loop") if find(loop.data.inner, "apply")]
            if hidden:
                what = f"{self.called} evaluates its child inside a loop of the expression language"
                legal = "a loop of Python, or the child evaluated after the loop"
                raise SceneError(what, legal=legal, where=self.where)
            self._refuse_infinite(traced)
            if self.placing in PLACED:
                self._taken_apart(traced)
            self._templates.setdefault(key, traced)  # another thread may have been faster
        return self._templates[key]

    def placement(self, params: Mapping[str, Any]) -> tuple[Expr, Expr, Expr | None]:
        """The point p, the point at which the child is evaluated, and the factor of its value; None is 1.

        Of an operator that is one of `PLACED`. SceneError if its function is of another form.
        """
        template = self.template(1, params)
        child, factor = self._taken_apart(template)
        found = substitute([child.args[0], *([] if factor is None else [factor])], self.named(template, params))
        return template.params[0], found[0], None if factor is None else found[1]

    def named(self, template: Function, params: Mapping[str, Any]) -> dict[Expr, Expr]:
        """The symbols of a template but its point, with the parameters of a node."""
        return dict(zip(template.params[1:], (params[name] for name, _ in self._symbols()), strict=True))

    def _taken_apart(self, traced: Function) -> tuple[Expr, Expr | None]:
        """The child's value and its factor in the function of a placed operator. SceneError for another form."""
        child, factor = traced.body, None
        if child.op == "mul":
            factor, child = child.args if child.args[1].op == "apply" else child.args[::-1]
        if child.op != "apply" or (factor is not None and traced.params[0] in free_variables([factor])):
            what = f"{self.called} states a placing, but is not placed"
            raise SceneError(what, legal="child(q), or a factor times child(q)", where=self.where)
        return child, factor

    def _refuse_infinite(self, traced: Function) -> None:
        """SceneError for a constant subexpression that is not finite: GLSL has no such literal, and drivers differ."""
        for node in find([traced.body], "const", "div", "mod"):
            number = node if node.op == "const" else node.args[1]
            if number.op != "const" or number.type is BOOL:
                continue
            if not np.all(np.isfinite(number.data)):
                what = f"{self.called} holds {number.data.tolist()}: a constant is divided by 0, or too large"
            elif node is not number and not np.all(number.data):
                what = f"{self.called} divides by {number.data.tolist()}"
            else:
                continue
            raise SceneError(what, legal="finite numbers, and divisors that are not 0", where=self.where)

    def _symbols(self) -> list[tuple[str, Type]]:
        return [(n, d.type) for n, d in self.domains.items() if d.type is not None]

    def _caller(self, index: int) -> Child:
        wanted = vector(self.child_dimension)

        def child(q: Any) -> Expr:
            point = expr(q)
            if point.type is not wanted:
                raise SceneError(f"{self.called} evaluates its child at a {point.type}", legal=f"a {wanted}")
            return make("apply", FLOAT, (point,), index)

        return child

    def adds(self, n_children: int, params: Mapping[str, Any]) -> bool:
        """True if the definition compares or adds the distances of its children to lengths, as blends and offsets do.

        It then acts on the undivided fields of its children. Others, which only scale distances and choose among them,
        act on the divided fields too: each operand of a hard union is divided by its own constant.
        """
        traced = self.template(n_children, params)
        return n_children > 0 and traced.once("adds", lambda: not is_homogeneous(traced.body))

    # Facts

    def require(self, children: Sequence[Facts], params: Mapping[str, Any]) -> None:
        """SceneError if parameters do not fit each other or the children, by the definition's check."""
        if isinstance(self.check, Fits):
            self.check.require(self.called, params)
        elif self.check is not None:
            self.check(*children, **params)

    def derive(self, children: Sequence[Node], params: Mapping[str, Any]) -> Facts:
        """Facts of a node from those of its children, on the intervals of its parameters; SceneError by its check."""
        below = [c.facts for c in children]
        self.require(below, params)
        return self._derive([(below, params)])[0]

    def _facts_of(self, n_children: int, params: Mapping[str, Any]) -> tuple[Program, bool, int, Motion | None]:
        """The program of the facts, whether it gives the Lipschitz constant, and how many radii and what motion."""
        key = (n_children, self.statics(params))
        if key not in self._facts:
            self._facts.setdefault(key, self._trace_facts(n_children, params))
        return self._facts[key]

    def statics(self, params: Mapping[str, Any]) -> tuple[Any, ...]:
        """The static parameters, on which the expressions of the field and of its facts depend."""
        return tuple((n, params[n]) for n, d in self.domains.items() if d.type is None)

    def _derive(self, members: Sequence[tuple[Sequence[Facts], Mapping[str, Any]]]) -> list[Facts]:
        """Facts of some nodes at once, each from the facts of its children and its parameters.

        They have equally many children and equal static parameters.
        """
        first, params = members[0]
        program, declared, n_discs, motion = self._facts_of(len(first), params)
        params_of: list[Interval] = [
            _stacked([interval_of_value(own[n]) for _, own in members])
            for n, d in self.domains.items()
            if d.type is not None
        ]
        n = len(members)

        def found_for(lipschitz: str, spread: str, swell: str) -> tuple[Any, ...]:
            """Corners, Lipschitz constants, spreads, radii and motions, from those facts of the children."""
            inputs = [*params_of]
            for column in zip(*[below for below, _ in members], strict=True):
                lower, upper = (np.array([getattr(f, side) for f in column]) for side in ("lower", "upper"))
                inputs += [(lower, upper), (lower, lower), (upper, upper)]
                facts = [[getattr(f, name) for f in column] for name in (lipschitz, spread)]
                if n_discs or motion is not None:
                    with np.errstate(invalid="ignore"):
                        centre = np.nan_to_num(0.5 * (lower + upper), nan=0.0, posinf=0.0, neginf=0.0)
                    facts += [centre, [f.reach for f in column], [getattr(f, swell) for f in column]]
                inputs += [(numbers, numbers) for numbers in map(np.array, facts)]
            with np.errstate(all="ignore"):
                low, high, steep, wide, *others = program(*inputs)
            lowest = np.broadcast_to(np.where(np.isnan(low[0]), -np.inf, low[0]), (n, self.dimension))
            highest = np.broadcast_to(np.where(np.isnan(high[1]), np.inf, high[1]), (n, self.dimension))
            return lowest, highest, np.broadcast_to(steep[1], n).tolist(), np.broadcast_to(wide[1], n).tolist(), others

        lowest, highest, steepest, widest, others = found_for("lipschitz", "spread", "swell")
        undivided, undivided_widest = steepest, widest
        adds, bounded = self.adds(len(first), params), self.template(len(first), params).body.data is BOUND
        if any(facts.divided for below, _ in members for facts in below):
            *corners, undivided, undivided_widest, of = found_for("undivided", "undivided_spread", "undivided_swell")
            if adds:
                (lowest, highest), others = corners, of
        with np.errstate(all="ignore"):
            regions = Regions([below for below, _ in members], (lowest, highest), others, n_discs, motion)
        found = []
        for i, (below, own) in enumerate(members):
            largest = max((facts.lipschitz for facts in below), default=1.0)
            steep = steepest[i] if declared else largest
            largest = max([largest, *[facts.undivided for facts in below]])
            whole = undivided[i] if declared else largest
            if declared and undivided[i] <= steepest[i]:  # a constant for children that are 1-Lipschitz
                whole *= max(largest, 1.0)
            wide, undivided_wide = regions.spread(i, widest[i]), regions.spread(i, undivided_widest[i], undivided=True)
            swell, undivided_swell = regions.swell(i, wide), regions.swell(i, undivided_wide, undivided=True)
            if adds:
                steep, wide, swell = whole, undivided_wide, undivided_swell
            if bounded:
                steep = largest
            if not 0 < steep < np.inf:
                what = f"{self.called} has no finite Lipschitz bound here ({steep})"
                raise SceneError(what, legal="a bounded child, and parameters with a finite range")
            exactness = worst(_value(self.exactness, below, own), *[facts.exactness for facts in below])
            convex = bool(_value(self.convex, below, own))
            found.append(
                Facts(
                    exactness,
                    min(steep, 1.0),
                    regions.lower[i],
                    regions.upper[i],
                    self._symmetry(below, own),
                    max(steep, 1.0),
                    1.0 if exactness == "exact" else wide * max(steep, 1.0),
                    convex and (callable(self.convex) or all(facts.convex for facts in below)),
                    whole,
                    1.0 if exactness == "exact" else undivided_wide,
                    regions.radii[i],
                    1.0 if exactness == "exact" else swell * max(steep, 1.0),
                    1.0 if exactness == "exact" else undivided_swell,
                    regions.placed[i],
                    regions.far[i],
                )
            )
        return found

    def estimates(self, node: Node) -> bool:
        """True if a node of this definition is an estimate by itself, of a solid with a box."""
        facts = node.facts
        if facts.exactness != "estimate" or facts.empty or np.all(np.isinf([facts.lower, facts.upper])):
            return False
        return _value(self.exactness, [child.facts for child in node.children], node.params) == "estimate"

    def _symmetry(self, children: Sequence[Facts], params: Mapping[str, Any]) -> str:
        if self.symmetry == "keep":
            return "".join(sorted(set("xyz").intersection(*[c.symmetry for c in children])))
        return str(_value(self.symmetry, children, params))

    def _trace_facts(self, n_children: int, params: Mapping[str, Any]) -> tuple[Program, bool, int, Motion | None]:
        symbols = {n: var(n, t) for n, t in self._symbols()}
        box = vector(self.child_dimension)
        inputs = list(symbols.values())
        children = []
        for i in range(n_children):
            facts = [var(f"{name} {i}", box) for name in ("box", "lower", "upper")]
            facts += [var(f"{name} {i}", FLOAT) for name in ("lipschitz", "spread")]
            facts += [var(f"centre {i}", box), var(f"radii {i}", VECTORS[4]), var(f"swell {i}", FLOAT)]
            inputs += facts if self.radii is not None or self.motion is not None else facts[:-3]
            children.append(ChildFacts(*facts))
        arguments = {**symbols, **dict(self.statics(params))}
        extra: tuple[Any, ...] = (children,) if self.arity == "many" else tuple(children)
        endless = np.full(self.dimension, np.inf)
        region = (const(-endless), const(endless)) if self.bounds is None else self.bounds(*extra, **arguments)
        corners = region if isinstance(region, tuple) else (region, region)
        if len(corners) != 2 or any(expr(corner).type is not vector(self.dimension) for corner in corners):
            what = f"{self.called}: bounds gives {short(region)}"
            raise SceneError(what, legal="the corners (lower, upper), such as cube(half)")
        lower, upper = corners
        steep, spread = _value(self.lipschitz, extra, arguments), _value(self.spread, extra, arguments)
        roots = [*map(expr, (lower, upper, 0.0 if steep is None else steep, np.inf if spread is None else spread))]
        discs = _value(self.radii, extra, arguments)
        discs = [] if discs is None else discs if n_children else [(0.5 * (roots[0] + roots[1]), discs)]
        roots += [expr(part) for disc in discs for part in disc]
        motion = _value(self.motion, extra, arguments)
        if motion is not None:
            roots += motion.parts(self.dimension)
        return Program(roots, inputs, INTERVALS), steep is not None, len(discs), motion


@called_by_nodes
def derive_facts(root: Node) -> None:
    """Derives the facts of a node and of all below it that have none yet: those of equal definition at once."""
    missing = children_first(root, lambda node: node.known_facts is None)
    height: dict[int, int] = {}
    groups: dict[tuple[Any, ...], list[Node]] = {}
    for node in missing:
        level = height[id(node)] = 1 + max((height.get(id(child), 0) for child in node.children), default=0)
        key = (level, node.definition, len(node.children), node.definition.statics(node.params))
        groups.setdefault(key, []).append(node)
    for key in sorted(groups, key=itemgetter(0)):
        nodes = groups[key]
        found = nodes[0].definition._derive([([c.facts for c in node.children], node.params) for node in nodes])
        for node, facts in zip(nodes, found, strict=True):
            node.known_facts = facts


def divisor_of(node: Node) -> float | None:
    """The number by which the field of a node is divided; None if parts of it are divided by different numbers."""
    if not node.facts.divided:
        return 1.0
    definition, n = node.definition, len(node.children)
    if definition.template(n, node.params).body.data is BOUND:
        return None
    if not n or definition.adds(n, node.params):
        return node.facts.divisor
    below = {divisor_of(child) for child in node.children}
    (one,) = below if len(below) == 1 else (None,)
    return None if one is None else one * node.facts.divisor


def _stacked(intervals: Sequence[Interval]) -> Interval:
    """Intervals of equal type as one; those of one number stay such."""
    low = np.array([interval[0] for interval in intervals])
    if all(interval[0] is interval[1] for interval in intervals):
        return low, low
    return low, np.array([interval[1] for interval in intervals])


def definition_of(function: Callable[..., Any]) -> Definition:
    """The definition of a function that `@shape` or `@operator` gave to the user."""
    found: Definition = function.definition  # type: ignore[attr-defined]  # typed as the function that was decorated
    return found


def _value(rule: Any, children: Sequence[Any], params: Mapping[str, Any]) -> Any:
    """A fact that is stated, or the value of its function."""
    return rule(*children, **params) if callable(rule) else rule


def _reordered(
    source: Callable[..., Any], extra: tuple[Any, ...], statics: Mapping[str, Any], names: Sequence[str]
) -> Callable[..., Any]:
    """The definition as a function of symbols alone: point first, children next, parameters by name."""

    def run(p: Expr, *symbols: Expr) -> Any:
        moving = iter(symbols)
        values = {name: statics[name] if name in statics else next(moving) for name in names}
        return source(p, *extra, **values)

    return run


REGISTRY: dict[str, Definition] = {}
"""Every definition by name. A user's own definition of the same name replaces the entry, not the nodes made before."""


FLAT: Mapping[Type | None, Type] = {VEC3: VEC2, MAT3: MAT2}
"""The 2D domain of a 3D parameter."""


def _define(
    source: Callable[..., Any], arity: str, dimension: Dimension, child_dimension: Dimension, declared: dict[str, Any]
) -> Definition:
    """The definition; one of any dimension gets a flat twin, whose vectors have two components."""
    absent = {"check": None, "associative": False, "cuts": False, "placing": "", "motion": None, "shift": None}
    declared = {**absent, **declared}
    if declared["placing"] in ("rigid", "scale"):
        declared["spread"] = declared["spread"] or (lambda child, **params: math.sqrt(3.0) * child.spread)
        declared["convex"] = True
    if dimension != "any" and child_dimension != "any":
        definition = _define_one(source, arity, dimension, child_dimension, declared)
        REGISTRY[definition.name] = definition
        return definition
    definition = _define_one(source, arity, 3, 3, declared)
    domains = {name: replace(d, type=FLAT.get(d.type, d.type)) for name, d in definition.domains.items()}
    shorter = {name: v[:2] for name, v in definition.defaults.items() if domains[name].type is VEC2 and len(v) == 3}
    definition.flat = replace(
        definition,
        name=f"{definition.name}_2d",
        dimension=2,
        child_dimension=2,
        domains=domains,
        defaults={**definition.defaults, **shorter},
        flat=None,
        _templates={},
        _facts={},
    )
    for made in (definition, definition.flat):
        REGISTRY[made.name] = made
    return definition


def _define_one(
    source: Callable[..., Any], arity: str, dimension: int, child_dimension: int, declared: dict[str, Any]
) -> Definition:
    code = inspect.unwrap(source).__code__
    where = Location(code.co_filename, code.co_firstlineno)
    skip = 1 if arity == "none" else 2
    hints = _hints(source)
    signature = list(inspect.signature(source).parameters.values())
    if len(signature) < skip:
        needs = "a point p" if skip == 1 else "a point p and a child"
        raise SceneError(f"{source.__name__} takes too few parameters", legal=f"{needs} come first", where=where)
    own = signature[skip:]
    domains = {q.name: domain_of(hints.get(q.name), q.default) for q in own}
    defaults = {q.name: q.default for q in own if q.default is not q.empty}
    for fact, rule in declared.items():
        if callable(rule):
            what = f"{source.__name__}: {fact}"
            first = ["by"] if fact == "shift" else _children_of(arity, fact in OF_ALL_CHILDREN)
            declared[fact] = _of_all(what, rule, first, list(domains), where)
    return Definition(
        name=source.__name__,
        called=declared.pop("called") or source.__name__,
        source=source,
        arity=arity,
        dimension=dimension,
        child_dimension=child_dimension,
        domains=domains,
        defaults=defaults,
        where=where,
        doc=inspect.getdoc(source) or "",
        **declared,
    )


def _hints(source: Callable[..., Any]) -> Mapping[str, Any]:
    """The annotations of a definition; none if one of them cannot be evaluated.

    Almost all are names of the module. `typing` takes some ten times as long for each.
    """
    known = source.__globals__
    try:
        if all(isinstance(hint, str) for hint in source.__annotations__.values()):
            return {
                n: known[hint] if hint in known else eval(hint, known) for n, hint in source.__annotations__.items()
            }
        return typing.get_type_hints(source, include_extras=True)
    except (NameError, TypeError):
        return {}


OF_ALL_CHILDREN = ("exactness", "symmetry", "convex", "check", "placing")
"""Facts whose functions receive each child's facts as an argument; the others receive one list of many children."""


def _children_of(arity: str, of_all: bool) -> list[str]:
    """The arguments by which a function of facts receives the children."""
    return {"none": [], "one": ["child"], "many": ["*children" if of_all else "children"]}[arity]


def _of_all(what: str, rule: Rule, first: Sequence[str], names: Sequence[str], where: Location) -> Rule:
    """A function of facts that takes its first arguments and some parameters of its definition, as a function of all.

    SceneError if it cannot be called with them.
    """
    children = sum(2 if name.startswith("*") else 1 for name in first)
    if _takes(rule, children, names):  # inspecting the rules of all definitions takes longer than tracing them
        return rule
    try:
        signature = inspect.signature(rule)
    except ValueError:  # a function without a signature
        return rule
    kinds = [q.kind for q in signature.parameters.values()]
    taken = list(names) if inspect.Parameter.VAR_KEYWORD in kinds else [n for n in names if n in signature.parameters]
    try:
        signature.bind(*range(children), **dict.fromkeys(taken))
    except TypeError:
        legal = f"it receives {', '.join([*first, *names])}"
        raise SceneError(f"{what} takes {signature}", legal=legal, where=where) from None
    if len(taken) == len(names):
        return rule
    return lambda *facts, **given: rule(*facts, **{name: given[name] for name in taken})


def _takes(rule: Rule, children: int, names: Sequence[str]) -> bool:
    """True if a rule is a plain function of some children and exactly these parameters."""
    if not inspect.isfunction(rule) or hasattr(rule, "__wrapped__"):
        return False
    code = rule.__code__
    plain = not code.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS) and not code.co_kwonlyargcount
    return plain and code.co_varnames[children : code.co_argcount] == tuple(names)


def _require(name: str, exactness: Any, bounds: Any) -> None:
    if bounds is None or exactness is None:
        legal = "@shape(exactness='exact' | 'bound' | 'estimate', bounds=function giving (lower, upper))"
        raise SceneError(f"{name} states no {'bounds' if bounds is None else 'exactness'}", legal=legal)
    if not callable(exactness) and exactness not in ("exact", "bound", "estimate"):
        raise SceneError(f"{name}: exactness = {short(exactness)}", legal="'exact', 'bound' or 'estimate'")


def _decorator(arity: str, dimension: Dimension, child_dimension: Dimension | None = None, **declared: Any) -> Any:
    """The decorator that makes a definition of a function, and gives the function that makes its nodes."""

    def decorate(source: Callable[..., Any]) -> Builder:
        _require(source.__name__, declared["exactness"], declared["bounds"] or declared.get("motion"))
        return Builder(_define(source, arity, dimension, child_dimension or dimension, declared), source)

    return decorate


@checked
def shape(
    *,
    exactness: Exactness | Rule | None = None,
    bounds: Rule | None = None,
    lipschitz: float | Rule = 1.0,
    symmetry: str | Rule = "",
    spread: float | Rule | None = None,
    convex: bool | Rule = False,
    radii: Rule | None = None,
    shift: Rule | None = None,
    check: Rule | Fits | None = None,
    dimension: Literal[2, 3] = 3,
    called: str = "",
) -> Callable[[Callable[Concatenate[Any, P], Any]], Callable[P, Node]]:
    """Decorator: a function of a point and parameters becomes a shape.

    Parameters
    ----------
    exactness : "exact" if the function gives the signed Euclidean distance, "bound" if its absolute value never exceeds
        that distance, "estimate" if nothing is known; or a function of the parameters that gives one of these. An
        estimate is evaluated in its box only; outside, the value at the nearest point of the box is used.
    bounds : function of the parameters that gives the corners (lower, upper) of a box around the solid.
    lipschitz : Lipschitz constant of the function; a number or a function of the parameters. A field with a constant
        above 1 is divided by it, so that marching is safe.
    symmetry : axes along which the field is mirror-symmetric about the origin, such as "xz".
    spread : how far the box grows with the field: a point with value m > 0 lies in the box grown by spread * m on each
        side. The value is that of the function, before it is divided by its Lipschitz constant. An exact shape has
        spread 1 and need not state it. None if it is not known. That is safe, but solids grown or blended from the
        shape then have no bounds.
    convex : True if the solid is convex for all parameters, or a function of the parameters.
    radii : function of the parameters, for an exact field: a vec4, the radii of the cylinders about the lines through
        the centre of the box along x, y and z, and of the ball about the centre, that contain the solid. None for those
        that contain the box. The box of the solid after a rotation follows from them.
    shift : function of a NumPy vec3 and the parameters, for a solid that can be described from an origin moved by the
        vec3: the parameters that change, and the vec3 that is left; see `raymarch.sdf.shifted`. None if it cannot.
    check : function of the parameters that raises SceneError for combinations that are not legal.
    dimension : 3, or 2 for a shape to extrude or revolve.
    called : the name in messages, reprs and GLSL; by default that of the function.

    The functions may take some of the parameters only, by name.
    The parameters are annotated with `Positive`, `Vec3`, ...; other values are refused before the definition runs.
    Raises SceneError if a fact is missing.
    """
    return _decorator("none", **locals())


@checked
def operator(
    *,
    bounds: Rule | None = None,
    exactness: Exactness | Rule | None = None,
    lipschitz: float | Rule | None = None,
    symmetry: str | Rule = "",
    spread: float | Rule | None = None,
    convex: bool | Rule = False,
    placing: Placing | Rule = "",
    radii: Rule | None = None,
    motion: Rule | None = None,
    shift: Rule | None = None,
    check: Rule | Fits | None = None,
    dimension: Dimension = 3,
    child_dimension: Literal[2, 3] | None = None,
    called: str = "",
) -> Callable[[Callable[Concatenate[Any, Any, P], Any]], Callable[Concatenate[Node, P], Node]]:
    """Decorator: a function of a point, a child and parameters becomes an operator on one node.

    Parameters
    ----------
    bounds : function of the child's facts (`box`, `lower`, `upper`, `lipschitz`, `spread`) and the parameters. It
        gives either (lower, upper) or an expression of `child.box`, whose range is the new box. `child.grown(h)` is
        the box around all points where the child's field is at most h. Use it wherever the surface moves by a value of
        the field: `child.lower - h` is correct only if the field is a distance.
    exactness : exactness of the result for an exact child; the result is never better than the child. May be a function
        of the child's facts and the parameters. None is "exact" if the operator is placed, else "bound".
    lipschitz : Lipschitz constant of the result; None for that of the child.
    symmetry : "keep" for the child's, axes such as "xz", or a function.
    spread : as for `shape`, or a function of the child's facts and the parameters, often `child.spread`.
    convex : True if a convex child gives a convex solid, or a function of the child's facts and the parameters.
    placing : "rigid" for an operator that gives `child(q)`, where q is p moved, turned or reflected. "scale" for
        `factor * child(q)`, where q is that divided by the factor. Such an operator keeps what is known of its child:
        closed forms of rays, rows of many equal objects, instances, convexity and spread. The others of `Placing` say
        how the value follows from the child's.
    radii : function of the child's facts (`within(margin)`) and the parameters: a list of pairs, a centre and the radii
        about it as for `shape`. Each point of the solid lies within those of one pair.
    motion : for a rotation, in place of `bounds`: function of the child's facts and the parameters that gives a
        `raymarch.sdf.regions.Motion`.
    shift : as for `shape`.
    check : function of the child's facts and the parameters that raises SceneError.
    dimension, child_dimension : 2 or 3, of the result and of the child. With dimension="any" the child may be 3D or
        flat; for a flat child p, and parameters that are a vec3 (mat3) in 3D, become a vec2 (mat2).
    called : the name in messages, reprs and GLSL; by default that of the function.
    """
    given = locals()
    placed = placing in ("rigid", "scale")
    return _decorator("one", **given | {"exactness": exactness or ("exact" if placed else "bound")})


def combination(
    *,
    bounds: Rule,
    exactness: Exactness | Rule = "bound",
    lipschitz: float | Rule | None = None,
    symmetry: str | Rule = "keep",
    spread: float | Rule | None = None,
    convex: bool | Rule = False,
    radii: Rule | None = None,
    associative: bool = False,
    cuts: bool = False,
    placing: Placing = "",
    dimension: Dimension = 3,
    child_dimension: Literal[2, 3] | None = None,
    called: str = "",
) -> Callable[[Callable[Concatenate[Any, Any, P], Any]], Callable[Concatenate[Sequence[Node], P], Node]]:
    """Decorator: a function of a point, a list of children and parameters becomes an operator on many nodes.

    The parameters are those of `operator`, and two more. `associative`: nested nodes of this kind are merged into one.
    `cuts`: a child without its own material takes the material of the child that it cuts.
    """
    return _decorator("many", **locals())


def cube(half: Any) -> tuple[Expr, Expr]:
    """The box from -half to half. `half` is a number or a vec3 (a vec2 for flat shapes)."""
    corner = expr(half)
    corner = expr((corner,) * 3) if corner.type is FLOAT else corner
    return -corner, corner


def around_y(radius: Any, low: Any, high: Any) -> tuple[Expr, Expr]:
    """The box of a solid of revolution about the y axis, by its largest radius and its lowest and highest points."""
    return vec3(-radius, low, -radius), vec3(radius, high, radius)


def radii_about_y(radius: Any, half: Any, ball: Any = None) -> Expr:
    """The radii of a solid of revolution about y, by its largest radius and half its height."""
    corner = length(vec2(radius, half)) if ball is None else expr(ball)
    return vec4(corner, radius, corner, corner)


EVERYWHERE = (const([-np.inf] * 3), const([np.inf] * 3))
"""Bounds of an unbounded solid."""


FLOOR = "floor"


BOUND = "bound"


def with_bound(value: Expr, bound: Expr) -> Expr:
    """The value of a definition, and a field of the same solid that is marched in place of the divided value.

    bound : no steeper than the steepest child. It is worth stating where it is larger than the divided value, such as
        far from the surface.
    """
    return make("max", FLOAT, (value, bound), BOUND)


SELECTS = ("neg", "abs", "min", "max", "where", "add", "sub")


def is_homogeneous(body: Expr) -> bool:
    """True if a definition's value is scaled by a factor where the distances of its children are scaled by it."""
    degree: dict[Expr, int] = {}
    for node in topological([body]):
        of = [degree[arg] for arg in node.args]
        known = {d for arg, d in zip(node.args, of, strict=True) if not _is_zero(arg)}
        if node.op == "apply":
            degree[node] = 1
        elif 1 not in known:
            degree[node] = 0
        elif node.data is BOUND:
            return False
        elif node.data is FLOOR or (known == {1} and node.op in (*SELECTS, "lt", "le", "gt", "ge")):
            degree[node] = 0 if node.type is BOOL else 1
        elif (
            (
                node.op == "where"
                and of[0] == 0
                and all(d == 1 or _is_zero(arg) for arg, d in zip(node.args[1:], of[1:], strict=True))
            )
            or (node.op == "mul" and sum(of) == 1)
            or (node.op == "div" and of == [1, 0])
        ):
            degree[node] = 1
        else:
            return False
    return degree[body] == 1


def _is_zero(value: Expr) -> bool:
    return value.op == "const" and value.type is not BOOL and not np.any(value.data)


def at_least(value: Expr, floor: Expr) -> Expr:
    """The larger of a field and a lower bound of the distance, such as the distance to the box.

    Where both are 0, as on a face that touches the box, the material is that of the field: materials ignore the lower
    bound.
    """
    return make("max", FLOAT, (value, floor), FLOOR)
