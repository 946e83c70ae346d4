"""What a refusal must say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from raymarch.errors import Location, RaymarchError, SceneError


def refused(make: Callable[[], Any], *words: str, error: type[RaymarchError] = SceneError) -> RaymarchError:
    """`make`, a lambda on one line of a test file, is refused: the message holds all words and names that line."""
    with pytest.raises(error) as caught:
        make()
    code = make.__code__
    message = str(caught.value)
    assert caught.value.where == Location(code.co_filename, code.co_firstlineno), message
    assert message.startswith(f"{code.co_filename}:{code.co_firstlineno}: ")
    assert "\n" not in message
    for word in words:
        assert word in message
    assert caught.value.legal, f"no legal range: {message}"
    return caught.value
