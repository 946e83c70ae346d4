"""A scene on its way from one process of the window to the other, so that its file runs in one of them alone."""

from __future__ import annotations

import base64
import pickle
from typing import Any

from raymarch.scene.scene import Scene


def packed(scene: Scene) -> str | None:
    """The scene as text. None if it cannot be sent, such as one with a class that its own file defines."""
    try:
        return base64.b64encode(pickle.dumps(scene, pickle.HIGHEST_PROTOCOL)).decode()
    except Exception:  # of the user's classes, any
        return None


def unpacked(text: str | None) -> Scene | None:
    """The scene of a text; None if it cannot be made here."""
    if text is None:
        return None
    try:
        found: Any = pickle.loads(base64.b64decode(text))
    except Exception:
        return None
    return found if isinstance(found, Scene) else None
