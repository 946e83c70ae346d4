"""Soft shadows take the steps of the tracer, and show the same penumbra."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.effects import evaluation_counts
from raymarch.gpu import Renderer
from raymarch.scene.light_kinds import hard

PENUMBRAS = ("cone", "triangulated", "two-sided")


WHITE = rm.Material((1, 1, 1), ambient=0, specular=0)


def scene(penumbra: str, tracer: str, hidden: bool) -> rm.Scene:
    """Solids above a floor in the light of a wide sun, without other light. One may be hidden from the camera, so that
    none is solved in closed form."""
    solids = [rm.sphere(0.4).translate((-0.9, 0.8, 0.2)), rm.capsule((0.2, 0.3, -0.8), (0.9, 1.1, 0.4), 0.12)]
    solids += [rm.rounded_box((0.7, 0.5, 0.6), 0.08).rotate(0.5, "y").translate((0.1, 0.6, 0.7))]
    other = rm.box((0.5, 0.5, 0.5)).translate((1.4, 0.8, -0.6)).visible(camera=not hidden)
    node = rm.union(*solids, other, rm.plane()).material(WHITE)
    return rm.Scene(
        node,
        rm.Camera((0.5, 4, 4), (0.2, 0, 0)),
        lights=[rm.Sun((0.7, 1.2, -0.3), shadow=True, softness=0.12, penumbra=penumbra)],
        sky=(0, 0, 0),
        quality=rm.Quality(tracer=tracer),
    )


def divided(penumbra: str, tracer: str) -> rm.Scene:
    """The same with solids whose fields are divided: hills and a quadric."""
    x, z = np.mgrid[-1:1:33j, -1:1:33j]
    hills = rm.heightmap(0.5 + 0.5 * np.sin(9 * x) * np.cos(7 * z), size=(3, 3), height=0.5)
    ball = rm.implicit(lambda p: 30.0 * (rm.dot(p, p) - 0.16), 0.6).translate((-0.9, 0.9, 0.2))
    return scene(penumbra, tracer, False).replace(node=rm.union(hills, ball, rm.plane()).material(WHITE))


def drawn(renderer: Renderer, made: rm.Scene) -> tuple[Any, Any, Any]:
    """The light without shadows, its visible part, and the evaluations of the shadow rays, of each pixel."""
    bare = made.replace(lights=[hard(light).replace(shadow=False) for light in made.lights])
    free = renderer.render(bare).color[..., 0]
    share = renderer.render(made).color[..., 0] / np.maximum(free, 1e-6)
    asked = evaluation_counts(made, renderer) - evaluation_counts(bare, renderer)
    return free, share, asked


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("penumbra", PENUMBRAS)
def test_solids_that_tell_how_far_a_ray_is_free_tell_it_of_penumbras(penumbra: str, hidden: bool) -> None:
    """Half of the evaluations, for a clearance that both know to 1/16. Circles of two plain steps have 1 to sqrt(3/4)
    of it, depending on where the samples are."""
    with Renderer((96, 72)) as renderer:
        free, by_value, many = drawn(renderer, scene(penumbra, "bracketing", hidden))
        same, by_way, few = drawn(renderer, scene(penumbra, "advance", hidden))
    lit = (free > 0.01) & (np.abs(same - free) < 1e-3)  # the same surface, which faces the light
    off = np.abs(by_way - by_value)[lit]
    assert np.mean(lit) > 0.8 and np.mean((by_value[lit] > 0.02) & (by_value[lit] < 0.98)) > 0.02
    assert off.max() <= (1.0 - np.sqrt(0.75) if penumbra == "triangulated" else 0.0625) and off.mean() <= 0.002
    assert few.mean() <= many.mean() * (0.6 if penumbra == "two-sided" else 0.5)


@pytest.mark.parametrize("penumbra", ["cone", "two-sided"])
def test_divided_fields_tell_it_of_their_cones_too(penumbra: str) -> None:
    """Two fifths of the evaluations at most, for the same clearance to 1/16."""
    with Renderer((96, 72)) as renderer:
        free, by_value, many = drawn(renderer, divided(penumbra, "bracketing"))
        same, by_way, few = drawn(renderer, divided(penumbra, "advance"))
    lit = (free > 0.01) & (np.abs(same - free) < 1e-3)
    off = np.abs(by_way - by_value)[lit]
    assert np.mean(lit) > 0.8 and np.mean((by_value[lit] > 0.02) & (by_value[lit] < 0.98)) > 0.02
    assert off.max() <= 0.0625 and off.mean() <= 0.002
    assert few.mean() <= 0.4 * many.mean()


@pytest.mark.parametrize("tracer", ["bracketing", "advance"])
def test_triangulated_shadows_take_longer_steps_than_spheres(tracer: str) -> None:
    """Fewer evaluations than those of the plain tracer, and the same shadow but for the places of its circles."""
    with Renderer((96, 72)) as renderer:
        free, plain, many = drawn(renderer, scene("triangulated", "plain", True))
        same, longer, few = drawn(renderer, scene("triangulated", tracer, True))
    lit = (free > 0.01) & (np.abs(same - free) < 1e-3)
    off = (longer - plain)[lit]
    assert np.abs(off).max() <= 1.0 - np.sqrt(0.75) and np.abs(off).mean() <= 0.004
    assert few.mean() <= 0.8 * many.mean()
