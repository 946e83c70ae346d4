"""Tracers that a scene defines by a function of the state of a ray."""

from __future__ import annotations

import copy
import json
import pickle
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.settings import axes, grid
from raymarch.gpu.context import Context

SIZE = (48, 27)
SOLID = rm.union(rm.torus(), rm.box(1), k=0.2).rotate(0.6, "x") | rm.plane(offset=-1.3)
SCENE = rm.Scene(SOLID, rm.Camera((0.5, 1.5, 5.5)), lights=[rm.Sun(shadow=True)], quality=rm.Quality(analytic=False))


def keinert(ray: rm.TracerState) -> Any:
    plain = rm.max(ray.undone, ray.memory)
    return rm.where(plain > 0, 1, 1.6) * ray.value, plain


def drawn(egl: Context, **quality: Any) -> rm.Frame:
    with rm.Renderer(SIZE, context=egl) as renderer:
        scene = SCENE.replace(quality=SCENE.quality.replace(**quality))
        return renderer.render(scene, outputs=("depth", "evaluations", "fallbacks", "color"))


def test_keinert_takes_the_steps_of_relaxed(egl: Context) -> None:
    own, known = drawn(egl, tracer=keinert), drawn(egl, tracer="relaxed")
    assert own.evaluations.mean() == pytest.approx(known.evaluations.mean(), rel=2e-3)
    assert own.fallbacks.sum() == pytest.approx(known.fallbacks.sum(), rel=2e-2) and own.fallbacks.sum() > 100
    assert np.mean(own.depth == known.depth) > 0.99 and np.allclose(own.color, known.color, atol=1e-3)


@pytest.mark.parametrize(
    "tracer",
    [
        lambda ray: 1e9,
        lambda ray: ray.value / 0.0,
        lambda ray: -1.0,
        lambda ray: 2 * ray.value / (1 - rm.min(ray.slope, 0.9)),
    ],
)
def test_no_function_makes_a_picture_wrong(egl: Context, tracer: Any) -> None:
    found, truth = drawn(egl, tracer=tracer), rm.truth(SCENE, SIZE).depth
    hit = np.isfinite(truth)
    pixel = rm.truth(SCENE, SIZE).depth[hit] * 2 * np.tan(np.radians(20)) / SIZE[1]
    assert np.array_equal(np.isfinite(found.depth), hit)
    assert np.quantile(np.abs(found.depth[hit] - truth[hit]) / pixel, 0.9) < 0.05


def test_it_is_a_value() -> None:
    quality = rm.Quality(tracer=keinert)
    assert quality == rm.Quality(tracer=keinert) == pickle.loads(pickle.dumps(quality)) != rm.Quality()
    assert quality != rm.Quality(tracer=lambda ray: ray.value)
    assert repr(quality) == "Quality(tracer=keinert)" and copy.deepcopy(quality) == quality
    assert json.dumps(asdict(quality)["tracer"]) == '"keinert"'


def test_cost_compares_it_with_the_others() -> None:
    scene = SCENE.replace(quality=SCENE.quality.replace(tracer=keinert))
    names = [made.name for made in grid(scene, axes(given={"tracer": ("plain", "relaxed"), "max_steps": (64,)}))]
    assert {"base", "plain, 64 steps", "keinert, 64 steps"} <= set(names)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tracer": lambda ray: "x"}, "the function gives = 'x'"),
        ({"tracer": lambda ray: rm.vec2(1, 2)}, "the function gives a vec2"),
        ({"tracer": lambda ray: rm.time * ray.value}, "reads a Param or time"),
        ({"tracer": lambda: 1}, "the function fails"),
        ({"tracer": keinert, "steps_per_pass": 8}, "steps_per_pass with a tracer of your own"),
        ({"tracer": keinert, "omega": 1.2}, "omega with tracer"),
    ],
)
def test_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(rm.SceneError, match=message):
        rm.Quality(**given)
