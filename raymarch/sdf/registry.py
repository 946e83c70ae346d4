"""The functions that a node offers as methods, by name.

An operator's module imports `Node`, so `Node` cannot import the operator. Operators register themselves here when they
are defined, and the methods of `Node` look them up. Nothing else is dynamic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

METHODS: dict[str, Callable[..., Any]] = {}


def method(function: F) -> F:
    """Decorator: let nodes offer this function as the method of the same name."""
    METHODS[function.__name__] = function
    return function
