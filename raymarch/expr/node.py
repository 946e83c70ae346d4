"""Expressions: immutable, typed, hash-consed. Two equal expressions are one object.

An `Expr` is an operation, its arguments and at most one piece of plain data. Each reading (GLSL, NumPy, intervals,
derivative) defines the operations by a table over their names.
"""

from __future__ import annotations

import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from os.path import abspath, dirname, sep
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, overload
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, SceneError
from raymarch.expr.convert import refuse_masked, short
from raymarch.expr.types import BOOL, FLOAT, MATRICES, STATE, VECTORS, Type, vector

_HERE = dirname(abspath(__file__)) + sep
_FILES: set[str] = set()
"""Files in this folder: a look-up takes less time than a comparison of names."""

Floats: TypeAlias = NDArray[np.floating[Any]]
Method: TypeAlias = Callable[["Expr", "Operand"], "Expr"]


def _operators(op: str) -> tuple[Method, Method]:
    """The methods of an operator, with the expression on the left and on the right; see `_COMPUTED`."""

    def left(self: Expr, other: Operand) -> Expr:  # a class with operators of its own says so, as textures do
        return NotImplemented if getattr(other, "OPERAND", False) else _COMPUTED[op](self, other)

    return left, lambda self, other: _COMPUTED[op](other, self)


def _function(op: str) -> Callable[[Expr], Expr]:
    """The method of a function of one argument."""
    return lambda self: elementwise(op, self)


class _Components:
    """Components as attributes, named as in GLSL."""

    def __init__(self, names: str) -> None:
        self.names = names

    @overload
    def __get__(self, value: None, owner: type[Expr]) -> _Components: ...

    @overload
    def __get__(self, value: Expr, owner: type[Expr]) -> Expr: ...

    def __get__(self, value: Expr | None, owner: type[Expr]) -> _Components | Expr:
        return self if value is None else swizzle(value, self.names)


class Expr:
    """A value computed for each point. Create it with the vocabulary, not with this constructor.

    op : name of the operation, a key of the tables of all readings.
    type : its GLSL type.
    args : the argument expressions.
    data : the constant of a `const`, the name of a `var`, the components of a `swizzle`, ...
    where : the source line that created it first; None for a constant.
    """

    __slots__ = ("__weakref__", "args", "below", "data", "op", "type", "where")

    op: str
    type: Type
    args: tuple[Expr, ...]
    data: Any
    where: Location | None
    below: tuple[Expr, ...] | None
    """All expressions below in topological order, if `raymarch.expr.walk.topological` was asked for them."""

    def __repr__(self) -> str:
        if self.op == "const":
            return f"{self.type}({np.array2string(self.data, separator=', ')})"
        if self.op in ("param", "time"):
            return "time" if self.data is None else repr(self.data)
        inner = ", ".join(f"<{arg.op}: {arg.type}>" for arg in self.args)
        return f"{self.op}({inner}{f' {self.data}' if self.data is not None else ''}) -> {self.type}"

    def __reduce__(self) -> tuple[Any, ...]:
        found: tuple[Any, ...] = CALLED["reduced"](self)
        return found

    def __copy__(self) -> Expr:
        return self

    def __deepcopy__(self, memo: Any) -> Expr:
        return self

    def __bool__(self) -> bool:
        what = f"an expression ({self.op}: {self.type}) has no truth value while the scene is being built"
        words = "rm.min and rm.max in place of min and max, rm.where(condition, a, b) in place of if"
        raise SceneError(what, legal=f"use {words}, and & | ~ in place of and, or, not")

    def __float__(self) -> float:
        if self.op == "const" and self.type is FLOAT:
            return float(self.data)
        if self.type is FLOAT and (number := CALLED["number_of"](self)) is not None:
            return float(number)
        what = f"an expression ({self.op}: {self.type}) has no numeric value: it is computed for each frame or point"
        raise SceneError(what, legal="rm.sin in place of math.sin, and likewise for other functions")

    def __index__(self) -> int:
        if self.op == "const" and self.type is FLOAT and float(self.data).is_integer():
            return int(self.data)
        what = f"an expression ({self.op}: {self.type}) counts nothing while the scene is being built, as in range(...)"
        raise SceneError(what, legal="an integer of Python; node.repeat(spacing, count=...) takes a Param as count")

    def __format__(self, spec: str) -> str:
        if not spec:
            return str(self)
        if self.op == "const" and self.type is FLOAT:
            return format(float(self.data), spec)
        what = f"an expression ({self.op}: {self.type}) has no digits to format as {spec!r}: its value is not known yet"
        raise SceneError(what, legal=f"a number of Python, or f'{{...}}' without {spec!r} for its text")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """NumPy's universal functions, such as `np.sin(expr)` and `array * expr`."""
        return CALLED["universal"](ufunc.__name__, method, inputs, options)

    # Arithmetic, as in GLSL: scalars are broadcast over vectors. Comparisons give booleans; == stays identity, because
    # equal expressions are one object.
    __add__, __radd__ = _operators("add")
    __sub__, __rsub__ = _operators("sub")
    __mul__, __rmul__ = _operators("mul")
    __matmul__, __rmatmul__ = _operators("mul")
    __truediv__, __rtruediv__ = _operators("div")
    __mod__, __rmod__ = _operators("mod")
    __floordiv__, __rfloordiv__ = _operators("floordiv")
    __pow__, __rpow__ = _operators("pow")
    __lt__, __gt__ = _operators("lt")
    __le__, __ge__ = _operators("le")
    __and__ = _operators("and")[0]
    __or__ = _operators("or")[0]
    __neg__, __abs__ = _function("neg"), _function("abs")
    __round__, __floor__, __ceil__ = _function("round"), _function("floor"), _function("ceil")

    def __pos__(self) -> Expr:
        return self

    def __invert__(self) -> Expr:
        return logic("not", self)

    # Components.
    def __len__(self) -> int:
        if not self.type.is_vector:
            raise SceneError(f"a {self.type} has no components", legal="a vector")
        return self.type.size

    def __getitem__(self, index: int) -> Expr:
        n = len(self)
        if not isinstance(index, (int, np.integer)) or not -n <= index < n:
            raise SceneError(f"component {index!r} of a {self.type}", legal=f"an index from 0 to {n - 1}")
        return swizzle(self, "xyzw"[:n][index])

    def __iter__(self) -> Iterator[Expr]:
        return (self[i] for i in range(len(self)))

    x, y, z, w = _Components("x"), _Components("y"), _Components("z"), _Components("w")
    xy, yz, xz = _Components("xy"), _Components("yz"), _Components("xz")
    yx, zx, zy = _Components("yx"), _Components("zx"), _Components("zy")
    xyz, yzx, zxy = _Components("xyz"), _Components("yzx"), _Components("zxy")
    xzy, yxz, zyx = _Components("xzy"), _Components("yxz"), _Components("zyx")
    OPERAND = False

    if not TYPE_CHECKING:  # so that type checkers find wrong names

        def __getattr__(self, name: str) -> Expr:
            """Up to four components, repeated or not, as in GLSL: `p.xxy`, `color.rgb`."""
            for known in ("xyzw", "rgba"):
                if 0 < len(name) <= 4 and set(name) <= set(known):
                    return swizzle(self, name.translate(str.maketrans(known, "xyzw")))
            raise AttributeError(f"'Expr' object has no attribute {name!r}", name=name, obj=self)

    @property
    def is_constant(self) -> bool:
        return self.op == "const"


CALLED: dict[str, Callable[..., Any]] = {}
"""The functions of modules that import this one which expressions call, by name."""

F = TypeVar("F", bound=Callable[..., Any])


def called_by_expressions(function: F) -> F:
    """Decorator: let expressions find this function by its name. `raymarch.expr` imports its module."""
    CALLED[function.__name__] = function
    return function


Operand: TypeAlias = Expr | float | Sequence[Any] | NDArray[Any] | str
"""An operand: an expression, a number, a sequence of 2 to 4 of them, or a colour such as "orange"."""


class _Interned(ref[Expr]):
    """A weak reference to an expression that knows the expression's key."""

    __slots__ = ("key",)

    key: tuple[Any, ...]


_interned: dict[tuple[Any, ...], _Interned] = {}
"""All expressions by operation, type, arguments and data. A WeakValueDictionary would take twice the time."""
_interning = threading.RLock()


def _forget(dead: ref[Expr]) -> None:
    assert isinstance(dead, _Interned)
    with _interning:  # another thread may have created an equal expression in the meantime
        if _interned.get(dead.key) is dead:
            del _interned[dead.key]


def make(op: str, type: Type, args: tuple[Expr, ...] = (), data: Any = None) -> Expr:
    """The unique expression of this operation, arguments and data, without simplification (see `simplify`)."""
    key = (op, type, args, (data.tobytes(), data.dtype.char) if isinstance(data, np.ndarray) else data)
    known = _interned.get(key)
    found = None if known is None else known()
    if found is not None:
        return found
    node = object.__new__(Expr)
    node.op, node.type, node.args, node.data, node.below = op, type, args, data, None
    node.where = None if op == "const" else _creation_line()
    mine = _Interned(node, _forget)
    mine.key = key
    with _interning:  # another thread may have created it in the meantime
        known = _interned.get(key)
        found = None if known is None else known()
        if found is None:
            _interned[key] = mine
            return node
    return found


def _creation_line() -> Location | None:
    """The source line outside of this package that created the expression."""
    frame: FrameType | None = sys._getframe(2)
    while frame is not None:
        file = frame.f_code.co_filename
        if file not in _FILES:
            if not file.startswith(_HERE):
                return _location(file, frame.f_lineno)
            _FILES.add(file)
        frame = frame.f_back
    return None


_location = lru_cache(4096)(Location)
"""One object for the many expressions of a line."""


def const(value: Any, type: Type | None = None) -> Expr:
    """A constant, float64. Non-finite values are allowed here (facts use them) and refused by the GLSL printer."""
    if type is not FLOAT and np.ndim(value) == 0 and np.asarray(value).dtype == bool:
        array: NDArray[Any] = np.array(value, bool)
    else:
        array = np.array(value, np.float64)
    array.setflags(write=False)
    if type is None:
        type = _type_of_shape(array)
    return make("const", type, (), array)


def _type_of_shape(array: NDArray[Any]) -> Type:
    if array.shape == ():
        return BOOL if array.dtype == bool else FLOAT
    if array.ndim == 1 and 2 <= array.size <= 4:
        return vector(array.size)
    if array.ndim == 2 and array.shape[0] == array.shape[1] and 2 <= array.shape[0] <= 4:
        return MATRICES[array.shape[0]]
    what = f"an array of shape {array.shape} is not a value of the expression language"
    raise SceneError(what, legal="a number, a vector of 2 to 4 numbers or a square matrix")


def expr(value: Operand) -> Expr:
    """Any operand as an expression: numbers become constants, sequences that hold expressions become vectors.

    A string is a colour, encoded in sRGB; it becomes linear RGB, a vec3.
    """
    if isinstance(value, Expr):
        return value
    if isinstance(value, bool | float):
        return const(value, FLOAT if type(value) is float else None)
    if isinstance(value, tuple | list) and Expr in map(type, value):
        return construct(*value)
    if isinstance(value, str):
        return const(CALLED["linear_color"]("the colour", value))
    if isinstance(value, int | tuple | list | np.ndarray | np.generic) or hasattr(type(value), "__array__"):
        refuse_masked("a value", value)
        array = _numeric(value)
        if array is not None:
            return const(array)
    raise SceneError(
        f"{short(value)} ({type(value).__name__}) is not a number, vector or expression",
        legal="the value of the function, such as pattern(p)"
        if callable(value)
        else "a number, a sequence of 2 to 4 numbers, a colour such as 'orange', or an expression",
    )


def exprs(operands: Sequence[Operand]) -> tuple[Expr, ...]:
    """Some operands as expressions."""
    if {*map(type, operands)} == {Expr}:
        return tuple(operands)  # type: ignore[arg-type]  # the set of their types says so
    return tuple(map(expr, operands))


def _numeric(value: Any) -> NDArray[Any] | None:
    """Convert to an array. None for strings, ragged sequences, and integers that exceed float64."""
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and isinstance(value, int):
            return np.asarray(value, np.float64)
        return array if array.dtype.kind in "biuf" and array.ndim <= 2 else None
    except (TypeError, ValueError, OverflowError, SceneError):
        return None


_LINEAR = {"add", "sub", "mul", "div", "neg"}
"""Componentwise operations that GLSL also has for matrices."""


def elementwise(op: str, *operands: Operand) -> Expr:
    """A componentwise operation; scalars are broadcast over the widest operand."""
    args = exprs(operands)
    type = _widest(op, args)
    if type.is_matrix and op not in _LINEAR:
        raise SceneError(f"{op} does not take a {type}", legal="numbers and vectors")
    return simplify(op, type, args)


def _widest(op: str, args: tuple[Expr, ...]) -> Type:
    widest = FLOAT
    for arg in args:
        if arg.type is BOOL or arg.type is STATE:
            raise SceneError(f"{op} does not take a {arg.type}", legal="numbers and vectors")
        if arg.type is not FLOAT:
            if widest is not FLOAT and widest is not arg.type:
                names = ", ".join(a.type.name for a in args)
                raise SceneError(f"{op}({names}) mixes sizes", legal="operands of one size, or scalars")
            widest = arg.type
    return widest


def product(a: Operand, b: Operand) -> Expr:
    """GLSL's `*`: by component, or the linear-algebra product where a matrix takes part."""
    left, right = args = exprs((a, b))
    if not (left.type.is_matrix or right.type.is_matrix) or FLOAT in (left.type, right.type):
        return simplify("mul", _widest("mul", args), args)
    if left.type.size != right.type.size:
        raise SceneError(f"{left.type} * {right.type}: sizes differ", legal="a matrix and a vector of one size")
    if left.type.is_vector:  # v * M == transpose(M) * v
        return product(simplify("transpose", right.type, (right,)), left)
    return simplify("matmul", right.type, args)


def compare(op: str, a: Operand, b: Operand) -> Expr:
    left, right = args = exprs((a, b))
    if left.type is not FLOAT or right.type is not FLOAT:
        legal = "two scalars, such as components; rm.min and rm.max, which take vectors, in place of min and max"
        raise SceneError(f"cannot order {left.type} and {right.type}", legal=legal)
    return simplify(op, BOOL, args)


def logic(op: str, *operands: Operand) -> Expr:
    args = exprs(operands)
    for arg in args:
        if arg.type is not BOOL:
            raise SceneError(f"'{op}' needs conditions, not {arg.type}", legal="comparisons such as a < b")
    return simplify(op, BOOL, args)


def swizzle(value: Expr, components: str) -> Expr:
    """Components by name, as in GLSL: `swizzle(p, "zx")`."""
    if not value.type.is_vector or not {*"xyzw"[: value.type.size]}.issuperset(components):
        raise SceneError(f"a {value.type} has no component '{components}'", legal="x, y, z, w of a vector")
    return simplify("swizzle", vector(len(components)), (value,), components)


_COMPUTED: dict[str, Callable[[Operand, Operand], Expr]] = {
    **{op: partial(elementwise, op) for op in ("add", "sub", "div", "mod")},
    "mul": product,
    "floordiv": lambda a, b: elementwise("floor", elementwise("div", a, b)),
    "pow": lambda a, b: CALLED["power"](a, b),
    **{op: partial(compare, op) for op in ("lt", "le")},
    **{op: partial(logic, op) for op in ("and", "or")},
}
"""The functions of Python's operators."""

_PARTS = frozenset((FLOAT, *VECTORS.values()))


def construct(*parts: Operand) -> Expr:
    """vec2, vec3 or vec4 from scalars and vectors, as in GLSL."""
    args = exprs(parts)
    types = [arg.type for arg in args]
    size = sum([type.size for type in types])
    if not 2 <= size <= 4 or not _PARTS.issuperset(types):
        what = f"no vector of {', '.join(type.name for type in types)}"
        raise SceneError(what, legal="2 to 4 numbers in all, no matrices")
    return simplify("construct", vector(size), args)


def var(name: str, type: Type) -> Expr:
    """A parameter of a function, or a state variable of a loop."""
    return make("var", type, (), name)


Simplifier: TypeAlias = Callable[[str, Type, tuple[Expr, ...], Any], "Expr | None"]
_simplifiers: defaultdict[str, list[Simplifier]] = defaultdict(list)


def simplify(op: str, type: Type, args: tuple[Expr, ...], data: Any = None) -> Expr:
    """Create an expression after constant folding and removal of identities (x + 0, x * 1, ...)."""
    for arg in args:
        if arg.op != "const":
            break
    else:
        folded: Expr | None = CALLED["fold_constants"](op, type, args, data)
        if folded is not None:
            return folded
    for rule in _simplifiers[op]:
        simple = rule(op, type, args, data)
        if simple is not None:
            return simple
    return make(op, type, args, data)


def simplifier(*ops: str) -> Callable[[Simplifier], Simplifier]:
    """Register a rule that may replace a new expression of these operations by a simpler one."""

    def register(rule: Simplifier) -> Simplifier:
        for op in ops:
            _simplifiers[op].append(rule)
        return rule

    return register
