"""Errors of the device during a frame, with the name of the pass."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from raymarch.errors import DeviceError


@contextmanager
def in_pass(*names: str) -> Iterator[None]:
    """Convert a failure of the driver (out of memory, a lost context) to a DeviceError that names the passes.

    A DeviceError that the driver caused and that names no pass yet gets the names; invalid input of the user does not.
    """
    what = f"pass {' and '.join(names)}"
    try:
        yield
    except moderngl.Error as error:
        raise DeviceError(f"{what}: the device failed: {error}", legal="less memory, or a new Renderer") from error
    except DeviceError as error:
        if not isinstance(error.__cause__, moderngl.Error) or error.what.startswith("pass "):
            raise
        raise DeviceError(f"{what}: {error.what}", legal=error.legal, where=error.where) from error.__cause__
