"""Estimates far from their solid: no larger than the distance, for the fractals and for a user's own."""

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.vocabulary import length
from raymarch.plan import plan
from raymarch.sdf.definition import REGISTRY
from raymarch.sdf.levels import flatness, has_levels, slopes_at_surface

FAR = 7.0
"""From here on log(r) r / 2 is larger than r - 1."""


def orbit_stays(p, steps=12):
    """Whether points belong to the Mandelbulb of power 8, by its iteration alone."""
    z = p.copy()
    inside = np.ones(len(p), bool)
    for _ in range(steps):
        r = np.linalg.norm(z, axis=1)
        inside &= r < 2.0
        z[~inside] = r[~inside] = 0.0
        theta = 8 * np.arccos(np.divide(z[:, 1], r, out=np.zeros_like(r), where=r > 0))
        phi = 8 * np.arctan2(z[:, 2], z[:, 0])
        turned = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=1)
        z = (r**8)[:, None] * turned + p
    return inside


def directions(n):
    v = np.random.default_rng(3).normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("away", [2.0, FAR, 100.0, 1e5])
def test_the_mandelbulb_is_no_farther_than_its_points(away):
    grid = np.stack(np.meshgrid(*[np.linspace(-1.1, 1.1, 40)] * 3, indexing="ij"), -1).reshape(-1, 3)
    members = grid[orbit_stays(grid)]
    points = away * directions(40)
    nearest = np.linalg.norm(points[:, None] - members[None], axis=-1).min(axis=1)
    assert np.all(rm.mandelbulb(iterations=12).distance(points) <= nearest)


@rm.shape(exactness="estimate", bounds=lambda: ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)))
def steep_ball(p):
    """A ball of radius 1, three times as steep outside of the ball around its box."""
    return (length(p) - 1.0) * rm.where(length(p) < 1.8, 1.0, 3.0)


del REGISTRY["steep_ball"]

written_in_glsl = rm.glsl_node(
    "float far_off(vec3 p) { return 2.0 * length(p) - 2.0; }",
    "far_off",
    bounds=((-1,) * 3, (1,) * 3),
    twin=lambda p: 2.0 * np.linalg.norm(p, axis=1) - 2.0,
)


@pytest.mark.parametrize(
    ("solid", "radius"),
    [
        (rm.mandelbulb(), 2.0),
        (rm.julia(), 2.6),
        (rm.mandelbox(), 6.0 * np.sqrt(3.0)),
        (rm.fold_fractal(lambda z, growth, p: (2.0 * rm.box_fold(z) - z, 3.0 * growth), iterations=3), 2 * np.sqrt(3)),
        (written_in_glsl, np.sqrt(3.0)),
        (steep_ball(), np.sqrt(3.0)),
    ],
    ids=["mandelbulb", "julia", "mandelbox", "folds", "GLSL", "own"],
)  # fmt: skip
@pytest.mark.parametrize("away", [1e2, 1e4])
def test_no_estimate_steps_to_the_middle_of_its_solid(solid, radius, away):
    """The box of the solid lies within the radius of the origin."""
    found = solid.distance(away * directions(20))
    assert np.all(found <= away) and np.all(found >= away - radius)


def raw(code, name):
    return rm.glsl_node(code, name, "estimate", bounds=((-1, -1, -1), (1, 1, 1)))


@pytest.mark.parametrize(
    ("node", "levels"),
    [
        (rm.sphere(), True),
        (rm.mandelbulb(iterations=3), True),
        (rm.julia(iterations=5).translate((3, 0, 0)) | rm.plane(), True),
        (rm.fold_fractal(lambda z, growth, p: (2.0 * abs(z) - 1.0, 2.0 * growth), rm.sphere(0.5), iterations=3), True),
        (rm.fold_fractal(lambda z, growth, p: (2.0 * abs(z) - 1.0, 2.0 * growth), iterations=3), False),
        (rm.mandelbox(iterations=3) | rm.mandelbulb(iterations=3), False),
        (rm.apollonian(), False),  # unbounded
        (raw("float unknown(vec3 p) { return length(p) - 0.5; }", "unknown"), False),  # for a GPU alone
    ],
)
def test_estimates_with_a_level_set(node, levels):
    assert has_levels(node) is levels
    made = plan(rm.Scene(node))
    assert made.epsilon == (0.1 if levels else 0.5)
    estimate = "bracketing" if levels else "plain"
    assert made.marching.tracer == (estimate if node.exactness == "estimate" else "advance")
    assert ("ESTIMATE" in made.variants) is (node.exactness == "estimate")


def test_samples_tell_how_flat_their_field_is():
    z, y, x = np.meshgrid(*[np.linspace(-1.0, 1.0, 21)] * 3, indexing="ij")
    ball = np.sqrt(x * x + y * y + z * z) - 0.6
    node = rm.grid(ball)
    steepest = np.sqrt(3.0)  # bound of the slope of samples whose slope along each axis is 1; they are divided by it
    assert 1.0 <= flatness(node) <= 2.1 * steepest  # a distance; the path is along the axes
    for slope in (1e-2, 1e-3):
        plate = np.where(x > 1e-9, slope * x, x)  # the surface is at x = 0, where samples are
        node = rm.grid(np.maximum(plate, np.max(np.abs([x, y, z]), axis=0) - 0.95).T)
        assert flatness(node) == pytest.approx(steepest / slope, rel=1e-5)
        assert flatness(node.scale(3.0) | rm.sphere()) == flatness(node)


def test_a_solid_that_touches_its_image_is_not_flat():
    """Its field is 0 on the plane of the mirror, where the gradient is 0."""
    shear = np.eye(4)
    shear[0, 1] = 1.1
    node = rm.cylinder(1.0, 2.0).translate((0, 1, 0)).mirror("y").transform(shear)
    assert slopes_at_surface(node)[0] > 0.3
    assert plan(rm.Scene(node, lights=[rm.Sun((1, 1, 1), shadow=True, softness=0.1)])).further


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1e6])
def test_the_flatness_of_a_solid_is_that_of_its_copy_of_another_size(size):
    """Also where a length that is 0 at the surface is part of the field."""

    def solids(s):
        plate = rm.rectangle((0.9 * s, 0.7 * s))
        yield rm.box((3 * s, 0.1 * s, 0.3 * s)).bend(1.8 / s)
        yield plate.extrude(1.4 * s, scale=0.2)
        yield plate.shell(0.08 * s).extrude(1.2 * s, scale=0.5, twist=1.2)
        yield rm.box((0.8 * s, 1.4 * s, 0.6 * s)).taper(0.3 / s).twist(1 / s).taper(-0.4 / s)

    for here, there in zip(solids(1.0), solids(size), strict=True):
        assert flatness(there) == pytest.approx(flatness(here), rel=1e-3)
        assert slopes_at_surface(there) == pytest.approx(slopes_at_surface(here), rel=1e-3)


def test_pipes_and_means_tell_how_flat_their_field_is():
    """Their spread is not known."""
    pipe = rm.pipe(rm.sphere(), rm.sphere(1.1).translate((0.05, 0.02, 0)), 0.072)
    assert flatness(pipe) == pytest.approx(np.sqrt(2.0) / slopes_at_surface(pipe)[0]) and flatness(pipe) > 16.0
    assert flatness(pipe | rm.sphere()) == flatness(pipe) and plan(rm.Scene(pipe)).contact_share < 1.0 / 30.0
    mean = rm.morph(rm.sphere(), rm.box(1.2), 0.4)
    assert 1.0 < flatness(mean) < 2.0 and plan(rm.Scene(mean)).contact_share == 1.0 / 16.0
