"""Definitions: the objects that `@shape` and `@operator` make from a short Python function.

A definition is traced once, on symbols, when it is first used; every node made from it shares the result. It enters a
registry, where the fluent methods, the generic tests and the documentation find it by name.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Concatenate, Literal, ParamSpec, TypeAlias

import numpy as np

from raymarch.errors import Location, SceneError
from raymarch.expr.calls import bad_call, checked
from raymarch.expr.convert import described, short
from raymarch.expr.function import Function, trace
from raymarch.expr.node import Expr, const, expr, make
from raymarch.expr.types import BOOL, FLOAT, MAT2, MAT3, VEC2, VEC3, Type, vector
from raymarch.expr.vocabulary import length, vec2, vec3, vec4
from raymarch.expr.walk import find, free_variables, substitute
from raymarch.sdf.builder import Builder
from raymarch.sdf.derivation import ChildFacts as ChildFacts
from raymarch.sdf.derivation import Traced, derive_facts, facts_of_members, facts_program
from raymarch.sdf.domain import Domain, Fits, domain_of
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.node import Node
from raymarch.sdf.rules import OF_ALL_CHILDREN, Rule, children_of, hints_of, of_all_parameters, stated
from raymarch.sdf.values import is_homogeneous

__all__ = ["operator", "shape"]

P = ParamSpec("P")
Child: TypeAlias = Callable[[Expr], Expr]
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
    domains: Mapping[str, Domain]
    defaults: Mapping[str, Any]
    where: Location
    doc: str
    lipschitz: float | Rule | None = None
    bounds: Rule | None = None
    symmetry: str | Rule = ""
    spread: float | str | Rule | None = None
    convex: bool | Rule = False
    radii: Rule | None = None
    motion: Rule | None = None
    check: Rule | Fits | None = None
    associative: bool = False
    cuts: bool = False
    touches: bool = False
    placing: Placing | Rule = ""
    shift: Rule | None = None
    flat: Definition | None = None
    """The same definition for flat children, where it serves both; this one then serves the solid ones."""
    _templates: dict[Any, Function] = field(default_factory=dict)
    programs: dict[Any, Traced] = field(default_factory=dict)
    """Of the facts; see `raymarch.sdf.derivation`."""

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
            facts_program(self, len(children), params)
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
            symbols = [("p", vector(self.dimension)), *self.symbols()]
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
        return dict(zip(template.params[1:], (params[name] for name, _ in self.symbols()), strict=True))

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

    def symbols(self) -> list[tuple[str, Type]]:
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
        return facts_of_members(self, [(below, params)])[0]

    def estimates(self, node: Node) -> bool:
        """True if a node of this definition is an estimate by itself, of a solid with a box."""
        facts = node.facts
        if facts.exactness != "estimate" or facts.empty or np.all(np.isinf([facts.lower, facts.upper])):
            return False
        return bool(stated(self.exactness, [child.facts for child in node.children], node.params) == "estimate")

    def statics(self, params: Mapping[str, Any]) -> tuple[Any, ...]:
        """The static parameters, on which the expressions of the field and of its facts depend."""
        return tuple((n, params[n]) for n, d in self.domains.items() if d.type is None)


def definition_of(function: Callable[..., Any]) -> Definition:
    """The definition of a function that `@shape` or `@operator` gave to the user."""
    found: Definition = function.definition  # type: ignore[attr-defined]  # typed as the function that was decorated
    return found


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
    if declared.get("placing") in PLACED:
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
        programs={},
    )
    for made in (definition, definition.flat):
        REGISTRY[made.name] = made
    return definition


def _define_one(
    source: Callable[..., Any], arity: str, dimension: int, child_dimension: int, declared: dict[str, Any]
) -> Definition:
    code = inspect.unwrap(source).__code__
    where = Location(code.co_filename, code.co_firstlineno)
    skip, hints = 1 if arity == "none" else 2, hints_of(source)
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
            first = ["by"] if fact == "shift" else children_of(arity, fact in OF_ALL_CHILDREN)
            declared[fact] = of_all_parameters(what, rule, first, list(domains), where)
    return Definition(
        name=source.__name__,
        called=declared.pop("called", "") or source.__name__,
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


def _require(name: str, exactness: Any, bounds: Any) -> None:
    if bounds is None or exactness is None:
        legal = "@shape(exactness='exact' | 'bound' | 'estimate', bounds=function giving (lower, upper))"
        raise SceneError(f"{name} states no {'bounds' if bounds is None else 'exactness'}", legal=legal)
    if not callable(exactness) and exactness not in ("exact", "bound", "estimate"):
        raise SceneError(f"{name}: exactness = {short(exactness)}", legal="'exact', 'bound' or 'estimate'")


def _decorator(arity: str, dimension: Dimension, child_dimension: Dimension | None = None, **declared: Any) -> Any:
    """The decorator that makes a definition of a function, and gives the function that makes its nodes."""

    def decorate(source: Callable[..., Any]) -> Builder:
        _require(source.__name__, declared["exactness"], declared.get("bounds") or declared.get("motion"))
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

    Returns
    -------
    A decorator, which gives a function that makes nodes.

    Raises
    ------
    SceneError : a fact is missing.

    Notes
    -----
    The functions may take some of the parameters only, by name. The parameters are annotated with `Positive`, `Vec3`,
    ...; other values are refused before the definition runs.
    """
    return _decorator("none", **locals())


@checked
def operator(
    *,
    bounds: Rule | None = None,
    exactness: Exactness | Rule | None = None,
    lipschitz: float | Rule | None = None,
    symmetry: str | Rule = "",
    spread: float | Literal["keep"] | Rule | None = None,
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
    spread : as for `shape`, "keep" for the child's, or a function of the child's facts and the parameters.
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

    Returns
    -------
    A decorator, which gives a function that makes nodes.

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    given = locals()
    placed = placing in ("rigid", "scale")
    return _decorator("one", **given | {"exactness": exactness or ("exact" if placed else "bound")})


def combination(
    *, exactness: Exactness | Rule = "bound", symmetry: str | Rule = "keep", dimension: Dimension = 3, **facts: Any
) -> Callable[[Callable[Concatenate[Any, Any, P], Any]], Callable[Concatenate[Sequence[Node], P], Node]]:
    """Decorator: a function of a point, a list of children and parameters becomes an operator on many nodes.

    The facts are those of `operator`, and three more. `associative`: nested nodes of this kind are merged into
    one. `cuts`: a child without its own material takes the material of the child that it cuts. `touches`: the value may
    be 0 where there is no surface, as where faces coincide. A hit then needs a sample inside. What cuts touches too.
    """
    return _decorator("many", dimension, exactness=exactness, symmetry=symmetry, **facts)


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
