"""What tests need of the machine: CI fails where it is missing, other machines skip the test."""

from __future__ import annotations

import os
import shutil
from typing import NoReturn

import pytest

from raymarch.errors import DeviceError
from raymarch.gpu.context import Context, open_context


def skip_or_fail(reason: str) -> NoReturn:
    """CI installs all that is needed, so there a missing piece is a fault; a user's machine may lack it."""
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


def opened(backend: str) -> Context:
    """A context of a backend."""
    try:
        return open_context(backend)
    except DeviceError as error:
        skip_or_fail(str(error))


def needs_extension(context: Context, name: str) -> None:
    """Skip the test where the driver lacks an extension; CI's driver has each that is asked for."""
    if name not in context.gl.extensions:
        pytest.skip(f"{context} has no {name}")


def glslang() -> str:
    """The path of the reference compiler."""
    return shutil.which("glslangValidator") or skip_or_fail(
        "glslangValidator is not installed: install the package glslang-tools"
    )
