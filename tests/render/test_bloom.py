"""Bloom against another form of its filters, and against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.cost.effects import ablations
from raymarch.errors import SceneError, SceneWarning
from raymarch.expr.srgb import srgb_to_linear
from raymarch.gpu.part import PicturePart
from raymarch.gpu.prepare import prepare
from raymarch.plan import plan
from raymarch.scene.parameter import Values

SIZE = (48, 36)
LAMP = rm.Material(emission=(20, 12, 4))
NODE = rm.sphere(0.3).material(LAMP) | rm.box(1).translate((1, 0, 0))
PLAIN = rm.Scene(NODE, rm.Camera((0, 0, 6)), sky=(0.02, 0.02, 0.05))

Array = NDArray[np.float64]


@pytest.fixture
def renderer(session_renderer: rm.Renderer) -> rm.Renderer:
    session_renderer.resize(SIZE)
    return session_renderer


def with_bloom(strength: Any = 0.3, radius: Any = 0.1, scene: rm.Scene = PLAIN) -> rm.Scene:
    return scene.replace(post=[rm.Bloom(strength, radius)])


def applied(bloom: rm.Bloom, color: Array) -> Array:
    return bloom.apply(color, bloom.numbers(Values({})))


# The filters as matrices, one axis at a time. Rows count from the bottom.


def upwards(fine: int) -> Array:
    """Linear interpolation from the texels of half the size to this many, by bilinear taps with clamped ends."""
    coarse = -(-fine // 2)
    matrix = np.zeros((fine, coarse))
    for row in range(fine):
        place = min(max((row + 0.5) / 2, 0.5), coarse - 0.5) - 0.5
        low = min(int(place), max(coarse - 2, 0))
        matrix[row, low] += 1 - (place - low)
        matrix[row, min(low + 1, coarse - 1)] += place - low
    return matrix


def glow(edge: int, count: int) -> Array:
    """Down `count` levels and up again. Down is the adjoint of up, where a texel weighs what it covers."""
    up, weights, down = np.eye(edge), np.ones(edge), np.eye(edge)
    for _ in range(count):
        step = upwards(len(weights))
        covers = step.T @ weights
        down = (step / covers).T * weights @ down
        up, weights = up @ step, covers
    return up @ down


def test_the_shader_and_the_reference_are_adjoint_filters(renderer: rm.Renderer) -> None:
    """Without a pyramid: each level is brought up alone, and the levels are added by their weights."""
    renderer.resize((11, 9))
    color = renderer.render(PLAIN).color
    bloom = rm.Bloom(0.5, 0.2)
    shares = bloom.shares(bloom.numbers(Values({})), 9)
    assert len(shares) == 2
    weights = {0: 1 - shares[0], 1: shares[0] * (1 - shares[1]), 2: shares[0] * shares[1]}
    flipped = color[::-1].astype(np.float64)
    expected = sum(
        w * np.einsum("yj,xi,jic->yxc", glow(9, level), glow(11, level), flipped) for level, w in weights.items()
    )
    found = renderer.render(PLAIN.replace(post=[bloom])).color
    assert np.abs(expected - color[::-1]).max() > 0.1
    assert found == pytest.approx(expected[::-1], rel=2e-6, abs=2e-6)
    assert applied(bloom, color.astype(np.float64)) == pytest.approx(expected[::-1], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("at", [(64, 64), (61, 70)])
@pytest.mark.parametrize("radius", [0.01, 0.031, 0.05])
def test_a_point_keeps_its_light_and_place_and_spreads_by_the_radius(at: tuple[int, int], radius: float) -> None:
    point = np.zeros((128, 128, 3))
    point[at] = 1000.0
    spread = applied(rm.Bloom(1.0, radius), point)[..., 0] / 1000.0
    y, x = np.indices(spread.shape)
    assert spread.min() >= 0.0 and spread.sum() == pytest.approx(1.0, rel=1e-12)
    assert [(spread * y).sum(), (spread * x).sum()] == pytest.approx(at, rel=1e-12)
    expected = np.mean([(radius * 128 * 0.5**octave) ** 2 for octave in range(6)])
    for axis, centre in ((y, at[0]), (x, at[1])):
        assert (spread * (axis - centre) ** 2).sum() == pytest.approx(expected, rel=1e-9)


def test_a_point_spreads_evenly_and_falls_off() -> None:
    middle = np.zeros((128, 128, 3))
    middle[63:65, 63:65] = 1.0
    spread = applied(rm.Bloom(1.0, 0.05), middle)[..., 0]
    for turned in (spread[::-1], spread[:, ::-1], spread.T):
        assert turned == pytest.approx(spread, abs=1e-15)
    along = spread[64, 64:]
    assert np.all(np.diff(along[along > 0]) < 0)


@pytest.mark.parametrize("size", [(1, 1), (7, 1), (13, 5), (48, 36)])
def test_a_constant_picture_stays(renderer: rm.Renderer, size: tuple[int, int]) -> None:
    renderer.resize(size)
    away = PLAIN.replace(camera=rm.Camera((0, 0, 6), target=(0, 0, 12)), sky=(0.3, 2.0, 5.0))
    for strength, radius in ((1.0, 1.0), (0.3, 0.1)):
        found = renderer.render(with_bloom(strength, radius, away)).color
        assert found == pytest.approx(np.broadcast_to((0.3, 2.0, 5.0), found.shape), rel=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (7, 1), (97, 61), (200, 150), (320, 180), (113, 64)])
def test_no_light_is_added_or_lost(size: tuple[int, int]) -> None:
    """At any size, light in the corners and at the borders included."""
    picture = np.random.default_rng(3).pareto(1.0, (size[1], size[0], 3))
    for radius in (0.02, 0.2, 0.4, 1.0):
        found = applied(rm.Bloom(1.0, radius), picture)
        assert found.sum(axis=(0, 1)) == pytest.approx(picture.sum(axis=(0, 1)), rel=1e-12)
        corner = np.zeros_like(picture)
        corner[-1, 0] = corner[0, -1] = 1.0
        assert applied(rm.Bloom(0.5, radius), corner).sum() == pytest.approx(corner.sum(), rel=1e-12)


def test_the_shader_adds_and_loses_no_light(renderer: rm.Renderer) -> None:
    for size in [(97, 61), (50, 75), (64, 36)]:
        renderer.resize(size)
        color = renderer.render(PLAIN).color.astype(np.float64)
        for radius in (0.2, 1.0):
            found = renderer.render(with_bloom(1.0, radius)).color.astype(np.float64)
            assert found.sum() == pytest.approx(color.sum(), rel=1e-5)


def test_it_looks_the_same_at_every_resolution() -> None:
    """The mean of 2 x 2 pixels of a larger picture, beyond what glows. Its spread is equal exactly: see above."""
    coarse = np.zeros((64, 64, 3))
    coarse[21:25, 32:35] = 10.0
    fine = coarse.repeat(2, axis=0).repeat(2, axis=1)
    bloom = rm.Bloom(1.0, 0.1)
    averaged = applied(bloom, fine).reshape(64, 2, 64, 2, 3).mean(axis=(1, 3))
    found = applied(bloom, coarse)
    found[18:28, 29:38] = averaged[18:28, 29:38] = 0.0
    assert np.abs(found - averaged).max() < 0.1 * found.max()


def test_values_that_are_not_finite_stay_alone(renderer: rm.Renderer) -> None:
    """The picture is written in place of the one that the scene draws."""
    scene = with_bloom(0.5, 0.2)
    drawn, *rest = renderer.draw_calls(scene)

    def bloomed(picture: NDArray[np.float32]) -> NDArray[np.float32]:
        drawn.target.write(np.dstack([picture, np.ones(picture.shape[:2], np.float32)]))
        for call in rest:
            call.draw()
        return rest[-1].target.read()[..., :3]

    picture = renderer.render(PLAIN).color
    picture[0, 0] = picture[20, 10] = 0.0
    expected = bloomed(picture)
    picture[0, 0], picture[20, 10] = np.nan, (1.0, np.inf, 1.0)
    found = bloomed(picture)
    assert np.all(np.isnan(found[0, 0])) and found[20, 10].tolist() == [1.0, np.inf, 1.0]
    known = np.isfinite(found).all(axis=-1)
    assert np.count_nonzero(~known) == 2 and np.array_equal(found[known], expected[known])
    reference = applied(scene.post[0], picture.astype(np.float64))
    assert reference[known] == pytest.approx(found[known], rel=2e-6, abs=2e-6)
    picture[20, 10] = 3e38
    assert np.all(np.isfinite(bloomed(picture)[known])) and bloomed(picture)[known].min() > 0.0


def test_a_scene_without_it_has_no_byte_of_it(renderer: rm.Renderer) -> None:
    plain, bloomed = prepare(PLAIN), prepare(with_bloom())
    assert plain.texts["color"] == bloomed.texts["color"] and set(bloomed.texts) == {"color", "bloom"}
    assert "field" not in bloomed.texts["bloom"] and plain.texts.keys() == {"color"}
    assert [t.name for t in renderer.render(PLAIN).timings] == ["color"]
    assert [t.name for t in renderer.render(with_bloom(), outputs=("depth",)).timings] == ["geometry"]


def test_it_follows_the_samples_the_history_and_its_parameters(renderer: rm.Renderer) -> None:
    strength = rm.Param("bloom", 0.2, 0, 1)
    quality = rm.Quality(samples=3, temporal="accumulate")
    for _ in range(2):
        found = [renderer.render(with_bloom(strength).replace(quality=quality), params={"bloom": 0.6})]
    plain = [renderer.render(PLAIN.replace(quality=quality)) for _ in range(2)][-1]
    expected = applied(rm.Bloom(0.6, 0.1), plain.color.astype(np.float64))
    assert found[-1].color == pytest.approx(expected, rel=2e-6, abs=2e-6)
    moving = with_bloom(0.3 + 0.1 * rm.time)
    assert not np.array_equal(renderer.render(moving).color, renderer.render(moving, 1.0).color)


def test_the_reference_has_it() -> None:
    plain, found = rm.truth(PLAIN, SIZE), rm.truth(with_bloom(), SIZE)
    assert np.array_equal(found.color, applied(rm.Bloom(0.3, 0.1), plain.color))


def test_light_beyond_the_surfaces_is_in_a_transparent_picture(renderer: rm.Renderer) -> None:
    """Over black it is the picture of the surfaces alone; far from them it is transparent."""
    frame = renderer.render(with_bloom(0.3, 0.02))
    over = np.asarray(frame.image(alpha=True), np.float64)
    assert over[0, 0, 3] == 0 and np.all(over[frame.alpha > 0.999, 3] == 255)
    glow = (frame.alpha == 0) & (over[..., 3] > 3)
    assert np.count_nonzero(glow) > 20
    alone = renderer.render(with_bloom(0.3, 0.02).replace(sky=(0, 0, 0))).color[glow]
    shown = (srgb_to_linear(over[..., :3] / 255) * over[..., 3:] / 255)[glow]
    assert shown == pytest.approx(alone, abs=0.006)


def test_what_cannot_have_it_says_so(renderer: rm.Renderer) -> None:
    with pytest.raises(SceneError, match=r"test_bloom.py:\d+: bloom of a part .* needs all pixels"):
        renderer.render(with_bloom(), part=PicturePart((96, 36)))
    with pytest.warns(SceneWarning, match="bloom is left out: an exported shader draws each pixel alone"):
        made = plan(with_bloom(), ("standalone",), standalone=True)
    assert [p.name for p in made.passes] == ["standalone"]


def test_it_is_explained_and_ablated() -> None:
    made = plan(with_bloom())
    (feature,) = [f for f in made.features if f.name == "bloom"]
    assert feature.used and "test_bloom.py" in str(feature.where)
    assert "needed by Bloom(...) at" in made.passes[-1].reason
    assert not next(f for f in plan(PLAIN).features if f.name == "bloom").used
    assert dict(ablations(with_bloom()))["bloom"].post == ()


@pytest.mark.parametrize(("given", "words"), [({"strength": 1.5}, "<= 1"), ({"radius": -0.1}, ">= 0")])
def test_values_out_of_range_are_refused(given: dict[str, float], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        rm.Bloom(**given)


@pytest.mark.parametrize("post", [rm.Bloom(), [3], 5, None])
def test_post_is_a_list_of_effects(post: Any) -> None:
    with pytest.raises(SceneError, match=r"Scene: post = .*(\[Bloom\(\)\]|\(Bloom\(...\)\))"):
        rm.Scene(NODE, post=post)


def test_a_parameter_may_be_called_as_a_texture_of_a_pass(renderer: rm.Renderer) -> None:
    """`u_color` is the picture that the passes of bloom read, and the parameter `color` of the scene."""
    pictures = []
    for name in ("color", "other"):
        ball = rm.sphere(rm.Param(name, 0.4, 0.1, 0.9)).material(rm.Material(emission=(4, 2, 1)))
        made = rm.Scene(ball, rm.Camera((0, 0, 4), (0, 0, 0)), post=[rm.Bloom(0.3, 0.1)])
        pictures.append(renderer.render(made, params={name: 0.7}, outputs=("color", "depth")))
    assert np.array_equal(pictures[0].color, pictures[1].color)
    assert np.array_equal(pictures[0].depth, pictures[1].depth)
