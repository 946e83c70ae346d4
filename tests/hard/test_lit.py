"""The judge by closed forms, and a short run of random lit scenes; a longer one: python -m tests.lab.lit."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.gpu.context import Context
from tests.hard.brute import FAMILIES, Brute, Part, Rays, Spec, Tree, blended, distance, meet, normal_of, parts_of
from tests.lab.lit import SIZE, Court, blocked, drawn, look, program, shrunk

SCENES = 40


@pytest.fixture(scope="module")
def court(egl: Context) -> Iterator[Court]:
    made = Court(context=egl, proofs=False)
    yield made
    made.close()


def marched(tree: Tree) -> Part:
    """A part whose closed form is not used."""
    return parts_of([("turn", 0.0, (0.0, 1.0, 0.0), tree)])[0]


def rays_to(targets: NDArray[np.float64], origin: tuple[float, float, float]) -> Rays:
    way = targets - origin
    n = len(way)
    direction = way / np.linalg.norm(way, axis=1)[:, None]
    return Rays(np.tile(origin, (n, 1)), direction, np.zeros(n), np.full(n, 1e3), np.full(n, 1e-6), np.full(n, 1e-6))


def test_a_marched_sphere_is_hit_where_the_quadratic_says() -> None:
    targets = np.random.default_rng(1).uniform(-1.2, 1.2, (500, 3))
    rays = rays_to(targets, (0.0, 0.0, 5.0))
    b = rays.direction @ (0.0, 0.0, 5.0)
    inner = b**2 - 24.0
    right = np.where(inner > 0, -b - np.sqrt(np.maximum(inner, 0.0)), math.inf)
    for part in (marched(("sphere", 1.0)), parts_of([("sphere", 1.0)])[0]):
        met = meet([part], rays)
        sure = ~met.close
        assert sure.mean() > 0.99
        assert np.array_equal(np.isfinite(met.t[sure]), np.isfinite(right[sure]))
        both = sure & np.isfinite(right)
        assert np.abs(met.t[both] - right[both]).max() < 1e-10


def test_a_marched_box_is_hit_where_its_slabs_say() -> None:
    targets = np.random.default_rng(2).uniform(-1.0, 1.0, (500, 3))
    rays = rays_to(targets, (3.0, 2.0, 5.0))
    size = np.array((1.0, 0.6, 1.4))
    sides = [(s * 0.5 * size - rays.origin) / rays.direction for s in (-1.0, 1.0)]
    enter, leave = np.minimum(*sides).max(axis=1), np.maximum(*sides).min(axis=1)
    right = np.where(enter < leave, enter, math.inf)
    met = meet([marched(("box", tuple(size)))], rays)
    sure = ~met.close
    assert sure.mean() > 0.95 and np.array_equal(np.isfinite(met.t[sure]), np.isfinite(right[sure]))
    both = sure & np.isfinite(right)
    assert np.abs(met.t[both] - right[both]).max() < 1e-10


def test_a_normal_of_differences_is_that_of_a_torus() -> None:
    part = marched(("torus", 1.0, 0.25))
    a, b = np.random.default_rng(3).uniform(0, 2 * math.pi, (2, 200))
    n = np.stack([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)], axis=1)
    p = np.stack([np.cos(a), 0 * a, np.sin(a)], axis=1) + 0.25 * n
    assert np.abs(distance(part.tree, p)).max() < 1e-15
    assert np.abs(normal_of(part, p, np.ones(200)) - n).max() < 1e-8


@pytest.mark.parametrize("family", FAMILIES)
def test_a_blend_is_normalised_and_no_steeper_than_it_may_be(family: str) -> None:
    a = np.zeros(1)
    assert blended(a, a, 0.4, family) == pytest.approx(-0.1)
    far = blended(a, a + 1e3, 0.4, family)
    assert far == pytest.approx(0.0, abs=1e-4)
    x, y = np.random.default_rng(4).uniform(-1, 1, (2, 1000))
    h = 1e-6
    da = (blended(x + h, y, 0.4, family) - blended(x - h, y, 0.4, family)) / (2 * h)
    db = (blended(x, y + h, 0.4, family) - blended(x, y - h, 0.4, family)) / (2 * h)
    assert min(da.min(), db.min()) > -1e-6
    assert (np.hypot(da, db) if family == "circular_geometric" else da + db).max() < 1 + 1e-6
    assert np.all(blended(x, y, 0.4, family) <= np.minimum(x, y) + 1e-12)


PLANE: Tree = ("paint", 0, ("plane", (0.0, 1.0, 0.0), 0.0))
MATTE = [{"color": (0.6, 0.4, 0.2), "specular": 0.0, "ambient": 0.0}]


def floor_points(judge: Brute, t: NDArray[np.float64]) -> NDArray[np.float64]:
    width, height = SIZE
    x, y = (a.ravel() for a in np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5))
    return judge.eye + t.reshape(-1, 1) * judge.camera_rays(x, y).direction


@pytest.mark.parametrize("away", [3.0, 1e5])
@pytest.mark.parametrize("closed", [True, False])
def test_a_sphere_casts_the_shadow_of_an_ellipse(away: float, closed: bool) -> None:
    """A point of the floor is in the shadow of a sun if its line to the sun comes within the radius of the centre."""
    towards = np.array((0.3, 0.8, -0.5)) / np.linalg.norm((0.3, 0.8, -0.5))
    ball: Tree = ("move", tuple(away * towards), ("sphere", 1.0))
    if not closed:
        ball = ("turn", 0.0, (0.0, 1.0, 0.0), ball)
    sun = {"kind": "sun", "direction": tuple(towards), "shadow": True}
    judge = Brute(Spec([PLANE, ball], MATTE, [sun], (0.5, 1.5, 6.0), (0.0, 0.0, 0.0), 20.0), SIZE)
    seen = judge.picture()
    at = floor_points(judge, np.where(np.isfinite(seen.t), seen.t, 1.0)).reshape(*seen.t.shape, 3)
    beside = np.linalg.norm(np.cross(at - away * towards, towards), axis=-1)
    floor = seen.certain & np.isfinite(seen.t) & (np.abs(at[..., 1]) < 1e-9)
    right = np.where(beside < 1.0, 0.0, towards[1])[..., None] * (0.6, 0.4, 0.2)
    assert floor.sum() > 200 and (beside[floor] < 1).sum() > 10
    assert np.abs(seen.color[0] - right)[floor].max() < 1e-9


def test_a_floor_is_lit_by_lambert_and_the_inverse_square() -> None:
    lamp = {"kind": "point", "position": (0.4, 2.0, -0.3), "intensity": 5.0}
    judge = Brute(Spec([PLANE], MATTE, [lamp], (0.0, 1.5, 4.0), (0.0, 0.0, 0.0), 30.0), SIZE)
    seen = judge.picture()
    at = floor_points(judge, seen.t)
    way = np.array(lamp["position"]) - at
    far = np.linalg.norm(way, axis=1)
    right = (5.0 * 2.0 / far**3)[:, None] * (0.6, 0.4, 0.2)
    assert np.isfinite(seen.t).all() and np.abs(seen.color[0].reshape(-1, 3) - right).max() < 1e-9


def test_a_mirror_shows_the_sky_and_the_floor() -> None:
    """A floor that mirrors, under a wall's height of nothing: Schlick's share of the sky."""
    mirror = [{"mirror": (0.5, 0.6, 0.7)}]
    spec = Spec([PLANE], mirror, [], (0.0, 1.0, 4.0), (0.0, 0.0, 0.0), 10.0, (1.0, 1.0, 1.0), bounces=2)
    judge = Brute(spec, SIZE)
    seen = judge.picture()
    cosine = 1.0 / seen.t[..., None]
    right = np.array((0.5, 0.6, 0.7)) + (1 - np.array((0.5, 0.6, 0.7))) * (1 - cosine) ** 5
    assert seen.certain.mean() > 0.9 and np.abs(seen.color[0] - right).max() < 1e-9


def test_a_fault_is_found_and_made_small(court: Court) -> None:
    """A judge whose lamps fall off linearly disagrees, and the scene that is left has one lamp and one solid."""
    lamp = {"kind": "point", "position": (0.0, 4.0, 3.0), "intensity": 8.0}
    sun = {"kind": "sun", "direction": (1.0, 2.0, 1.0), "shadow": True}
    ball: Tree = ("union", 0.2, "quadratic", ("sphere", 0.6), ("move", (0.5, 0.0, 0.0), ("sphere", 0.4)))
    spec = Spec([PLANE, ball], MATTE, [lamp, sun], (0.0, 2.0, 5.0), (0.0, 0.0, 0.0), 30.0)
    assert court.verdict(spec) is None

    def fails(other: Spec) -> bool:
        spoiled = [
            {**light, "attenuation": (0.0, 1.0, 0.0)} if light["kind"] == "point" else light for light in other.lights
        ]
        frame = court.draw(other)
        from tests.lab.lit import differences

        return differences(other, Brute(other.changed(lights=spoiled), SIZE).picture(), frame) is not None

    assert fails(spec)
    small = shrunk(spec, fails)
    assert len(small.trees) == 1 and len(small.lights) == 1 and "PointLight" in program(small)[0]


def test_the_generator_draws_what_it_is_for() -> None:
    specs = [drawn(seed) for seed in range(300)]
    tags = [tag for spec in specs for tag in spec.tags]
    for tag in ("border", "far occluder", "mirror", "moving", "scaled", "symmetry", "touching"):
        assert tags.count(tag) >= 20, tag
    assert not any(blocked(spec) for spec in specs[:50])
    away = [np.linalg.norm(light["position"]) for spec in specs for light in spec.lights if "position" in light]
    assert min(away) < 0.1 and max(away) > 1e5


@pytest.mark.parametrize("block", range(4))
def test_random_lit_scenes_are_as_the_judge_says(court: Court, block: int) -> None:
    each = SCENES // 4
    found = [look(court, seed) for seed in range(1 + block * each, 1 + (block + 1) * each)]
    reports = [str(report) for report in found if report is not None]
    assert not reports, "\n".join(reports)


@pytest.mark.parametrize("seed", [100, 212])
def test_scenes_that_the_judge_once_read_otherwise(court: Court, seed: int) -> None:
    """A mirror inside of a solid that only the camera does not see; an edge that a ray nearly misses before a floor."""
    report = look(court, seed, lambda kind: False)
    assert report is None, str(report)


def test_a_ray_that_starts_inside_ends_at_once_in_all_solids() -> None:
    rays = rays_to(np.array([(0.3, 5.0, 0.1)]), (0.0, -0.2, 0.0))
    for tree in (("plane", (0.0, 1.0, 0.0), 0.0), ("sphere", 1.0), ("box", (2.0, 2.0, 2.0))):
        met = meet(parts_of([tree]), rays)
        assert met.t[0] == pytest.approx(0.0, abs=1e-9), tree
