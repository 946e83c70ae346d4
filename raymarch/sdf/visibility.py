"""Visibility by kind of ray: solids that are hidden from camera, shadow or reflection rays."""

from __future__ import annotations

from typing import Annotated, Any

from raymarch.expr.node import Expr, const, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import where
from raymarch.sdf.definition import Child, definition_of, operator
from raymarch.sdf.domain import Domain
from raymarch.sdf.node import Node, all_nodes, method
from raymarch.sdf.regions import Motion

KINDS = ("camera", "shadow", "reflection")
"""The kinds of rays. Their numbers in a shader are their positions here."""

RAY_KIND = var("ray_kind", FLOAT)
"""The number of the kind of the present ray, a variable of the shader."""

FAR_AWAY = 1e17
"""The distance to a solid that is hidden. Its square is finite in float32."""

Switch = Annotated[bool, Domain(None, holds=bool)]


@method
@operator(
    exactness="exact",
    symmetry="keep",
    convex=lambda child: child.convex,
    placing=lambda child, camera, shadow, reflection: "rigid" if camera and shadow and reflection else "select",
    motion=lambda child: Motion(turns=False),
)
def visible(p: Expr, child: Child, camera: Switch = True, shadow: Switch = True, reflection: Switch = True) -> Expr:
    """Hide a solid from kinds of rays: for these it is empty space.

    camera : visible to rays from the camera.
    shadow : casts shadows. Rays of ambient occlusion count as shadow rays.
    reflection : visible to rays that start at surfaces: reflections, refractions and indirect light.

    `distance`, meshes and arrays such as depth show what camera rays see. Inside of another hidden solid both apply.
    """
    return child(p)


def hidden_from(node: Node) -> list[str]:
    """The kinds of rays that a node itself is hidden from."""
    if node.definition is not definition_of(visible):
        return []
    return [kind for kind in KINDS if not node.params[kind]]


def hiding_nodes(root: Node) -> list[Node]:
    """The nodes of a tree that hide something."""
    return [node for node in all_nodes(root) if hidden_from(node)]


def shown(node: Node, value: Expr, rays: str | None) -> Expr:
    """The field of a node for a kind of ray; None for a field that reads RAY_KIND."""
    hidden = hidden_from(node)
    if not hidden or (rays is not None and rays not in hidden):
        return value
    if rays is not None or len(hidden) == len(KINDS):
        return const(FAR_AWAY)
    numbers = [KINDS.index(kind) for kind in hidden]
    if numbers == [1]:
        return where((RAY_KIND > 0.5) & (RAY_KIND < 1.5), FAR_AWAY, value)
    if numbers == [0, 2]:
        return where((RAY_KIND > 0.5) & (RAY_KIND < 1.5), value, FAR_AWAY)
    first = numbers[-1] + 0.5 > RAY_KIND if numbers[0] == 0 else numbers[0] - 0.5 < RAY_KIND
    return where(first, FAR_AWAY, value)


def labels_hidden_from(root: Node, kind: str) -> set[Any]:
    """The labels of parts that are hidden from a kind of ray. Of nested labels, the innermost applies."""
    found: set[Any] = set()
    pending: list[tuple[Node, Any, bool]] = [(root, None, False)]
    visited = set(pending)
    while pending:
        node, label, hidden = pending.pop()
        below = (node.label or label, hidden or kind in hidden_from(node))
        if not node.children and below[1]:
            found.add(below[0])
        new = [(child, *below) for child in node.children if (child, *below) not in visited]
        visited.update(new)
        pending += new
    return found - {None}
