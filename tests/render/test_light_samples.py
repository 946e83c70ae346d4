"""More points of a light's disc for each ray, and fewer steps towards it."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm

SIZE = (48, 27)


def scene(lights: int, **quality: object) -> rm.Scene:
    return rm.Scene(
        rm.sphere(0.6) | rm.box((4, 0.2, 4)).translate((0, -0.7, 0)),
        camera=rm.Camera((1, 1.5, 4), (0, 0, 0)),
        lights=[
            rm.SphereLight(
                (1.5 + 0.1 * i, 2.5, 1),
                radius=0.8,
                intensity=4 / lights,
                shadow=True,
                penumbra="sampled",
                shadow_radius=9.0 if i % 2 else None,
            )
            for i in range(lights)
        ],
        quality=rm.Quality(**quality),  # type: ignore[arg-type]
    )


def drawn(made: rm.Scene) -> np.ndarray:
    with rm.Renderer(SIZE) as renderer:
        return renderer.render(made).color.astype(np.float64)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_four_points_halve_the_noise():
    true = rm.truth(scene(1), SIZE, outputs=("color",)).color
    one, four = (drawn(scene(1, light_samples=n)) - true for n in (1, 4))
    assert rms(four) == pytest.approx(0.5 * rms(one), rel=0.25)
    assert abs(four.mean()) < 3 * rms(four) / np.sqrt(0.3 * SIZE[0] * SIZE[1])


def test_many_lights_have_points_too():
    """Of n points, the mean of the first k differs from that of all by the share 1/k - 1/n of one point's variance."""
    one, two, four = (drawn(scene(9, light_samples=n)) for n in (1, 2, 4))
    assert rms(two - four) == pytest.approx(np.sqrt((1 / 2 - 1 / 4) / (1 - 1 / 4)) * rms(one - four), rel=0.2)
    assert abs((one - four).mean()) < 3 * rms(one - four) / np.sqrt(0.3 * SIZE[0] * SIZE[1])


def test_a_shadow_that_runs_out_of_steps_is_light():
    whole, short = (drawn(scene(1, analytic=False, **steps)) for steps in ({}, {"shadow_steps": 1}))
    assert np.all(short >= whole - 1e-6)
    assert ((short - whole).max(axis=-1) > 0.1 * 0.5 / 0.8).sum() > 20, "where the shadow was"


def test_ranges():
    for wrong in ({"light_samples": 0}, {"light_samples": 65}, {"shadow_steps": 0}):
        with pytest.raises(rm.errors.SceneError, match=next(iter(wrong))):
            rm.Quality(**wrong)


def test_many_area_lights_without_shadows_are_the_mean_of_their_samples() -> None:
    """Rows of one kind of light; they failed for lack of a head."""
    lights = [rm.RectLight((0.5 * k - 2, 2, 0), intensity=0.1) for k in range(9)]
    scene = rm.Scene(rm.plane(), rm.Camera((0, 1, 3), (0, 0, 0)), lights=lights)
    with rm.Renderer((16, 9)) as renderer:
        one, four = (renderer.render(scene.replace(quality=rm.Quality(light_samples=n))).color for n in (1, 4))
    assert 0.0 < np.abs(four - one).max() < 0.5 * one.max() and abs(four.mean() / one.mean() - 1.0) < 0.1
