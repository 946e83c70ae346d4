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
from raymarch.expr.peers import OPERATORS, refused_operator, unknown_attribute
from raymarch.sdf.facts import Exactness, Facts
from raymarch.sdf.same import Same, same

if TYPE_CHECKING:
    from raymarch.expr.function import Function
    from raymarch.expr.node import Expr
    from raymarch.sdf import affine, booleans, copies, deform, heights, noise, placing, profiles, queries, repetition
    from raymarch.sdf.definition import Definition
    from raymarch.sdf.domain import Scalar, Vector

    Named = Mapping[str, Any] | None

__all__ = ["Node"]


class Node:
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
        """Name of the shape or operator."""
        return self.definition.called

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

    def _call(self, name: str, *args: Any, **kwargs: Any) -> Node:
        return METHODS[name](self, *args, **kwargs)

    if TYPE_CHECKING:  # `method` adds them
        union, intersection, difference = booleans.union, booleans.intersection, booleans.difference
        rotate, scale, transform, mirror = placing.rotate, placing.scale, affine.transform, placing.mirror
        orient, shear, wrap_around = placing.orient, deform.shear, deform.wrap_around
        twist, bend, taper, displace = deform.twist, deform.bend, deform.taper, deform.displace
        displace_by, displace_by_noise = noise.displace_by, noise.displace_by_noise
        displace_by_image, extrude_to = heights.displace_by_image, profiles.extrude_to
        repeat, polar = repetition.repeat, copies.polar
        repeat_mirrored, repeat_interval = copies.repeat_mirrored, copies.repeat_interval
        material, raycast, material_at = placing.material, queries.raycast, queries.material_at

    # Methods of operators, whose types a decorator derives

    def translate(self, offset: Vector) -> Node:
        """Move a solid, or a flat shape in its plane.

        Parameters
        ----------
        offset : (x, y, z), lengths; (x, y) for a flat shape. Numbers or expressions of `Param` and `time`.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : another number of components.

        Notes
        -----
        Exact for an exact solid.

        Examples
        --------
        >>> rm.sphere(1).translate((3, 0, 0)).distance((0, 0, 0))
        array(2.)
        """
        return self._call("translate", offset)

    def round(self, radius: Scalar) -> Node:
        """Grow by a radius, with rounded edges: the sum of the solid and a ball.

        Parameters
        ----------
        radius : a length >= 0. `box(1).round(0.1)` is 1.2 wide; `rounded_box` keeps the size.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a negative radius.

        Notes
        -----
        Exact outside for an exact solid.

        Examples
        --------
        >>> rm.box(1).round(0.1).bounds[1]
        array([0.6, 0.6, 0.6])
        """
        return self._call("round", radius)

    def shell(self, thickness: Scalar) -> Node:
        """A hollow solid, with half of the wall on either side of the surface.

        Parameters
        ----------
        thickness : of the wall, a length > 0.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a thickness that is not positive.

        Notes
        -----
        Exact for an exact solid.

        Examples
        --------
        >>> rm.sphere(1).shell(0.2).distance([(0, 0, 0), (1, 0, 0)])
        array([ 0.9, -0.1])
        """
        return self._call("shell", thickness)

    def offset(self, distance: Scalar) -> Node:
        """Move the surface along its normals.

        Parameters
        ----------
        distance : a length; positive grows the solid, negative shrinks it.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : what is no number.

        Notes
        -----
        Exact outside for an exact solid that grows.

        Examples
        --------
        >>> rm.sphere(1).offset(-0.25).bounds[1]
        array([0.75, 0.75, 0.75])
        """
        return self._call("offset", distance)

    def elongate(self, extent: Vector) -> Node:
        """Elongate along the axes: the section through the origin is extruded, the ends keep their shape.

        Parameters
        ----------
        extent : (x, y, z), lengths >= 0 by which the solid grows along each axis; (x, y) for a flat shape.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a negative length.

        Examples
        --------
        >>> rm.sphere(1).elongate((2, 0, 0)).bounds[1]
        array([2., 1., 1.])
        """
        return self._call("elongate", extent)

    def complement(self) -> Node:
        """The complement: everything outside this solid.

        Returns
        -------
        Node
            A node, whose distance is that of the solid with the other sign.

        Examples
        --------
        >>> rm.sphere(1).complement().distance((0, 0, 0))
        array(1.)
        """
        return self._call("complement")

    def transition(self, other: Node, start: Vector, end: Vector) -> Node:
        """A transition from this solid to another one along a line.

        Parameters
        ----------
        other : a bounded solid.
        start, end : distinct points, (x, y, z): this solid ends at the plane through `start`, the other begins at that
            through `end`.

        Returns
        -------
        Node
            A node, a bound.

        Raises
        ------
        SceneError : unbounded solids, or equal points.
        """
        return self._call("transition", other, start, end)

    def extrude(self, height: Scalar = 1.0, scale: Scalar = 1.0, twist: Scalar = 0.0, draft: Scalar = 0.0) -> Node:
        """Extrude a flat shape along z, centred.

        Parameters
        ----------
        height : full extent along z, a length > 0.
        scale : factor of the upper end, >= 0.01; the section grows evenly from the lower end, which is not scaled.
        twist, draft : angles in radians by which the upper end is turned from x towards y, and the sides lean inwards.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a solid, or a height that is not positive.

        Notes
        -----
        Exact for an exact shape without scale, twist and draft, else a bound.

        Examples
        --------
        >>> rm.circle(1).extrude(3).bounds[1]
        array([1. , 1. , 1.5])
        """
        return self._call("extrude", height, scale, twist, draft)

    def revolve(self, offset: Scalar = 0.0, angle: Scalar = 2.0 * np.pi) -> Node:
        """Revolve a flat shape about the y axis, after moving it along +x.

        Parameters
        ----------
        offset : the motion along +x. The part that is then at x < 0 is cut off.
        angle : of the whole turn in radians, half of it on either side of the +x axis, above 0 and up to 2 pi.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a solid.

        Notes
        -----
        A whole turn of an exact shape is exact if the shape does not touch the axis.

        Examples
        --------
        >>> rm.circle(0.25).revolve(1).distance((1, 0, 0))
        array(-0.25)
        """
        return self._call("revolve", offset, angle)

    def slice(self, z: Scalar = 0.0) -> Node:
        """The section of a solid in a plane of constant z, a flat shape.

        Parameters
        ----------
        z : of the plane, a length.

        Returns
        -------
        Node
            A flat node, a bound.

        Raises
        ------
        SceneError : a flat shape.

        Examples
        --------
        >>> rm.sphere(1).slice().distance((0, 0))
        array(-1.)
        """
        return self._call("slice", z)

    def visible(self, camera: bool = True, shadow: bool = True, reflection: bool = True) -> Node:
        """Hide this solid from kinds of rays.

        Parameters
        ----------
        camera, shadow : False hides it from camera rays, or from shadow rays.
        reflection : False hides it from rays that start at surfaces: reflected, refracted and random ones.

        Returns
        -------
        Node
            A node with the same field.

        Raises
        ------
        SceneError : what is no bool.

        Examples
        --------
        >>> rm.sphere(1).visible(shadow=False).name
        'visible'
        """
        return self._call("visible", camera, shadow, reflection)


METHODS: dict[str, Callable[..., Any]] = {}
"""The functions of modules that import `Node` which nodes call, by name."""

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


def at_line_of(node: Node, made: Node) -> Node:
    """A new node that belongs to the user's line of another one."""
    made.where = node.where
    return made


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

for _name, _method in list(vars(Node).items()):
    if callable(_method) and not _name.startswith("_"):
        setattr(Node, _name, checked(_method, _name))
