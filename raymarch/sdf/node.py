"""`Node`, a solid or flat shape. Its facts and its field are derived when they are first needed."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.conveniences import carried_out_by
from raymarch.errors import Location, SceneError, user_location
from raymarch.expr.calls import checked
from raymarch.expr.convert import described, short
from raymarch.expr.node import Expr
from raymarch.expr.peers import OPERATORS, refused_operator, unknown_attribute
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.methods import METHODS as METHODS
from raymarch.sdf.methods import Methods
from raymarch.sdf.same import Same, same

if TYPE_CHECKING:
    from raymarch.expr.function import Function
    from raymarch.sdf import affine, booleans, copies, deform, heights, noise, placing, profiles, repetition, warps
    from raymarch.sdf.definition import Definition

    Named = Mapping[str, Any] | None

__all__ = ["Node"]


class Node(Methods):
    """A solid, given by its signed distance: negative inside, positive outside.

    Nodes are made by shapes (`sphere()`) and operators (`a | b`, `a.translate(...)`). They are immutable.
    """

    __slots__ = (
        *("__weakref__", "_field", "_same", "children", "definition", "known_facts", "label", "labelled"),
        *("params", "where"),
    )

    def __init__(
        self,
        definition: Definition,
        children: tuple[Node, ...],
        params: Mapping[str, Any],
        facts: Facts | None = None,
        label: Any = None,
    ) -> None:
        self.definition = definition
        self.children = children
        self.params = params
        self.known_facts = facts  # None until they are derived; see `facts`
        self.label = label
        self.labelled: bool = label is not None or any(child.labelled for child in children)
        if not self.labelled and "rows" in params:  # many objects, with materials of their own
            self.labelled = bool(params["rows"].labelled)
        self.where: Location | None = user_location()
        self._field: Function | None = None  # lowered, with the programs that evaluate it; see `raymarch.sdf.lower`
        self._same: Same = same(definition, tuple(child._same for child in children), tuple(params.items()), label)

    def __eq__(self, other: object) -> bool:
        """True for the same solid, written anywhere: equal definitions, parameters, materials and children."""
        return isinstance(other, Node) and self._same is other._same

    def __hash__(self) -> int:
        return hash(self._same)

    def __bool__(self) -> bool:
        legal = "use a & b in place of a and b, a | b in place of a or b, a - b or node.complement() in place of not, "
        raise SceneError(f"a node ({self.name}) has no truth value", legal=f"{legal}node is not None in place of if")

    def __copy__(self) -> Node:
        return self

    def __deepcopy__(self, memo: Any) -> Node:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return cast("tuple[Any, ...]", METHODS["reduced"](self))

    def __repr__(self) -> str:
        lower, upper = (np.array2string(b, precision=4, separator=", ") for b in self.bounds)
        return f"<{self.name}: {self.exactness}, lipschitz {self.lipschitz:.4g}, bounds {lower} to {upper}>"

    if not TYPE_CHECKING:  # a type checker would accept any name

        def __getattr__(self, name: str) -> Any:
            """Raise UnknownNameError, which names the method that is meant."""
            if name.startswith("_"):  # what Python and its tools look for
                raise AttributeError(f"'Node' object has no attribute '{name}'")
            public = [known for known in dir(Node) if not known.startswith("_")]
            raise unknown_attribute(f"a node ({self.name})", name, public, methods=True)

    def _repr_png_(self) -> bytes:
        """The picture of the node, for notebooks; drawn by `raymarch.export`, a layer above this package."""
        return cast(bytes, carried_out_by("png")(self))

    # Facts

    @property
    def name(self) -> str:
        """Name of the shape or operator, as it was called."""
        by_data: str = getattr(self.params.get("data"), "called", "")
        return by_data or self.definition.called

    @property
    def placed_as(self) -> str:
        """How the operator passes distances on; see `raymarch.sdf.definition.Placing`."""
        found = self.definition.placing
        return found if isinstance(found, str) else found(*[child.facts for child in self.children], **self.params)

    @property
    def facts(self) -> Facts:
        """The facts, derived when they are first read, with those of all nodes below."""
        if self.known_facts is None:
            METHODS["derive_facts"](self)
        return cast("Facts", self.known_facts)

    @property
    def dimension(self) -> int:
        """3, or 2 for a flat shape."""
        return self.definition.dimension

    @property
    def exactness(self) -> Exactness:
        """ "exact", "bound" or "estimate"."""
        return self.facts.exactness

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant of `distance`; infinite for an estimate."""
        return float("inf") if self.exactness == "estimate" else self.facts.lipschitz

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (lower, upper) of a box around the solid, each of shape (3,); infinite where it is unbounded."""
        return self.facts.lower.copy(), self.facts.upper.copy()

    # Values

    @overload
    def distance(self, points: Expr) -> Expr: ...
    @overload
    def distance(self, points: ArrayLike, time: float = ..., params: Named = ...) -> NDArray[np.float64]: ...
    def distance(self, points: ArrayLike | Expr, time: float = 0.0, params: Named = None) -> NDArray[np.float64] | Expr:
        """Signed distance in float64.

        Parameters
        ----------
        points : shape (N, 3), or (3,) for one point ((N, 2) for a flat shape). Or the point of a function such as a
            density or a colour, an expression; the result is an expression then.
        time : value of `rm.time` in seconds.
        params : values of parameters by name, within their ranges; the others keep their defaults.

        Returns
        -------
        shape (N,), or () for one point.

        Raises
        ------
        SceneError : arguments of another kind or outside their range.

        Examples
        --------
        >>> rm.sphere(1).translate((rm.time, 0, 0)).distance((3, 0, 0), time=1.5)
        array(0.5)
        >>> rm.Medium(lambda p: 9 * rm.max(-rm.sphere().distance(p), 0), rm.sphere().bounds).steps
        48
        """
        with METHODS["values_bound"](self, time, params):
            return METHODS["distance_at"](self, points)

    def gradient(self, points: ArrayLike, time: float = 0.0, params: Named = None) -> NDArray[np.float64]:
        """Gradient of the distance in float64: the outward normal where the field is exact.

        Parameters
        ----------
        points : shape (N, 3), or (3,) for one point.
        time, params : see `distance`.

        Returns
        -------
        the same shape as `points`. On edges and medial axes, where the gradient does not exist, that of one side or 0.

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        with METHODS["values_bound"](self, time, params):
            return METHODS["evaluate_gradient"](self, points)

    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        far: float = np.inf,
        time: float = 0.0,
        params: Mapping[str, Any] | None = None,
    ) -> Any:
        """The first points where rays meet the solid, in float64 on the CPU: `rm.raycast` of this node.

        Parameters
        ----------
        origins : (N, 3) or (3,), one point for all rays.
        directions : (N, 3) or (3,), of any length but 0. A ray that starts in the solid meets the surface where it
            leaves.
        far : largest distance, > 0.
        time : value of `rm.time` in seconds.
        params : values of parameters by name.

        Returns
        -------
        Hits
            `distance` (N,), inf where nothing was hit; `hit`, `position`, `normal`, `material` and `gap`.

        Raises
        ------
        SceneError : arrays of another shape, a direction of length 0, or values that are not finite.

        Examples
        --------
        >>> rm.sphere(1).raycast([(0, 0, 5), (0, 3, 5)], (0, 0, -1)).distance
        array([ 4., inf])
        """
        return carried_out_by("raycast")(self, origins, directions, far=far, time=time, params=params)

    def material_at(
        self, points: ArrayLike, time: float = 0.0, params: Mapping[str, Any] | None = None
    ) -> NDArray[np.int64]:
        """The material of the part that decides the field at points, on the surface or anywhere.

        Parameters
        ----------
        points : (N, 3), or (3,) for one point.
        time : value of `rm.time` in seconds.
        params : values of parameters by name.

        Returns
        -------
        NDArray[int64]
            (N,), or () for one point: indices into `rm.Scene(node).materials`; 0 is the default, of parts without one.
            In a smooth blend, that of the part with the larger weight.

        Raises
        ------
        SceneError : an array of another shape, values that are not finite, or a value of a parameter out of range.

        Examples
        --------
        >>> both = rm.sphere(1) | rm.box().translate((3, 0, 0)).material(rm.Material(color="gold"))
        >>> both.material_at([(0, 0, 1), (3, 0, 1)])
        array([0, 1])
        """
        found: NDArray[np.int64] = carried_out_by("material_at")(self, points, time, params)
        return found

    def glsl(self) -> str:
        """The field alone, as GLSL text: `float field(vec3 p)` and the functions that it calls.

        Returns
        -------
        str
        """
        return METHODS["print_field"](self)

    # Combining

    def __or__(self, other: Node) -> Node:
        return self._combine("union", other)

    def __and__(self, other: Node) -> Node:
        return self._combine("intersection", other)

    def __sub__(self, other: Node) -> Node:
        return self._combine("difference", other)

    def __xor__(self, other: Node) -> Node:
        return self._combine("xor", other)

    def _combine(self, name: str, other: Node) -> Node:
        if not isinstance(other, Node):
            raise SceneError(f"{name} of {self.name} and {described(other)}", legal="two nodes")
        return self._call(name, other)

    if TYPE_CHECKING:  # `method` adds them
        union, intersection, difference = booleans.union, booleans.intersection, booleans.difference
        rotate, scale, transform, mirror = placing.rotate, placing.scale, affine.transform, placing.mirror
        orient, shear, wrap_around = placing.orient, deform.shear, deform.wrap_around
        twist, bend, taper, displace = deform.twist, deform.bend, deform.taper, deform.displace
        displace_by, displace_by_noise = noise.displace_by, noise.displace_by_noise
        displace_by_image, extrude_to, warp = heights.displace_by_image, profiles.extrude_to, warps.warp
        extrude, revolve = profiles.extrude, profiles.revolve
        repeat, polar = repetition.repeat, copies.polar
        repeat_mirrored, repeat_interval = copies.repeat_mirrored, copies.repeat_interval
        material = placing.material


T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


def called_by_nodes(function: F) -> F:
    """Decorator: let the methods of nodes find this function by its name."""
    METHODS[function.__name__] = function
    return function


def method(function: F) -> F:
    """Decorator: let nodes offer this function as the method of the same name. Its first argument is the node.

    Calls with wrong arguments raise SceneError, those of the function, too.
    """
    name = function.__name__
    METHODS[name] = function
    if hasattr(Node, name):  # a method with a signature of its own
        return function

    @wraps(function)
    def bound(self: Node, *args: Any, **kwargs: Any) -> Any:
        return function(self, *args, **kwargs)

    signature = inspect.signature(function)
    first, *others = signature.parameters.values()
    own = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    others = [first, *others] if first.kind is first.VAR_POSITIONAL else others
    bound.__signature__ = signature.replace(parameters=[own, *others])  # type: ignore[attr-defined]
    bound.__qualname__ = f"Node.{name}"
    setattr(Node, name, checked(bound, name))
    return checked(function)


_KEPT = object()


def replaced(
    node: Node,
    children: tuple[Node, ...],
    params: Mapping[str, Any] | None = None,
    facts: Facts | None = None,
    label: Any = _KEPT,
) -> Node:
    """The node with other children, and other parameters, facts or label where given; at the same line of the user."""
    made = Node(
        node.definition,
        children,
        node.params if params is None else params,
        node.facts if facts is None else facts,
        node.label if label is _KEPT else label,
    )
    return at_line_of(node, made)


def rederived(node: Node, children: tuple[Node, ...], params: Mapping[str, Any]) -> Node:
    """The node with other children and parameters, and the facts that follow."""
    return replaced(node, children, params, node.definition.derive(children, params))


def values_of(node: Node) -> list[Expr]:
    """The parameters that are expressions."""
    return [value for value in node.params.values() if isinstance(value, Expr)]


def has_constants(node: Node) -> bool:
    """True if these are numbers that depend on nothing."""
    return all(value.is_constant for value in values_of(node))


def at_line_of(node: Node, made: Node) -> Node:
    """A new node that belongs to the user's line of another one."""
    made.where = node.where
    return made


def operand(what: str, node: Any) -> Node:
    """The node. SceneError if it is none. what : the operation on it, for the message."""
    if not isinstance(node, Node):
        raise SceneError(f"{what} of {described(node)}", legal="a node such as sphere()")
    return node


def solid(what: str, node: Any) -> Node:
    """The node. SceneError if it is none, or a flat shape. what : the operation on it, for the message."""
    if not isinstance(node, Node) or node.dimension != 3:
        flat = "; a flat shape: .extrude(height) or .revolve() first" if isinstance(node, Node) else ""
        raise SceneError(f"{what} of {described(node)}", legal=f"a solid such as sphere(){flat}")
    return node


def all_nodes(root: Node) -> list[Node]:
    """Every node of a tree once, parents first."""
    found = {id(root): root}
    pending = [root]
    while pending:
        for child in pending.pop().children:
            if id(child) not in found:
                found[id(child)] = child
                pending.append(child)
    return list(found.values())


def children_first(root: Node, entered: Callable[[Node], bool] = lambda _node: True) -> list[Node]:
    """Every node of a tree once, each after its children. Works for deep trees.

    entered : tells of a child whether it is listed, with what is below it.
    """
    found: dict[int, Node] = {}
    pending = [root]
    while pending:
        missing = [child for child in pending[-1].children if id(child) not in found and entered(child)]
        if not missing:
            node = pending.pop()
            found[id(node)] = node
        pending += missing
    return list(found.values())


def folded(root: Node, of: Callable[[Node, list[T]], T]) -> T:
    """What follows of a tree: `of` receives each node once, with the answers of its children."""
    found: dict[int, T] = {}
    for node in children_first(root):
        found[id(node)] = of(node, [found[id(child)] for child in node.children])
    return found[id(root)]


def _refused(symbol: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The methods of an operator that nodes do not have, with the node on the left and on the right."""

    def left(self: Node, other: object) -> Any:
        raise refused_operator(symbol, self.name, _shown(other))

    def right(self: Node, other: object) -> Any:
        raise refused_operator(symbol, _shown(other), self.name)

    return left, right


def _shown(operand: object) -> str:
    return operand.name if isinstance(operand, Node) else short(operand)


_OPERATORS = {"+": "add", "*": "mul", "/": "truediv", "@": "matmul", "**": "pow", "%": "mod", "-": "sub"}


def _refused_alone(symbol: str) -> Callable[..., Any]:
    """The method of a sign or a comparison that nodes do not have."""

    def alone(self: Node, *others: object) -> Any:
        raise refused_operator(symbol, self.name, *map(_shown, others))

    return alone


for _symbol, _names in {"-": "neg", "+": "pos", "~": "invert", "abs": "abs", "<": "lt le", ">": "gt ge"}.items():
    for _name in _names.split():
        setattr(Node, f"__{_name}__", _refused_alone(_symbol))
for _symbol in OPERATORS:
    _left, _right = _refused(_symbol)
    if _symbol != "-":
        setattr(Node, f"__{_OPERATORS[_symbol]}__", _left)
    setattr(Node, f"__r{_OPERATORS[_symbol]}__", _right)

for _name, _method in {**vars(Methods), **vars(Node)}.items():
    if callable(_method) and not _name.startswith("_"):
        setattr(Node, _name, checked(_method, _name))
