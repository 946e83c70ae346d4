"""What a refusal must say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from raymarch.errors import RaymarchError, SceneError


def refused(make: Callable[[], Any], *words: str, error: type[RaymarchError] = SceneError) -> RaymarchError:
    """`make`, a lambda of a test file, is refused: the message is one line, has all words and names a line of `make`.

    The words are the value and the legal range; the error has the range as `legal` too.
    """
    with pytest.raises(error) as caught:
        make()
    code, message = make.__code__, str(caught.value)
    where = caught.value.where
    assert where is not None, message
    assert where.file == code.co_filename, message
    assert where.line in {line for _, _, line in code.co_lines()}, message
    assert message.startswith(f"{where.file}:{where.line}: ")
    assert "\n" not in message
    for word in words:
        assert word in message
    assert caught.value.legal, f"no legal range: {message}"
    return caught.value
