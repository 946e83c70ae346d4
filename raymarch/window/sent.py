"""Objects on their way from one process of the window to the other: a scene, so that its file runs in one of them
alone, and what is known of its lights."""

from __future__ import annotations

import base64
import pickle
from typing import Any, TypeVar

T = TypeVar("T")


def packed(given: object) -> str | None:
    """An object as text. None if it cannot be sent, such as a scene with a class that its own file defines."""
    try:
        return base64.b64encode(pickle.dumps(given, pickle.HIGHEST_PROTOCOL)).decode()
    except Exception:  # of the user's classes, any
        return None


def unpacked(text: str | None, kind: type[T]) -> T | None:
    """The object of a text; None if it cannot be made here, or is of another kind."""
    if text is None:
        return None
    try:
        found: Any = pickle.loads(base64.b64decode(text))
    except Exception:
        return None
    return found if isinstance(found, kind) else None
