"""Methods of values that a layer above carries out, such as `scene.show()`.

The public face, `raymarch/__init__.py`, knows all layers. It states where the function of each method is, and the
method asks for it by name. So no layer knows one above it.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

_FUNCTIONS: dict[str, str] = {}


def attach(functions: dict[str, str]) -> None:
    """State the functions of methods: each name with its module and the name there, such as "raymarch.gpu:render"."""
    _FUNCTIONS.update(functions)


def carried_out_by(name: str) -> Callable[..., Any]:
    """The function of a method; its module is imported when it is first called."""
    module, _, function = _FUNCTIONS[name].partition(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found
