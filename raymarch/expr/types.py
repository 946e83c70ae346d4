"""The types of the expression language: GLSL's own, by GLSL's own names."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, eq=False)
class Type:
    """One GLSL type, which is one object. `shape` is the shape of one value in NumPy: () for a scalar, (3,) for vec3,
    (3, 3) for mat3.

    A struct has `fields`: their names and types, in order. In NumPy it is a tuple of their values.
    size : number of components along one side: 1 for scalars, n for vecn and matn.
    """

    name: str
    shape: tuple[int, ...]
    fields: tuple[tuple[str, Type], ...] = ()
    is_vector: bool = field(init=False)
    is_matrix: bool = field(init=False)
    size: int = field(init=False)

    def __post_init__(self) -> None:
        for name, value in (
            ("is_vector", len(self.shape) == 1),
            ("is_matrix", len(self.shape) == 2),
            ("size", self.shape[0] if self.shape else 1),
        ):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return self.name


BOOL = Type("bool", ())
FLOAT = Type("float", ())
VEC2, VEC3, VEC4 = (Type(f"vec{n}", (n,)) for n in (2, 3, 4))
MAT2, MAT3, MAT4 = (Type(f"mat{n}", (n, n)) for n in (2, 3, 4))
STATE = Type("state", ())
"""The value of a loop: a tuple of results, accessed by `item`. It has no GLSL type."""

TYPES = (BOOL, FLOAT, VEC2, VEC3, VEC4, MAT2, MAT3, MAT4, STATE)
VECTORS = {2: VEC2, 3: VEC3, 4: VEC4}
MATRICES = {2: MAT2, 3: MAT3, 4: MAT4}


_structs: dict[tuple[str, tuple[tuple[str, Type], ...]], Type] = {}


def struct(name: str, fields: tuple[tuple[str, Type], ...]) -> Type:
    """The one type of a struct with these fields."""
    return _structs.setdefault((name, fields), Type(name, (), fields))


def vector(size: int) -> Type:
    """FLOAT for 1, else the vector type of that many components (2 to 4)."""
    return FLOAT if size == 1 else VECTORS[size]
