"""A WebGPU device in a process of its own: its driver changes the floating-point state of a process that loads it."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


class Device:
    """Compiles WGSL by naga, and runs it. A context."""

    def __init__(self) -> None:
        self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._pool.shutdown()

    @property
    def present(self) -> bool:
        return self._pool.submit(_present).result()

    def refused(self, code: str) -> str:
        """The compiler's message; empty if it takes the code."""
        return self._pool.submit(_compile, code).result()

    def compute(self, code: str, given: NDArray[np.float32]) -> NDArray[np.float32]:
        """What a shader makes of vec4s, (N, 4), by groups of 64."""
        return self._pool.submit(_compute, code, given).result()


@cache
def _adapters() -> list[Any]:
    import wgpu

    return list(wgpu.gpu.enumerate_adapters_sync())


@cache
def _device() -> Any:
    return _adapters()[0].request_device_sync()


def _present() -> bool:
    return bool(_adapters())


def _compile(code: str) -> str:
    try:
        _device().create_shader_module(code=code)
    except Exception as error:
        return str(error) or type(error).__name__
    return ""


def _compute(code: str, given: NDArray[np.float32]) -> NDArray[np.float32]:
    from wgpu.utils.compute import compute_with_buffers

    made = compute_with_buffers({0: given}, {1: (given.size, "f")}, code, n=len(given) // 64)
    return np.frombuffer(made[1], np.float32).reshape(-1, 4)
