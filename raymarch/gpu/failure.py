"""What the device answers in the middle of a frame, as an error that names the pass."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from raymarch.errors import DeviceError


@contextmanager
def in_pass(*names: str) -> Iterator[None]:
    """Where the driver fails (out of memory, a lost context) while it works for some passes: DeviceError, their names.

    Errors that the driver caused and that do not name a pass yet get the name; what a user asked for wrongly does not.
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
