"""Points of lights and directions of lobes together: the same mean as each kind alone, with less noise than either."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import Expr, expr, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import dot, get, where
from raymarch.expr.walk import substitute
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import BSDF, Microfacets
from raymarch.scene.layers import Coated
from raymarch.scene.light import (
    DIRECTION,
    DIRECTION_SAMPLE,
    FAR,
    LIGHT,
    POINT,
    SAMPLE,
    density_of,
    eval_disc,
    pdf_disc,
    power_heuristic,
    record,
    sample_disc,
    sample_of,
)
from raymarch.scene.surfaces import pdf_lobes, sample_lobes, samples_both
from tests.support.bsdf import VIEW, Z, material

RECT = rm.RectLight((0.4, 0.3, 2.0), 1.2, 0.8, (-0.2, -0.1, -1.0), up=(0, 1, 0.2), intensity=3.0, range=9.0)
DISC = rm.SphereLight((0.4, 0.3, 2.0), 0.5, intensity=3.0, shadow=True, penumbra="sampled")
METAL = material(color=(0.9, 0.9, 0.9), metalness=1.0, roughness=0.3)
COAT = material(color=(0.5, 0.2, 0.2), metalness=0.0, roughness=0.7, clearcoat=1.0, clearcoat_roughness=0.1)
CHOICE, N = var("choice", FLOAT), 200_000


def parts(light: rm.Light) -> tuple[Expr, Expr, Expr]:
    """As records at a point: a sample of a light, the light of `DIRECTION`, and the density of `DIRECTION_SAMPLE`."""
    if isinstance(light, rm.SphereLight):
        centre = record(LIGHT, *sample_of(light))
        width = light.radius / get(centre, "distance")
        direction = get(DIRECTION_SAMPLE, "direction")
        return (
            sample_disc(centre, width, SAMPLE),
            eval_disc(centre, width, DIRECTION),
            pdf_disc(centre, width, direction),
        )
    density = density_of(light)
    assert density is not None
    return record(LIGHT, *sample_of(light)), record(LIGHT, *density[0]), density[1]


def strategies(light: rm.Light, bsdf: BSDF, values: dict[str, Any]) -> NDArray[np.float64]:
    """Samples of the light of a surface at the origin about z, (3, N): of the light alone, of lobes alone, of both."""
    given = values | bsdf.prepare(values, Z, VIEW)
    sample, met, pdf = parts(light)
    towards = substitute([met], {DIRECTION: sample_lobes(bsdf, given, Z, VIEW, SAMPLE, CHOICE)})[0]

    def terms(of: Expr, lobe: bool) -> list[Expr]:
        direction = get(of, "direction")
        value = bsdf.eval(given, Z, VIEW, direction)
        value = get(of, "radiance").x * where(dot(Z, direction) > 0.0, value.x, 0.0)
        q = substitute([pdf], {DIRECTION_SAMPLE: of})[0]
        p = pdf_lobes(bsdf, given, Z, VIEW, direction)
        return [value, q, p, power_heuristic(expr(lobe), q, p)]

    found = evaluator([*terms(sample, False), *terms(towards, True)], [VIEW, POINT, SAMPLE, CHOICE, FAR])
    view = np.array([-0.6, -0.3, 1.6])
    drawn = np.random.default_rng(1).uniform(size=(2, N, 3))
    fixed = np.tile(view / np.linalg.norm(view), (N, 1)), np.zeros((N, 3))
    (a, _, _, wa, *_), (*_, b, q, p, wb) = (found(*fixed, u[:, :2], u[:, 2], np.full(N, 50.0)) for u in drawn)
    alone = np.where(p > 0, b * q / np.maximum(p, 1e-300), 0.0)
    return np.stack(np.broadcast_arrays(a, alone, wa * a + wb * b))


@pytest.mark.parametrize("light", [RECT, DISC], ids=["rectangle", "disc"])
@pytest.mark.parametrize(
    ("bsdf", "values"), [(Microfacets(), METAL), (Coated(Microfacets()), COAT)], ids=["metal", "coat"]
)
def test_both_kinds_of_samples_have_the_mean_of_each(light: rm.Light, bsdf: BSDF, values: dict[str, Any]) -> None:
    light_alone, lobes_alone, both = strategies(light, bsdf, values)
    means = [x.mean() for x in (light_alone, lobes_alone, both)]
    errors = [x.std() / np.sqrt(N) for x in (light_alone, lobes_alone, both)]
    assert abs(means[2] - means[0]) < 4 * np.hypot(errors[2], errors[0])
    assert abs(means[2] - means[1]) < 4 * np.hypot(errors[2], errors[1])
    assert errors[2] < errors[0]


@pytest.mark.parametrize("light", [RECT, DISC], ids=["rectangle", "disc"])
def test_the_light_of_a_direction_is_the_sample_in_it(light: rm.Light) -> None:
    """Samples of the light, met again by their direction; and densities that integrate to 1 over the directions met."""
    sample, met, pdf = parts(light)
    again = substitute([met], {DIRECTION: get(sample, "direction")})[0]
    names = ("direction", "distance", "radiance")
    density = substitute([pdf], {DIRECTION_SAMPLE: met})[0]
    u = np.random.default_rng(2).uniform(size=(N, 3))
    point = np.tile([0.3, -0.2, 0.1], (N, 1))
    found = evaluator([get(x, n) for x in (sample, again) for n in names], [POINT, SAMPLE, FAR])
    parted = [np.asarray(x) for x in found(point, u[:, :2], np.full(N, 50.0))]
    for one, other in zip(parted[:3], parted[3:], strict=True):
        near = np.isclose(one, other, rtol=1e-9).reshape(N, -1).all(axis=1)
        assert near.mean() > 0.9999  # rounding at the edges
    z = 2 * u[:, 0] - 1
    directions = np.stack([*(np.sqrt(1 - z * z) * f(2 * np.pi * u[:, 1]) for f in (np.cos, np.sin)), z], axis=1)
    radiance, p = evaluator([get(met, "radiance"), density], [POINT, DIRECTION, FAR])(
        point, directions, np.full(N, 50.0)
    )
    inside = np.where(np.any(radiance > 0, axis=1), p, 0.0) * 4 * np.pi
    assert inside.mean() == pytest.approx(1.0, abs=4 * inside.std() / np.sqrt(N))


def row(light: rm.Light, count: int = 1, **quality: Any) -> rm.Scene:
    """A smooth metal, a coated ball, a metal of medium roughness, and a rough floor."""
    made = [
        rm.Material(albedo=(0.9, 0.6, 0.3), metalness=1.0, roughness=0.0),
        rm.Material(albedo=(0.5, 0.1, 0.1), roughness=0.6, clearcoat=1.0, clearcoat_roughness=0.1),
        rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1.0, roughness=0.3),
    ]
    balls = [rm.sphere(0.6).translate((1.3 * (i - 1), 0.6, 0)).material(m) for i, m in enumerate(made)]
    node = rm.union(*balls, rm.plane().material(rm.Material(albedo=(0.6, 0.6, 0.6), roughness=0.7)))
    lights = [light.replace(intensity=light.intensity / count)] * count
    camera = rm.Camera((0, 1.5, 4), (0, 0.5, 0), fov=40)
    return rm.Scene(node, camera, lights=lights, sky=(0, 0, 0), quality=rm.Quality(**quality))


ABOVE = rm.RectLight((0, 3, 2), 1.5, 1.0, (0, -1, -0.7), intensity=5.0, shadow=True)
BALL = rm.SphereLight((0, 3, 2), 0.6, intensity=5.0, shadow=True, penumbra="sampled")


@pytest.mark.parametrize(
    ("light", "count", "samples", "passes"),
    [(ABOVE, 1, 1, None), (ABOVE, 9, 2, None), (BALL, 1, 2, 1), (BALL, 9, 1, None), (ABOVE, 9, 1, 3)],
)
def test_the_shader_has_the_light_of_the_reference(
    egl: Context, light: rm.Light, count: int, samples: int, passes: int | None
) -> None:
    """Of one and of many lights, of several points, and over passes; nine equal lights have the light of one."""
    size = (28, 16)
    wanted = rm.truth(row(light), size, outputs=("color",)).color
    with rm.Renderer(size, backend="egl") as renderer:
        one = renderer.render(row(light, count, light_samples=samples, lights_per_pass=passes)).color
        mean = renderer.render(row(light, count, samples=32)).color
    smooth = flat(wanted)
    assert np.median(np.abs(mean - wanted)[smooth]) < 0.004
    assert mean[smooth].mean() == pytest.approx(wanted[smooth].mean(), rel=0.01)
    assert one[smooth].mean() == pytest.approx(wanted[smooth].mean(), rel=0.05)


def test_paths_sample_both_too(egl: Context) -> None:
    """A convex metal under a black sky reflects the light alone, however many bounces there are."""
    ball = rm.sphere(1.0).material(rm.Material(albedo=(0.9, 0.6, 0.3), metalness=1.0, roughness=0.12))
    camera = rm.Camera((0, 1.5, 4), (0, 0.5, 0), fov=30)
    scene = rm.Scene(ball, camera, lights=[ABOVE], sky=(0, 0, 0), quality=rm.Quality(samples=32))
    wanted = rm.truth(scene, (24, 16), outputs=("color",)).color
    with rm.Renderer((24, 16), backend="egl") as renderer:
        direct, paths = (renderer.render(scene.replace(bounces=bounces)).color for bounces in (0, 2))
    inside = flat(wanted)
    assert np.median(np.abs(paths - wanted)[inside]) < 0.004
    assert paths.mean() == pytest.approx(direct.mean(), rel=0.02)


def flat(color: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels that differ little from those around them, (H, W)."""
    padded = np.pad(color, ((1, 1), (1, 1), (0, 0)), "edge")
    around = np.stack([padded[i : i + color.shape[0], j : j + color.shape[1]] for i in range(3) for j in range(3)])
    return np.ptp(around, axis=0).max(axis=-1) < 0.15


def test_scenes_that_do_not_call_for_it_do_without() -> None:
    rough = rm.Material(albedo=(0.6, 0.6, 0.6), roughness=0.6)
    smooth = rough.replace(roughness=0.1)
    assert samples_both(ABOVE, [smooth]) and samples_both(BALL, [smooth])
    assert not samples_both(ABOVE, [rough, rm.Material((0.5, 0.5, 0.5))])
    assert not samples_both(BALL.replace(penumbra="two-sided"), [smooth]) and not samples_both(rm.Sun(), [smooth])
    coated = rough.replace(clearcoat=0.5, clearcoat_roughness=0.0)
    assert samples_both(ABOVE, [coated]) and not samples_both(ABOVE, [rough.replace(clearcoat=0.0)])
    with_pattern = rough.replace(roughness=lambda p: 0.5 + 0.5 * rm.sin(p.x))
    assert samples_both(ABOVE, [with_pattern])


def test_a_light_with_samples_of_its_own_is_sampled_alone() -> None:
    """The density of its base class would not be that of its samples."""

    class Half(rm.RectLight):
        @staticmethod
        def sample_direction(values: Any, p: Expr, u: Expr, far: Expr) -> rm.DirectionSample:
            return rm.RectLight.sample_direction(values, p, 0.5 * u, far)

    assert not samples_both(Half((0, 2, 0)), [rm.Material(metalness=1.0, roughness=0.1)])
