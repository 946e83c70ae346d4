"""Contexts open, say what they are, live side by side and go without a trace."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
import pytest

from raymarch.errors import DeviceError
from raymarch.gpu import context as module
from raymarch.gpu.context import BACKENDS, Context, open_context
from raymarch.gpu.targets import Target

Interpreter = Callable[[str, str | None], str]


def painted(context: Context, value: float) -> Target:
    target = Target(context, (4, 3))
    target.clear((value, value, value, value))
    return target


def test_says_who_draws_and_what_is_allowed(context: Context) -> None:
    assert context.driver.renderer and context.driver.vendor and context.driver.version
    assert context.gl.version_code >= 330
    # The least that OpenGL 3.3 promises.
    assert context.limits.texture_size >= 1024 and min(context.limits.viewport) >= 1024
    assert context.limits.fragment_uniform_components >= 1024
    assert context.limits.fragment_uniform_vectors >= 224
    assert context.limits.texture_units >= 16 and context.limits.color_attachments >= 8
    assert context.backend in context.why
    assert context.driver.is_software == ("llvmpipe" in context.driver.renderer)


def test_contexts_live_side_by_side_in_one_process(egl: Context, osmesa: Context) -> None:
    with open_context("egl") as second, open_context("osmesa") as third:
        contexts = [egl, osmesa, second, third]
        targets = [painted(context, float(i)) for i, context in enumerate(contexts)]
        # Back and forth, because the mix-up needs a context that its library still believes current.
        for i in (0, 1, 0, 2, 1, 2, 3, 0, 3, 1):
            assert np.all(targets[i].read() == i), contexts[i]
            with contexts[i].bound():
                assert contexts[i].gl.error == "GL_NO_ERROR"
        for target in targets:
            target.release()


def test_releasing_one_context_leaves_the_others(egl: Context, osmesa: Context) -> None:
    kept = [painted(egl, 1.0), painted(osmesa, 2.0)]
    for backend in ("egl", "osmesa"):
        passing = open_context(backend)
        orphan = painted(passing, 9.0)
        passing.release()
        orphan.release()  # its texture's number may name a texture of the context that is current now
        assert [target.read()[0, 0, 0] for target in kept] == [1.0, 2.0]
    for target in kept:
        target.release()


def test_releasing_a_context_that_is_not_current_leaves_the_current_one(egl: Context, osmesa: Context) -> None:
    passing = open_context("osmesa")
    target = painted(egl, 3.0)
    with egl.bound():
        passing.release()
        assert target.framebuffer.read(components=1, dtype="f4")[:4] == np.float32(3.0).tobytes()
    target.release()


def test_a_released_context_says_so(egl: Context) -> None:
    passing = open_context("egl")
    passing.release()
    passing.release()
    assert passing.released and "released" in repr(passing)
    with pytest.raises(DeviceError, match="egl context was released"):
        passing.check()


def test_many_contexts_one_after_another(egl: Context, osmesa: Context) -> None:
    for backend in ("osmesa", "egl") * 5:
        with open_context(backend) as context:
            painted(context, 1.0)


@pytest.mark.parametrize("backend", ["vulkan", "", "EGL"])
def test_an_unknown_backend_is_refused_with_the_legal_names(backend: str) -> None:
    with pytest.raises(DeviceError, match="auto, egl, osmesa, window") as caught:
        open_context(backend)
    assert repr(backend) in str(caught.value)


@pytest.mark.parametrize("device", [-1, 1.0, "0", True])
def test_a_device_is_a_number(device: Any) -> None:
    with pytest.raises(DeviceError, match="integer >= 0"):
        open_context("egl", device=device)


def test_only_egl_has_devices() -> None:
    with pytest.raises(DeviceError, match="only egl has devices"):
        open_context("osmesa", device=0)


def test_the_device_comes_from_the_argument_then_from_the_environment(egl: Context, monkeypatch: Any) -> None:
    monkeypatch.setenv("RAYMARCH_EGL_DEVICE", "77")
    with pytest.raises(DeviceError, match=r"77.*RAYMARCH_EGL_DEVICE"):
        open_context("egl")
    open_context("egl", device=0).release()
    monkeypatch.setenv("RAYMARCH_EGL_DEVICE", "first")
    with pytest.raises(DeviceError, match="'first' is no device number"):
        open_context("egl")


def test_auto_with_a_device_is_that_device_or_nothing(egl: Context, monkeypatch: Any) -> None:
    with pytest.raises(DeviceError, match="another EGL device"):
        open_context("auto", device=77)
    open_context("auto", device=0).release()
    monkeypatch.setenv("RAYMARCH_EGL_DEVICE", "77")
    with pytest.raises(DeviceError, match="another EGL device"):
        open_context("auto")


def test_auto_takes_egl_and_says_why(egl: Context) -> None:
    with open_context() as context:
        assert context.backend == "egl" and "first that works" in context.why


def test_auto_goes_on_to_osmesa_and_says_what_egl_answered(osmesa: Context, monkeypatch: Any) -> None:
    monkeypatch.setenv("GLCONTEXT_LINUX_LIBEGL", "/nowhere/libEGL.so")
    with open_context("auto") as context:
        assert context.backend == "osmesa"
        assert "egl: /nowhere/libEGL.so not loaded" in context.why


def test_no_backend_at_all_names_every_answer_and_every_package(monkeypatch: Any) -> None:
    def refuse(*, offscreen: bool, shown: object) -> None:
        raise DeviceError("no library" if offscreen else "no display")

    monkeypatch.setenv("GLCONTEXT_LINUX_LIBEGL", "/nowhere/libEGL.so")
    monkeypatch.setattr(module.GLFW, "open", refuse)
    with pytest.raises(DeviceError) as caught:
        open_context("auto")
    for word in ("not loaded", "no library", "no display", "libegl1", "libgl1-mesa-dri", "libosmesa6", "xvfb"):
        assert word in str(caught.value)


def test_a_failed_opening_leaves_the_current_context(egl: Context, monkeypatch: Any) -> None:
    target = painted(egl, 4.0)
    monkeypatch.setenv("RAYMARCH_EGL_DEVICE", "77")
    with egl.bound():
        with pytest.raises(DeviceError):
            open_context("egl")
        assert target.framebuffer.read(components=1, dtype="f4")[:4] == np.float32(4.0).tobytes()
    target.release()


def test_an_old_opengl_is_refused_and_its_window_closed(osmesa: Context, monkeypatch: Any) -> None:
    monkeypatch.setattr(module, "_GL_VERSION", 990)
    windows = len(module.GLFW._live)
    with pytest.raises(DeviceError, match="990"):
        open_context("osmesa")
    assert len(module.GLFW._live) == windows


def test_osmesa_and_a_window_exclude_each_other(osmesa: Context) -> None:
    with pytest.raises(DeviceError, match=r"one process.*release"):
        open_context("window")
    assert isinstance(osmesa.gl, moderngl.Context) and BACKENDS == ("egl", "osmesa", "window")


WINDOW = """
from raymarch.errors import DeviceError
from raymarch.gpu.context import open_context
from raymarch.gpu.targets import Target

def paint(context, value):
    target = Target(context, (4, 4))
    target.clear((value,) * 4)
    return target

window, egl, second = open_context("window"), open_context("egl"), open_context("window")
targets = [paint(c, float(i)) for i, c in enumerate((window, egl, second))]
for i in (0, 1, 0, 1, 2, 1, 2, 0):
    assert (targets[i].read() == i).all(), i
try:
    open_context("osmesa")
except DeviceError as error:
    assert "2 live window context(s)" in str(error), error
else:
    raise AssertionError("two glfw platforms at once")
assert (targets[1].read() == 1).all()
window.release(); second.release()
osmesa = open_context("osmesa")                 # no window lives: glfw may change its platform
assert (paint(osmesa, 5.0).read() == 5).all() and (targets[1].read() == 1).all()
osmesa.release()
again = open_context("window")
assert (paint(again, 6.0).read() == 6).all() and (targets[1].read() == 1).all()
again.release(); egl.release()
print(again.backend, again.window)
"""


def test_a_window_under_a_real_x_server(interpreter: Interpreter, display: str, egl: Context, osmesa: Context) -> None:
    assert interpreter(WINDOW, display) == "window None"


def test_a_window_without_a_display_names_the_cure(interpreter: Interpreter) -> None:
    code = """
from raymarch.errors import DeviceError
from raymarch.gpu.context import open_context
try:
    open_context("window")
except DeviceError as error:
    print(error)
"""
    answer = interpreter(code, None)
    assert "DISPLAY" in answer and "xvfb-run" in answer


def test_glfw_of_other_code_is_left_alone(interpreter: Interpreter, display: str) -> None:
    code = """
import glfw
from raymarch.errors import DeviceError
from raymarch.gpu.context import open_context
assert glfw.init()
window = glfw.create_window(8, 8, "theirs", None, None)
try:
    open_context("osmesa")
except DeviceError as error:
    print(error.what)
assert glfw.get_window_size(window) == (8, 8)
open_context("window").release()
assert glfw.get_window_size(window) == (8, 8)
"""
    assert "started by other code" in interpreter(code, display)
