"""The labels (materials) of a tree of nodes: which are visible, and how to replace them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import is_
from typing import Any

from raymarch.sdf.node import Node, folded, replaced


def flattened(node: Node) -> list[Node]:
    """The children of a node; nested nodes of the same kind and parameters are replaced by their children."""
    flat: list[Node] = []
    pending = [node]
    while pending:
        each = pending.pop()
        if each.label is None and each.definition is node.definition and each.params == node.params:
            pending.extend(reversed(each.children))
        else:
            flat.append(each)
    return flat


def operands_of(node: Node) -> Sequence[Node]:
    """The children of a node; for an associative one, `flattened`."""
    return flattened(node) if node.definition.associative else node.children


def rows_of(node: Node) -> Any:
    """The rows of a node that is many objects; None for any other node."""
    return node.params.get("rows") if node.definition.arity == "none" else None


def cutting(children: Sequence[Node]) -> Sequence[Node]:
    """The operands of a cut that decide the material: a subtracted solid without a material is left out."""
    return [child for child in children if child.labelled] if children[0].labelled else children


def seen_labels(root: Node, outer: Any = None) -> set[Any]:
    """The labels of all visible parts. Of nested labels, the innermost applies. outer : of parts without one."""
    found: set[Any] = set()
    visited: set[tuple[Node, Any]] = set()
    pending: list[tuple[Node, Any]] = [(root, outer)]
    while pending:
        node, label = each = pending.pop()
        if each in visited:
            continue
        visited.add(each)
        if node.label is not None:
            pending.append((node.children[0], node.label))
        elif not node.labelled:
            found.add(label)
        elif (rows := rows_of(node)) is not None:
            found.update(label if material is None else material for material in rows.labels)
        else:
            children = operands_of(node)
            pending += [(child, label) for child in (cutting(children) if node.definition.cuts else children)]
    return found - {None}


def relabelled(root: Node, change: Callable[[Any], Any]) -> Node:
    """The same solid with labels mapped by a function. Shared nodes stay shared."""

    def made(node: Node, children: list[Node]) -> Node:
        label = None if node.label is None else change(node.label)
        rows = rows_of(node)
        if rows is not None and rows.labelled:
            return replaced(node, (), {"rows": rows.relabelled(change)})
        if all(map(is_, children, node.children)) and label is node.label:
            return node
        return replaced(node, tuple(children), label=label)

    return folded(root, made)
