"""What equal nodes have in common, and what is known of them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakValueDictionary

from raymarch.errors import SceneError
from raymarch.expr.convert import short

if TYPE_CHECKING:
    from raymarch.sdf.node import Node

T = TypeVar("T")


class Same:
    """What equal nodes have in common: one object, so that trees of any depth are compared at once.

    known : answers about such a node, by the function that gave each.
    """

    __slots__ = ("__weakref__", "key", "known")

    def __init__(self, key: tuple[Any, ...]) -> None:
        self.key = key
        self.known: dict[Callable[..., Any], Any] = {}


_known: WeakValueDictionary[tuple[Any, ...], Same] = WeakValueDictionary()
_knowing = threading.Lock()


def same(*key: Any) -> Same:
    """The one object for a definition, what the children have in common, the parameters and the label."""
    with _knowing:  # two threads must not make two
        try:
            found = _known.get(key)
        except TypeError:
            raise SceneError(f"material = {short(key[-1])}", legal="Material(...)") from None
        if found is None:
            _known[key] = found = Same(key)
    return found


def remembered(function: Callable[[Node], T]) -> Callable[[Node], T]:
    """Decorator: the answer about a node is kept as long as an equal node lives.

    A plan asks often, and a tree may have thousands of nodes.
    """

    @wraps(function)
    def answer(node: Node) -> T:
        known = node._same.known
        if function not in known:
            known[function] = function(node)
        found: T = known[function]
        return found

    return answer
