"""Frames that follow others on one renderer: each is that of a renderer that drew nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context
from tests.lab import frames
from tests.lab.frames import A, B, balls, camera, solids

SIZE = (24, 16)
ACCUMULATE = rm.Quality(temporal="accumulate")
SUN = [rm.Sun(shadow=True)]


def alone(egl: Context, scene: rm.Scene, **given: Any) -> np.ndarray:
    """The picture of a new renderer."""
    with Renderer(SIZE, context=egl) as renderer:
        return renderer.render(scene, **given).color


def test_random_sequences(egl: Context) -> None:
    frames.run(2, 12, ("cones", "shutter"), 6)


def test_a_frame_without_a_picture_leaves_the_mean_to_its_own_picture(egl: Context) -> None:
    scene = rm.Scene(solids(rm.sin(rm.time)), camera(), SUN, quality=ACCUMULATE)
    with Renderer(SIZE, context=egl) as renderer:
        for _ in range(3):
            renderer.render(scene)
        renderer.render(scene, 1.0, outputs=("depth",))
        np.testing.assert_array_equal(renderer.render(scene, 1.0).color, alone(egl, scene, time=1.0))
        renderer.render(scene, 0.5, outputs=("depth",))
        renderer.render(scene, 1.0)
        assert renderer.history.mean.samples == 2, "the mean goes on"


@pytest.mark.parametrize("moves", ["shutter", "amplitude"])
def test_a_change_within_the_opening_of_the_shutter_begins_the_mean_anew(moves: str, egl: Context) -> None:
    """Neither changes anything at the time of the frame."""
    seen = camera(position=(0.5 + A * rm.sin(3.0 * rm.time), 0.8, 4.0), shutter=B)
    scene = rm.Scene(solids(), seen, SUN, quality=ACCUMULATE.replace(samples=4))
    before = {"a": 1.0, "b": 0.2} if moves == "shutter" else {"a": 0.2, "b": 1.0}
    with Renderer(SIZE, context=egl) as renderer:
        other = renderer.render(scene, params=before).color
        found = renderer.render(scene, params={"a": 1.0, "b": 1.0}).color
    np.testing.assert_array_equal(found, alone(egl, scene, params={"a": 1.0, "b": 1.0}))
    assert np.abs(found - other).max() > 0.05


def test_an_open_shutter_and_rows_of_objects_leave_other_arrays_to_be_drawn(egl: Context) -> None:
    """Each sample has three textures of its own; the cache keeps 32."""
    scene = rm.Scene(balls(rm.sin(rm.time)), camera(position=(0, 2, 5), shutter=0.5), quality=rm.Quality(samples=16))
    with Renderer(SIZE, context=egl) as renderer:
        depth = renderer.render(scene, 0.5, outputs=("color", "depth")).depth
        np.testing.assert_array_equal(depth, renderer.render(scene, 0.5, outputs=("depth",)).depth)


@pytest.mark.parametrize("temporal", ["accumulate", "reproject"])
def test_transparency_has_the_samples_of_the_picture(temporal: str, egl: Context) -> None:
    """Else an edge has the colour of the sky, or none."""
    blend = rm.union(rm.sphere(0.7), rm.box((0.9, 0.9, 0.9)), k=0.1)
    scene = rm.Scene(blend, camera(), SUN, sky=rm.Sky((0.1, 0.3, 3.0)))
    with Renderer(SIZE, context=egl) as renderer:
        kept = scene.replace(quality=rm.Quality(temporal=temporal))
        for _ in range(8):
            frame = renderer.render(kept)
        found = np.asarray(frame.image(alpha=True))
        right = renderer.render(scene.replace(quality=rm.Quality(samples=8))).image(alpha=True)
    assert np.abs(found.astype(int) - np.asarray(right)).max() <= 1
    assert len(np.unique(found[..., 3])) > 3
