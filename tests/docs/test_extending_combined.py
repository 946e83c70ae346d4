"""The walk-throughs of docs/extending.md, in combination with everything else that a scene may have."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.vocabulary import dot, record, vec3
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.plan.unused import unused
from raymarch.scene.bsdf import BSDF
from raymarch.scene.reflectance import SAMPLE, sample_cosine
from raymarch.sdf.domain import Vec3
from raymarch.sdf.sampled_facts import contradictions

FLOOR = rm.plane(offset=-1)


class Matte(BSDF):
    """A diffuse surface: a BSDF that reads one value of the material."""

    fields = ("color",)

    def eval(self, values: Any, normal: Any, view: Any, light: Any) -> Any:
        return dot(normal, light) * values["color"]

    def sample(self, values: Any, normal: Any, view: Any, random: Any) -> Any:
        return record(SAMPLE, sample_cosine(normal, random.direction), values["color"])

    def pdf(self, values: Any, normal: Any, view: Any, light: Any) -> Any:
        return dot(normal, light) / math.pi

    def diffuse_albedo(self, values: Any, n_dot_v: Any) -> Any:
        return values["color"]


class Tube(rm.PointLight):
    """A line of light along x, of length 2."""

    @staticmethod
    def sample_direction(values: Any, p: Any, u: Any, far: Any) -> rm.DirectionSample:
        moved = {**values, "position": values["position"] + vec3(2.0 * u.x - 1.0, 0.0, 0.0)}
        return rm.PointLight.sample_direction(moved, p, u, far)


@rm.operator(bounds=lambda child, by: child.box + by, placing="rigid")
def carry(p: Any, child: Any, by: Vec3 = (0.0, 0.0, 0.0)) -> Any:
    """A translation, as a user writes it."""
    return child(p - by)


@rm.operator(bounds=lambda child: vec3(-child.box.y, child.box.x, child.box.z), placing="rigid")
def lay(p: Any, child: Any) -> Any:
    """A quarter turn about z."""
    return child(vec3(p.y, -p.x, p.z))


@rm.operator(bounds=lambda child, size: child.box * size, placing="scale")
def enlarge(p: Any, child: Any, size: rm.sdf.domain.Positive = 1.0) -> Any:
    """A scaling by one factor."""
    return size * child(p / size)


@pytest.fixture(scope="module")
def renderer(egl: Context) -> Any:
    with rm.Renderer((32, 18), context=egl) as made:
        yield made


def exported(scene: rm.Scene, folder: Path) -> rm.Scene:
    """The scene after it was exported in two languages, and pickled."""
    for suffix in ("glsl", "html"):
        rm.export(scene, folder / f"made.{suffix}")
        assert (folder / f"made.{suffix}").stat().st_size > 1000
    again = pickle.loads(pickle.dumps(scene))
    assert again == scene
    return again


MATTE = rm.Material(albedo=(0.6, 0.3, 0.2), bsdf=Matte)
OTHERS = {
    "alone": rm.sphere(0.3).material(MATTE),
    "physical": rm.sphere(0.3).material(rm.Material(albedo=(0.5, 0.5, 0.5))),
    "phong": rm.sphere(0.3).material(rm.Material(color=(0.5, 0.5, 0.5))),
    "glass": rm.sphere(0.3).material(rm.Material(transmission=1)),
    "frosted": rm.sphere(0.3).material(rm.Material(transmission=1, roughness=0.3, bsdf=Matte)),
    "coated": rm.sphere(0.3).material(rm.Material(albedo=(0.5, 0.5, 0.5), clearcoat=1)),
}


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_a_bsdf_of_its_own_values(integrator: str, other: str, renderer: Any, tmp_path: Path) -> None:
    solid = rm.sphere(0.7).material(MATTE) | FLOOR.material(MATTE) | OTHERS[other].translate((1, 0, 0))
    scene = rm.Scene(
        solid,
        lights=[rm.Sun((1, 2, 1), shadow=True), rm.RectLight((0, 3, 0))],
        sky=rm.GradientSky(light=True),
        bounces=2,
        quality=rm.Quality(integrator=integrator),
    )
    frame = renderer.render(scene)
    assert np.isfinite(frame.color).all() and frame.color.max() > 0.1
    if other in ("alone", "frosted"):
        again = renderer.render(exported(scene, tmp_path))
        np.testing.assert_array_equal(again.color, frame.color)


def test_a_diffuse_bsdf_has_the_light_of_a_diffuse_surface(renderer: Any) -> None:
    """A plane under a sky of radiance 1 shows its albedo, by any integrator."""
    for bounces in (0, 3):
        scene = rm.Scene(
            FLOOR.material(MATTE),
            camera=rm.Camera((0, 2, 0.01), (0, -1, 0)),
            lights=[],
            sky=rm.Sky(lambda d: vec3(1.0, 1.0, 1.0), light=True),
            bounces=bounces,
            quality=rm.Quality(integrator="path"),
        )
        found = renderer.render(scene).color[..., :3].reshape(-1, 3).mean(axis=0)
        np.testing.assert_allclose(found, (0.6, 0.3, 0.2), rtol=1e-3)


def test_a_light_of_ones_own_with_an_area(renderer: Any, tmp_path: Path) -> None:
    light = Tube((0, 2, 0), intensity=8, shadow=True)
    many = rm.Quality(light_samples=16)
    scene = rm.Scene(rm.sphere(0.5) | FLOOR, lights=[light], quality=many)
    assert [word for word in unused(scene) if "light_samples" in word or "penumbra" in word] == []
    assert any("light_samples" in word for word in unused(scene.replace(lights=[rm.PointLight((0, 2, 0))])))
    few = renderer.render(scene.replace(quality=rm.Quality())).doubts()
    assert any("Tube is noisy" in doubt for doubt in few)
    assert not any("noisy" in doubt for doubt in renderer.render(scene).doubts())
    np.testing.assert_array_equal(renderer.render(exported(scene, tmp_path)).color, renderer.render(scene).color)


def places(n: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(-2, 2, (n, 3))


PLACED = {
    "carry": (lambda node: carry(node, (0.3, 0.2, -0.1)), lambda p: p - (0.3, 0.2, -0.1), 1.0),
    "lay": (lay, lambda p: p[:, (1, 0, 2)] * (1, -1, 1), 1.0),
    "enlarge": (lambda node: enlarge(node, 1.3), lambda p: p / 1.3, 1.3),
}


@pytest.mark.parametrize("name", PLACED)
def test_an_operator_that_is_placed_keeps_what_is_known_of_its_child(name: str, renderer: Any, tmp_path: Path) -> None:
    place, back, factor = PLACED[name]
    centres, points = places(70), places(500)
    balls = [rm.sphere(0.1).translate(tuple(c)) for c in centres]
    wanted = factor * (np.linalg.norm(back(points)[:, None] - centres, axis=-1) - 0.1)
    above, below = place(rm.union(*balls)), rm.union(*map(place, balls))
    copies = place(rm.instances(rm.sphere(0.1), centres))
    for node in (above, below, copies):
        np.testing.assert_allclose(node.distance(points), wanted.min(axis=1), atol=1e-12)
    assert place(balls[0]).exactness == "exact" and place(balls[0]).facts.convex
    assert list(contradictions(place(balls[0]))) == []
    camera = rm.Camera((4, 4, 8), (0, 0, 0))
    scenes = [rm.Scene(node | FLOOR, camera) for node in (above, below, copies)]
    for scene in scenes:
        assert plan(scene, ("color",)).gathered.data == 70
    first, other = (renderer.render(scene).color for scene in scenes[1:])
    assert np.mean(np.abs(other - first).max(axis=-1) > 2 / 255) < 0.01
    one = rm.Scene(place(rm.box((0.5, 0.8, 0.4))) | FLOOR)
    assert plan(one, ("color",)).analytic.used
    marched = one.replace(quality=rm.Quality(analytic=False))
    np.testing.assert_allclose(renderer.render(one).color, renderer.render(marched).color, atol=0.02)
    exported(one, tmp_path)


def test_a_placing_that_is_none_is_refused_or_doubted() -> None:
    @rm.operator(bounds=lambda child: child.box, placing="rigid")
    def thicker(p: Any, child: Any) -> Any:
        return child(p) - 0.1

    @rm.operator(bounds=lambda child: child.box, placing="rigid")
    def bent(p: Any, child: Any) -> Any:
        return child(vec3(p.x, p.y + 0.3 * p.x * p.x, p.z))

    with pytest.raises(SceneError, match="thicker states a placing"):
        thicker(rm.sphere()).distance([(0, 0, 0)])
    assert any("placing" in sentence for sentence in contradictions(bent(rm.sphere())))
