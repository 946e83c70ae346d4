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

    def draw(self, spirv: tuple[bytes, bytes], inputs: bytes, size: tuple[int, int]) -> NDArray[np.uint8]:
        """The picture (H, W, 3) of a vertex and a pixel shader in SPIR-V. inputs : the content of their buffer."""
        return self._pool.submit(_draw, spirv, inputs, size).result()


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


def _draw(spirv: tuple[bytes, bytes], inputs: bytes, size: tuple[int, int]) -> NDArray[np.uint8]:
    import wgpu

    device, form = _device(), wgpu.TextureFormat.rgba8unorm
    vertex, pixel = (device.create_shader_module(code=code) for code in spirv)
    usage = wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.COPY_SRC
    target = device.create_texture(size=(*size, 1), format=form, usage=usage)
    buffer = device.create_buffer_with_data(data=inputs, usage=wgpu.BufferUsage.UNIFORM)
    kind = {"binding": 0, "visibility": wgpu.ShaderStage.FRAGMENT, "buffer": {"type": "uniform"}}
    layout = device.create_bind_group_layout(entries=[kind])
    bound = device.create_bind_group(layout=layout, entries=[{"binding": 0, "resource": {"buffer": buffer}}])
    pipeline = device.create_render_pipeline(
        layout=device.create_pipeline_layout(bind_group_layouts=[layout]),
        vertex={"module": vertex, "entry_point": "full_screen"},
        fragment={"module": pixel, "entry_point": "main", "targets": [{"format": form}]},
        primitive={"topology": "triangle-list"},
    )
    encoder = device.create_command_encoder()
    attached = {"view": target.create_view(), "load_op": "clear", "store_op": "store", "clear_value": (0, 0, 0, 0)}
    drawing = encoder.begin_render_pass(color_attachments=[attached])
    drawing.set_pipeline(pipeline)
    drawing.set_bind_group(0, bound)
    drawing.draw(3)
    drawing.end()
    device.queue.submit([encoder.finish()])
    width, height = size
    read = device.queue.read_texture({"texture": target}, {"bytes_per_row": 4 * width}, (width, height, 1))
    return np.frombuffer(read, np.uint8).reshape(height, width, 4)[..., :3].copy()
