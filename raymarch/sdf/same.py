"""What equal nodes have in common."""

from __future__ import annotations

import threading
from typing import Any
from weakref import WeakValueDictionary

from raymarch.errors import SceneError
from raymarch.expr.convert import short


class Same:
    """What equal nodes have in common: one object, so that trees of any depth are compared at once."""

    __slots__ = ("__weakref__", "key")

    def __init__(self, key: tuple[Any, ...]) -> None:
        self.key = key


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
