"""Evaluations that shading takes, counted by the shader."""

from __future__ import annotations

import numpy as np

import raymarch as rm
from raymarch.gpu.context import Context
from tests.lab.evaluation_counts import count_evaluations

WHITE = rm.Material((1, 1, 1), specular=0, ambient=1)


def test_effects_cost_what_they_ask(egl: Context) -> None:
    node = (rm.sphere() | rm.plane(offset=-1)).material(WHITE)
    with rm.Renderer((40, 30), context=egl) as renderer:

        def counted(**parts: object) -> np.ndarray:
            scene = rm.Scene(node, rm.Camera((0, 2, 5), (0, 0, 0)), **parts)  # type: ignore[arg-type]
            hit = np.isfinite(renderer.render(scene).depth)
            counts = count_evaluations(renderer, scene)
            assert np.all(counts.shading[~hit] == 0) and counts.marching[hit].mean() > 1
            return counts.shading[hit]

        assert not counted().any()
        assert not counted(sky=rm.GradientSky(light=True)).any()
        assert np.all(counted(occlusion=rm.AmbientOcclusion(steps=4)) == 4)
        hard = counted(lights=[rm.Sun(shadow=True)])
        soft = counted(lights=[rm.Sun(shadow=True, softness=0.1)])
        assert 1 < hard.mean() < soft.mean()
        assert not counted(lights=[rm.PointLight((0, 5, 0), range=0.5, shadow=True)]).any()
        assert counted(lights=[], bounces=1).mean() > 1


def test_a_light_beyond_its_range_costs_nothing(egl: Context) -> None:
    """Also with many lights: only pixels within the range of a light trace its shadow."""
    lights = [rm.PointLight((3.0 * (k % 8) - 10, 0.5, 3.0 * (k // 8) - 10), range=1.0, shadow=True) for k in range(64)]
    camera = rm.Camera((0, 12, 12), (0, 0, 0))
    with rm.Renderer((40, 30), context=egl) as renderer:
        scene = rm.Scene(rm.plane() | rm.sphere(0.5).translate((0, 30, 0)), camera, lights)
        frame = renderer.render(scene)
        counts = count_evaluations(renderer, scene).shading
    dark = (frame.color.max(axis=-1) == 0) & np.isfinite(frame.depth)
    assert dark.mean() > 0.3 and not counts[dark].any() and counts.max() > 0
