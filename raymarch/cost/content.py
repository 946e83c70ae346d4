"""A content hash of a scene: two scenes of the same content have the same reference picture."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np

from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr
from raymarch.expr.samples import Samples
from raymarch.expr.texels import Texels
from raymarch.expr.walk import topological
from raymarch.files import sources
from raymarch.scene.material import Material
from raymarch.scene.parameter import Spec
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import Lowering
from raymarch.sdf.rows import Rows

PACKAGES = ("expr", "sdf", "scene", "truth")
"""Packages whose code determines the reference of a scene."""

MARCHING = set(
    "tracer max_steps epsilon normals omega beta step_scale step_variation schedule refinement assume_certified "
    "samples edges temporal steps_per_pass lights_per_pass rays shadow_steps light_samples".split()
)
"""Fields of Quality that do not change the reference. The reference depends on all others, such as a shading model."""

_IGNORED = {"where", "quality", "node"}
"""Attributes that the reference does not depend on, or that are hashed in another form (the node by its field)."""


def content_key(scene: Scene, *more: Any) -> str:
    """Digest of everything that determines a scene's reference: content, `more` (size, time, parameters), and code.

    Source locations of nodes and marching options of the quality do not count.
    """
    content = _Content()
    content.add("code", code_key())
    marked = Lowering(objects=_Instances()).field(scene.node, label=scene.materials[0])
    facts = scene.node.facts
    content.add("field", marked, facts.exactness, facts.lower, facts.upper)
    for name in sorted(_attributes(scene)):
        content.add(name, getattr(scene, name))
    content.add(
        "quality", *((f.name, getattr(scene.quality, f.name)) for f in fields(Quality) if f.name not in MARCHING)
    )
    if any(m.textured for m in scene.materials):
        content.add("footprint", scene.quality.footprint)
    content.add("more", *more)
    return content.key


@dataclass(frozen=True, eq=False)
class _Label:
    """The materials of instances: those of the solid, with its marks, and those by instance."""

    marked: Function
    transforms: Any
    materials: Any
    expressions: tuple[Expr, ...] = ()


class _Instances:
    """Instances with all their materials as one part; see `raymarch.sdf.lower.Objects`."""

    def distance(self, rows: Rows) -> Function:
        return rows.field

    def label(self, rows: Rows, inherited: Any) -> _Label:
        node, transforms, materials = rows.origin[1:]
        return _Label(Lowering(objects=self).field(node, label=inherited), transforms, materials)


@cache
def code_key() -> str:
    """Digest of the code that computes references, so that a change of the code invalidates the cache."""
    code = hashlib.sha256(np.__version__.encode())
    for name, content in sources(*PACKAGES, "cost/reference.py"):
        code.update(name.encode() + content)
    return code.hexdigest()


def _attributes(part: Any) -> list[str]:
    if isinstance(part, Material):
        return ["expressions"]
    slots = [name for kind in type(part).__mro__ for name in getattr(kind, "__slots__", ())]
    own = list(getattr(part, "__dict__", ()))
    return [name for name in dict.fromkeys(slots + own) if not name.startswith("__") and name not in _IGNORED]


class _Content:
    """Incremental digest. Shared expressions are numbered, so the cost of a graph is linear in its nodes."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._numbers: dict[Any, int] = {}

    @property
    def key(self) -> str:
        return self._hash.hexdigest()

    def add(self, *parts: Any) -> None:
        for part in parts:
            self._add(part)
            self._text(";")

    def _text(self, text: str) -> None:
        self._hash.update(text.encode())

    def _add(self, part: Any) -> None:
        match part:
            case None | bool() | int() | float() | str() | bytes():
                self._text(f"{type(part).__name__} {part!r}")
            case np.ndarray():
                self._text(f"array {part.dtype} {part.shape}")
                self._hash.update(np.ascontiguousarray(part).tobytes())
            case np.generic():
                self._text(f"number {part!r}")
            case Expr():
                self._expression(part)
            case Function():
                self._once(part, "function", *part.params, part.body)
            case Loop():
                self._once(part, "loop", part.count, part.index, *part.state, *part.captured, *part.step, part.until)
            case Samples() | Texels():
                self._text(f"samples {part.key}")
            case Spec():
                self._text(f"parameter {part.name} {part.value!r} {part.min!r} {part.max!r}")
            case Mapping():
                self.add("mapping", len(part), *(item for pair in sorted(part.items()) for item in pair))
            case tuple() | list():
                self.add("sequence", len(part), *part)
            case _:
                self._once(part, type(part).__name__, *((n, getattr(part, n)) for n in sorted(_attributes(part))))

    def _once(self, part: Any, *content: Any) -> None:
        """Add a part that may occur again; later occurrences add its number only."""
        if part in self._numbers:
            self._text(f"again {self._numbers[part]}")
            return
        self._numbers[part] = len(self._numbers)
        self.add(*content)

    def _expression(self, root: Expr) -> None:
        for node in topological([root]):
            if node in self._numbers:
                continue
            arguments = " ".join(str(self._numbers[arg]) for arg in node.args)
            self._text(f"{node.op} {node.type.name} {arguments} ")
            self._add(node.data)
            self._numbers[node] = len(self._numbers)
        self._text(f"is {self._numbers[root]}")
