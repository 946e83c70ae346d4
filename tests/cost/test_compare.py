"""One frame against the reference, from Python."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import CostError
from raymarch.gpu.context import Context

SIZE = (40, 30)
SCENE = rm.Scene(rm.torus().rotate(0.8, "x") | rm.plane(offset=-0.6), lights=[rm.Sun(shadow=True)])


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("RAYMARCH_CACHE", str(tmp_path))


def test_a_frame_is_near_and_the_reference_is_nearer(egl: Context) -> None:
    with rm.Renderer(SIZE, context=egl) as renderer:
        drawn = rm.cost.compare(SCENE, renderer.render(SCENE), samples=4)
    known = rm.truth(SCENE, SIZE)
    itself = rm.cost.compare(SCENE, known)
    assert drawn.sound and 0 < drawn.pixels_p99 < 0.05 and drawn.normal_p99 < 0.1
    assert 0 <= drawn.flip_mean < 0.2 and np.isnan(itself.flip_mean), "the picture is compared if it is asked for"
    assert itself.sound and itself.pixels_max == 0 and itself.depth_max == 0


def test_arrays_of_another_renderer() -> None:
    known = rm.truth(SCENE, SIZE)
    off = rm.cost.compare(SCENE, SimpleNamespace(depth=known.depth + 0.01))
    assert off.depth_max == pytest.approx(0.01) and off.depth_p50 == pytest.approx(0.01) and np.isnan(off.normal_p99)
    holes = known.depth.copy()
    holes[20:] = np.inf
    assert rm.cost.compare(SCENE, SimpleNamespace(depth=holes)).missed > 100


def test_a_moment_of_a_solid() -> None:
    ball = rm.sphere(1 + 0.2 * rm.sin(rm.time))
    later = rm.truth(ball, (16, 16), time=1.5)
    assert rm.cost.compare(ball, later, time=1.5).depth_max == 0 < rm.cost.compare(ball, later, time=0.2).depth_max


@pytest.mark.parametrize(
    ("frame", "options", "message"),
    [
        (3, {}, r"compare: depth = None \(a Frame, or an object with depth"),
        (SimpleNamespace(depth=np.zeros(3)), {}, r"compare: depth of shape \(3,\)"),
        (SimpleNamespace(depth=np.ones((4, 4)), normal=np.ones((4, 4))), {}, r"normal has shape \(4, 4\)"),
        (SimpleNamespace(depth=np.ones((4, 4))), {"samples": 4}, "'color'"),
        (SimpleNamespace(depth=np.ones((4, 4))), {"samples": 5}, "samples = 5 .0, or a square"),
    ],
)
def test_refused(frame: object, options: dict[str, int], message: str) -> None:
    with pytest.raises((CostError, rm.SceneError), match=message) as caught:
        rm.cost.compare(SCENE, frame, **options)
    assert caught.value.where is not None and caught.value.where.file == __file__
