"""Float textures keep what is written, top row first, and give their memory back."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from raymarch.errors import DeviceError, SceneError
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import PingPong, Target

COORDINATES = """#version 330 core
layout(location = 0) out vec4 place;
layout(location = 1) out vec4 other;
void main() { place = vec4(gl_FragCoord.xy, -1.5, 1e20); other = -place; }
"""


def test_row_zero_is_the_top(context: Context) -> None:
    program = Program(context, FULL_SCREEN, COORDINATES, lambda line: ("test", None), "test")
    with program, Target(context, (5, 3), attachments=2) as target:
        program.draw(target, {})
        place, other = target.read(0), target.read(1)
    assert place.shape == (3, 5, 4) and place.dtype == np.float32 and place.flags.c_contiguous
    assert place[:, 0, 1].tolist() == [2.5, 1.5, 0.5]  # gl_FragCoord.y counts from the bottom
    assert place[0, :, 0].tolist() == [0.5, 1.5, 2.5, 3.5, 4.5]
    assert np.all(place[..., 2] == -1.5) and np.all(place[..., 3] == np.float32(1e20))
    assert np.array_equal(other, -place)


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (640, 3)])
def test_what_is_written_is_read(context: Context, size: tuple[int, int]) -> None:
    values = np.random.default_rng(1).normal(size=(size[1], size[0], 4)).astype(np.float32) * 1e6
    values[0, 0] = (np.inf, -np.inf, np.nan, 1e-30)
    with Target(context, size, attachments=2) as target:
        target.clear((1.0, 2.0, 3.0, 4.0))
        target.write(values, attachment=1)
        assert np.array_equal(target.read(1), values, equal_nan=True)
        assert np.all(target.read(0) == (1.0, 2.0, 3.0, 4.0))


def test_a_sampler_sees_the_same_rows(context: Context) -> None:
    copy = """#version 330 core
    uniform sampler2D source;
    out vec4 color;
    void main() { color = texelFetch(source, ivec2(gl_FragCoord.xy), 0); }
    """
    values = np.arange(3 * 4 * 4, dtype=np.float32).reshape(3, 4, 4)
    program = Program(context, FULL_SCREEN, copy, lambda line: ("test", None), "copy")
    with program, Target(context, (4, 3)) as source, Target(context, (4, 3)) as target:
        source.write(values)
        program.draw(target, {"source": source})
        assert np.array_equal(target.read(), values)


def test_sampling_takes_the_nearest_texel_and_clamps(context: Context) -> None:
    look = """#version 330 core
    uniform sampler2D source;
    uniform vec2 at;
    out vec4 color;
    void main() { color = texture(source, at); }
    """
    program = Program(context, FULL_SCREEN, look, lambda line: ("test", None), "look")
    with program, Target(context, (2, 1)) as source, Target(context, (1, 1)) as target:
        source.write([[[1.0] * 4, [2.0] * 4]])
        seen = []
        for x in (-3.0, 0.1, 0.49, 0.51, 0.9, 3.0):
            program.draw(target, {"source": source, "at": (x, 0.5)})
            seen.append(float(target.read()[0, 0, 0]))
    assert seen == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]


def test_half_floats_round(context: Context) -> None:
    with Target(context, (2, 2), dtype="f2") as target:
        target.write(np.float32(1.0 + 2.0**-12))
        assert np.all(target.read() == 1.0) and target.read().dtype == np.float32


@pytest.mark.parametrize(
    "size", [(0, 4), (4, 0), (-1, 4), (1.5, 4), ("4", 4), (True, 4), (4,), 4, (4, 4, 4), (4, 10**9)]
)
def test_an_illegal_size_is_refused_with_the_range(egl: Context, size: Any) -> None:
    fault = DeviceError if isinstance(size, tuple) and 10**9 in size else SceneError
    with pytest.raises(fault, match=r"an integer from 1 to \d+|\(width, height\)"):
        Target(egl, size)


def test_numpy_integers_are_sizes(egl: Context) -> None:
    with Target(egl, (np.int64(3), np.int32(2))) as target:  # type: ignore[arg-type]
        assert target.size == (3, 2) and type(target.size[0]) is int


@pytest.mark.parametrize("attachments", [0, 1000, 1.0])
def test_an_illegal_number_of_attachments_is_refused(egl: Context, attachments: Any) -> None:
    fault = DeviceError if attachments == 1000 else SceneError
    with pytest.raises(fault, match=rf"attachments = .*from 1 to {egl.limits.color_attachments}"):
        Target(egl, (2, 2), attachments)


def test_only_floats(egl: Context) -> None:
    with pytest.raises(DeviceError, match="'f4' or 'f2'"):
        Target(egl, (2, 2), dtype="f1")


def test_an_attachment_that_is_not_there(egl: Context) -> None:
    with Target(egl, (2, 2)) as target:
        for attachment in (-1, 1):
            with pytest.raises(IndexError):
                target.read(attachment)


class Exhausted:
    """A moderngl context of a device without memory."""

    error = "GL_OUT_OF_MEMORY"

    def __init__(self, gl: moderngl.Context) -> None:
        self.gl = gl

    def __getattr__(self, name: str) -> Any:
        return getattr(self.gl, name)


def test_memory_that_the_device_does_not_have_is_an_error(egl: Context, monkeypatch: Any) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(egl, "gl", Exhausted(egl.gl))
        with pytest.raises(DeviceError, match=r"2 x 8 x 4 RGBA texels of type f4: the device is out of memory"):
            Target(egl, (8, 4), attachments=2)


def test_a_framebuffer_that_the_driver_refuses_is_an_error(egl: Context, monkeypatch: Any) -> None:
    def fail(*_: object, **__: object) -> None:
        raise moderngl.Error("the framebuffer is not complete")

    monkeypatch.setattr(egl.gl, "framebuffer", fail)
    with pytest.raises(DeviceError, match=r"1 x 8 x 4 RGBA texels of type f4: the framebuffer is not complete"):
        Target(egl, (8, 4))


def test_a_released_target_says_so(context: Context) -> None:
    target = Target(context, (2, 2))
    target.release()
    target.release()
    for use in (target.read, target.clear, lambda: target.textures):
        with pytest.raises(DeviceError, match="released"):
            use()


def test_release_frees_in_its_own_context(egl: Context) -> None:
    """GL numbers textures from 1 in each context: freed under another context, the number hits that one's texture."""
    with open_context("egl") as one, open_context("egl") as two:
        first, second = Target(one, (2, 2)), Target(two, (2, 2))
        assert first.textures[0].glo == second.textures[0].glo
        second.clear((5.0, 5.0, 5.0, 5.0))
        first.release()
        assert np.all(second.read() == 5.0)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_release_gives_the_memory_back(egl: Context) -> None:
    def resident() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

    def use() -> None:
        with PingPong(egl, (512, 512), attachments=2) as pair:
            pair.front.clear((1.0,) * 4)  # texels are resident from the first write on
            pair.back.clear((1.0,) * 4)
            egl.finish()

    use()
    before = resident()
    for _ in range(20):
        use()  # 16 MiB each
    assert resident() - before < 80


def test_ping_pong_swaps(context: Context) -> None:
    step = """#version 330 core
    uniform sampler2D before;
    out vec4 color;
    void main() { color = texelFetch(before, ivec2(gl_FragCoord.xy), 0) * 2.0 + 1.0; }
    """
    program = Program(context, FULL_SCREEN, step, lambda line: ("test", None), "step")
    with program, PingPong(context, (3, 2)) as pair:
        assert pair.size == (3, 2)
        pair.front.clear()
        for _ in range(5):
            program.draw(pair.back, {"before": pair.front})
            pair.swap()
        assert np.all(pair.front.read() == 31.0) and np.all(pair.back.read() == 15.0)
    assert pair.front.released and pair.back.released
