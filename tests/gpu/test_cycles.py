"""Clock cycles: only as an order of magnitude, because they depend on everything."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import DeviceError
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.shader import assemble
from tests.support.required import needs_extension

CAMERA = rm.Camera(position=(0, 0, 5), target=(0, 0, 0), fov=50)
EXTENSION = "GL_ARB_shader_clock"


def test_costly_pixels_take_more_cycles(egl: Context) -> None:
    """Half of the picture sees a field of a loop, the other half the sky beside its box."""
    needs_extension(egl, EXTENSION)
    scene = rm.Scene(rm.mandelbulb(iterations=12).translate((2, 0, 0)), CAMERA)
    with rm.Renderer((64, 32), context=egl) as renderer:
        frame = renderer.render(scene, outputs=("cycles", "evaluations"))
        again = renderer.render(scene, outputs=("cycles",))
    busy = frame.evaluations >= 4
    assert 0.02 < busy.mean() < 0.6 and np.all(frame.cycles > 0)
    for made in (frame, again):
        assert np.median(made.cycles[busy]) > 2 * np.median(made.cycles[:, :20])


def test_alone_and_beside_other_passes(egl: Context) -> None:
    needs_extension(egl, EXTENSION)
    scene = rm.Scene(rm.sphere(), CAMERA, lights=[rm.Sun(shadow=True)], quality=rm.Quality(samples=4))
    with rm.Renderer((16, 16), context=egl) as renderer:
        alone = renderer.render(scene, outputs=("cycles",))
        together = renderer.render(scene, outputs=("color", "cycles", "depth", "slice"))
    assert alone.cycles.shape == together.cycles.shape == (16, 16)
    assert [t.name for t in alone.timings] == ["cone", "cycles"], "the cones are a pass of their own"


def test_only_the_pass_that_needs_it_asks_for_the_extension() -> None:
    made = plan(rm.Scene(rm.sphere(), CAMERA), ["color", "geometry", "cycles"])
    shader = assemble(made)
    has = {p.name: f"#extension {EXTENSION} : require" in shader.text(p.name) for p in made.passes}
    assert has == {"color": False, "geometry": False, "cycles": True}
    assert len({shader.text(p.name).count("\n") for p in made.passes}) == 1, "lines are counted alike in all passes"
    assert EXTENSION not in assemble(plan(rm.Scene(rm.sphere()))).text()
    alone = assemble(plan(rm.Scene(rm.sphere()), ["cycles"]))
    assert alone.text().splitlines()[1] == f"#extension {EXTENSION} : require"
    last = len(alone.text().splitlines())
    assert alone.locate(last)[0].startswith("line ") and "cycles.glsl" in alone.locate(last)[0]


def test_a_driver_without_a_shader_clock_is_told_so(egl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    with rm.Renderer((8, 8), context=egl) as renderer:
        without = SimpleNamespace(extensions=egl.gl.extensions - {EXTENSION})
        monkeypatch.setattr(renderer, "context", _Without(egl, without))
        with pytest.raises(DeviceError, match=rf"cycles: .* has no {EXTENSION} \(a driver with"):
            renderer.render(rm.Scene(rm.sphere(), CAMERA), outputs=("cycles",))


class _Without:
    """A context whose driver lacks extensions."""

    def __init__(self, context: Context, gl: SimpleNamespace) -> None:
        self.driver, self.released, self.gl = context.driver, False, gl
        self.bound = context.bound
