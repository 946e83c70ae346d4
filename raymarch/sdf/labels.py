"""The labels of a tree of nodes: which are seen, and the same tree with others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from raymarch.sdf.node import Node


def seen_labels(root: Node) -> list[Any]:
    """The labels that some part of the solid has: of labels on each other, a part has the innermost."""
    found: dict[Any, None] = {}
    visited: set[tuple[Node, Any]] = set()
    pending: list[tuple[Node, Any]] = [(root, None)]
    while pending:
        node, label = pending.pop()
        label = label if node.label is None else node.label
        if (node, label) in visited:
            continue
        visited.add((node, label))
        if not node.children and label is not None:
            found[label] = None
        pending += [(child, label) for child in reversed(node.children)]
    return list(found)


def relabelled(root: Node, change: Callable[[Any], Any]) -> Node:
    """The same solid, its labels replaced by what a function makes of them. What is asked twice stays one node."""
    made: dict[Node, Node] = {}
    pending = [root]
    while pending:
        node = pending[-1]
        waiting = [child for child in node.children if child not in made]
        if waiting:
            pending += waiting
            continue
        pending.pop()
        children = tuple(made[child] for child in node.children)
        label = None if node.label is None else change(node.label)
        if children == node.children and label is node.label:
            made[node] = node
        else:
            made[node] = Node(node.definition, children, node.params, node.facts, label)
            made[node].where = node.where
    return made[root]
