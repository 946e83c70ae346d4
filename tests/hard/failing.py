"""A context whose nth call to the driver fails, as one does that is out of memory, or lost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context

COUNTED = ("texture", "texture3d", "framebuffer", "program", "vertex_array", "finish")


class _Array:
    """A vertex array whose draws are counted."""

    def __init__(self, inner: Any, gl: FailingContext) -> None:
        self._inner, self._gl = inner, gl

    def render(self, *args: Any, **how: Any) -> Any:
        self._gl.count("draw")
        return self._inner.render(*args, **how)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


class FailingContext:
    """A moderngl context that counts calls and lets one of them fail, from the `fails`th on if it is `lost`."""

    def __init__(self, gl: Any, fails: int, lost: bool = False) -> None:
        self._inner, self.fails, self.lost, self.calls = gl, fails, lost, 0

    def count(self, name: str) -> None:
        self.calls += 1
        if self.calls == self.fails or (self.lost and self.calls > self.fails > 0):
            raise moderngl.Error("the context is lost" if self.lost else "GL_OUT_OF_MEMORY")

    def vertex_array(self, *args: Any, **how: Any) -> _Array:
        self.count("vertex_array")
        return _Array(self._inner.vertex_array(*args, **how), self)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._inner, name)
        if name not in COUNTED:
            return found

        def counted(*args: Any, **how: Any) -> Any:
            self.count(name)
            return found(*args, **how)

        return counted


@contextmanager
def failing(context: Context, fails: int, lost: bool = False) -> Iterator[FailingContext]:
    """While it lasts, the context's `fails`th call fails."""
    original = context.gl
    fake = FailingContext(original, fails, lost)
    context.gl = fake  # type: ignore[assignment]
    try:
        yield fake
    finally:
        context.gl = original


def scenes() -> list[rm.Scene]:
    """Between them they use textures, many lights, cones, samples and a history."""
    here = rm.Camera((2, 1.5, 3), (0, 0, 0))
    lamps = [rm.PointLight((np.cos(i), 2, np.sin(i)), intensity=0.2) for i in range(9)]
    height = rm.heightmap(np.linspace(0, 1, 64).reshape(8, 8))
    return [
        rm.Scene(height, here, lamps, quality=rm.Quality(schedule="cone", samples=2)),
        rm.Scene(rm.box(1), here, quality=rm.Quality(temporal="accumulate")),
    ]


def failures(context: Context, size: tuple[int, int] = (16, 12)) -> tuple[int, int, int]:
    """Let each call to the driver fail in turn.

    Returns how many calls there are, how many failures came out without the pass or the cause, and after how many the
    same renderer did not draw what a new one does.
    """
    calls = unnamed = broken = 0
    for scene in scenes():
        with Renderer(size, context=context) as renderer:
            known = renderer.render(scene, outputs=("color", "depth")).color
        n = 0
        while True:
            n += 1
            with Renderer(size, context=context) as renderer:
                with failing(context, n) as fake:
                    said = _said(renderer, scene)
                if fake.calls < n:
                    break
                calls += 1
                unnamed += said is None or not ("pass " in said and "GL_OUT_OF_MEMORY" in said)
                broken += not np.array_equal(renderer.render(scene, outputs=("color", "depth")).color, known)
    with Renderer(size, context=context) as renderer:
        with failing(context, 1, lost=True):
            said = _said(renderer, scenes()[0])
        unnamed += said is None or "the context is lost" not in said
        calls += 1
    return calls, unnamed, broken


def _said(renderer: Renderer, scene: rm.Scene) -> str | None:
    """The message of a frame that failed; None if it did not, or with something that is no message."""
    try:
        renderer.render(scene, outputs=("color", "depth"))
    except RaymarchError as error:
        return str(error)
    except Exception:
        return None
    return "nothing failed"
