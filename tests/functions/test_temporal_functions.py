"""The functions that join frames, at the edges of the picture and the ends of their ranges, against float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.expr.types import FLOAT, VEC2, VEC3, VEC4
from raymarch.gpu.context import Context
from tests.support.glsl_harness import draw, modules, run

ULP = 2.0**-24
OUT = "out vec4 c;\n"
SKY = (-1.0, 0.0, 0.0, -1.0)
TO_YCOCG = np.array([[0.25, 0.5, 0.25], [0.5, 0, -0.5], [-0.25, 0.5, -0.25]])
FACING = {"x": (1.0, 0.0), "-x": (-1.0, 0.0), "y": (0.0, 1.0), "z": (0.0, 0.0), "-z": (1.0, 1.0)}
"""Normals, folded as a surface's texel holds them."""


def around(picture: np.ndarray) -> np.ndarray:
    """The nine texels around each, (height, width, 9, n); beyond the edge those of the edge go on."""
    h, w = picture.shape[:2]
    wide = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    return np.stack([wide[y : y + h, x : x + w] for y in range(3) for x in range(3)], axis=2)


def vectors(count: int = 2000) -> np.ndarray:
    """Unit vectors: the axes, those whose z is 0, and others of both hemispheres."""
    v = np.random.default_rng(5).normal(size=(count, 3))
    v[: count // 8, 2] = 0
    v[count // 8 : count // 4, 0] = 0
    v[:6] = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    return v / np.linalg.norm(v, axis=1, keepdims=True)


# The colours around a sample.


def clipped(egl: Context, picture: np.ndarray, history: np.ndarray) -> np.ndarray:
    h, w = picture.shape[:2]
    text = OUT + modules(
        "temporal/finite",
        "temporal/clip",
        after="uniform sampler2D u_old;\n"
        "void main() { c = vec4(clipped(texelFetch(u_old, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }",
    )
    given = {"u_color": rgba(picture), "u_old": rgba(history)}
    return draw(egl, text, (w, h), given)[0][..., :3]


def rgba(picture: np.ndarray) -> np.ndarray:
    return np.concatenate([picture, np.ones((*picture.shape[:2], 1))], axis=2)


@pytest.mark.parametrize("size", [(1, 1), (7, 1), (1, 7), (24, 16)])
def test_a_history_is_drawn_into_the_box_of_the_colours_around(egl: Context, size: tuple[int, int]) -> None:
    """It moves straight towards the mean, comes to lie in the box, on its side if it lay outside, and not at all if it
    lay inside. The axes of the space stand alone: brightness, orange, green."""
    random = np.random.default_rng(1)
    shape = (size[1], size[0], 3)
    picture = random.random(shape).astype(np.float32)
    nine = around(picture.astype(float) @ TO_YCOCG.T)
    mean, deviation = nine.mean(axis=2), nine.std(axis=2)
    way = random.normal(size=(4, *shape))
    way[0] *= 0.2
    for axis in range(3):
        way[1 + axis] *= np.where(np.arange(3) == axis, 30.0, 0.02)
    for offset in way:
        offset = offset * np.maximum(deviation, 0.01)
        history = ((mean + offset) @ np.linalg.inv(TO_YCOCG).T).astype(np.float32)
        offset = history @ TO_YCOCG.T - mean
        found = clipped(egl, picture, history) @ TO_YCOCG.T.astype(float) - mean
        outside = np.maximum((np.abs(offset) / np.maximum(deviation, 1e-6)).max(axis=2, keepdims=True), 1)
        limit = 2e-6 * (1 + 1 / deviation.min()) if max(size) > 1 else 1e-3  # the root of what rounding leaves of 0
        np.testing.assert_allclose(found, offset / outside, atol=limit)
        assert np.all(np.abs(found) <= deviation + limit)


@pytest.mark.parametrize("color", [(0.0, 0.0, 0.0), (0.1, 0.2, 0.3), (0.9, 0.7, 0.3), (1000.1, 7.3, 0.7)])
def test_among_equal_colours_all_histories_become_that_colour(egl: Context, color: tuple[float, ...]) -> None:
    """The deviation is 0 but for rounding, of which a root is taken."""
    picture = np.broadcast_to(np.float32(color), (5, 6, 3))
    for history in (np.zeros((5, 6, 3)), np.full((5, 6, 3), 1e6), picture + np.array((0, 0, 1e-3))):
        found = clipped(egl, picture, history)
        assert np.all(np.isfinite(found))
        np.testing.assert_allclose(found, picture, atol=2e-6 + 4 * np.sqrt(9 * ULP) * max(color))


def test_deviations_that_only_rounding_makes_negative_are_none(egl: Context) -> None:
    """Pictures of one colour, thousands of colours: some have a mean of squares below the square of the mean."""
    for value in np.random.default_rng(2).random((200, 3)):
        assert np.all(np.isfinite(clipped(egl, np.broadcast_to(value, (3, 3, 3)), np.zeros((3, 3, 3)))))


def test_a_history_within_a_millionth_of_equal_colours_stays(egl: Context) -> None:
    history = np.full((3, 3, 3), 4e-7)
    np.testing.assert_allclose(clipped(egl, np.zeros((3, 3, 3)), history), history, rtol=16 * ULP)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_samples_that_are_not_finite_are_not_among_the_colours_around(egl: Context, bad: float) -> None:
    """The history near them is clipped to the others; where there are none, it stays."""
    random = np.random.default_rng(4)
    picture, history = random.random((6, 8, 3)), 5 * random.random((6, 8, 3))
    picture[2, 3, 1] = bad
    found = clipped(egl, picture, history)
    assert np.all(np.isfinite(found))
    sure = around(np.where(np.isfinite(picture).all(axis=2, keepdims=True), picture, np.nan) @ TO_YCOCG.T.astype(float))
    mean, deviation = np.nanmean(sure, axis=2), np.nanstd(sure, axis=2)
    assert np.all(np.abs(found @ TO_YCOCG.T - mean) <= deviation + 1e-5)
    np.testing.assert_allclose(clipped(egl, np.full((4, 5, 3), bad), history[:4, :5]), history[:4, :5], rtol=1e-6)


# The history between its pixels.


def test_cubic_weights_are_one_in_all_and_reproduce_parabolas(egl: Context) -> None:
    x = np.linspace(0, 1, 257)
    weights = run(egl, modules("temporal/finite", "temporal/history"), "cubic({0})", [(FLOAT, x)], 4).astype(float)
    at = np.arange(-1, 3)
    for power, known in ((0, 1 + 0 * x), (1, x), (2, x * x)):
        np.testing.assert_allclose(weights @ at.astype(float) ** power, known, atol=16 * ULP)
    assert weights[0].tolist() == [0, 1, 0, 0] and weights[-1].tolist() == [0, 0, 1, 0]
    assert weights.min() < -0.06, "it sharpens what fetching blurs"


def fetched(egl: Context, history: np.ndarray, offset: tuple[float, float]) -> np.ndarray:
    """The history at each pixel's middle, and an offset from it."""
    h, w = history.shape[:2]
    after = "uniform vec2 u_offset;\nvoid main() { c = history_at(gl_FragCoord.xy + u_offset); }"
    text = OUT + modules("temporal/finite", "temporal/history", after=after)
    return draw(egl, text, (w, h), {"u_history": history, "u_offset": offset})[0]


OFFSETS = [(0.0, 0.0), (0.5, 0.5), (-0.5, -0.5), (0.99, -0.99), (-0.99, 0.99)]


@pytest.mark.parametrize("offset", OFFSETS)
def test_a_history_of_one_colour_has_it_everywhere(egl: Context, offset: tuple[float, float]) -> None:
    """In corners too, and up to a pixel beyond them."""
    history = np.broadcast_to(np.float32((0.2, 0.5, 3.0, 7.0)), (5, 6, 4))
    np.testing.assert_allclose(fetched(egl, history, offset), history, rtol=64 * ULP)
    np.testing.assert_allclose(fetched(egl, history[:1, :1], offset), history[:1, :1], rtol=64 * ULP)


@pytest.mark.parametrize("offset", OFFSETS)
def test_a_linear_history_stays_linear_and_counts_are_those_of_the_nearest(
    egl: Context, offset: tuple[float, float]
) -> None:
    y, x = np.mgrid[:12, :16].astype(float)
    history = np.stack([x, y, 2 * x + 3 * y + 1, 1 + x + 16 * y], axis=-1)
    found = fetched(egl, history, offset)
    moved = np.stack([x + offset[0], y + offset[1]], axis=-1)
    inside = np.s_[3:-3, 3:-3]
    np.testing.assert_allclose(found[..., :2][inside], moved[inside], atol=1e-5)
    np.testing.assert_allclose(found[..., 2][inside], (2 * moved[..., 0] + 3 * moved[..., 1] + 1)[inside], atol=1e-4)
    near = np.floor(moved + 0.5)
    count = 1 + np.clip(near[..., 0], 0, 15) + 16 * np.clip(near[..., 1], 0, 11)
    assert np.array_equal(found[..., 3], count)


def test_beside_a_bright_edge_nothing_is_darker_than_black(egl: Context) -> None:
    history = np.zeros((6, 8, 4))
    history[:, 4:] = 100
    found = fetched(egl, history, (0.4, 0.0))
    assert found[..., :3].min() == 0 and found[..., :3].max() > 105


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("component", range(4))
def test_a_poisoned_texel_is_seen_in_all_that_is_made_of_it(egl: Context, component: int, poison: float) -> None:
    """It must not pass for black: the larger of NaN and 0 is 0 on many devices."""
    history = np.ones((9, 9, 4))
    history[4, 4, component] = poison
    found = fetched(egl, history, (0.3, 0.3))
    touched = ~np.isfinite(found).all(axis=2)
    assert touched[2:6, 2:6].all() and touched.sum() == 16


# Where a point was, and whether it was seen there.


def seen_text(after: str, outside: str = "") -> str:
    """The module; texels outside of a texture, which may be anything, are `outside`."""
    checked = (
        "vec4 checked(sampler2D s, ivec2 at, int level) {\n"
        "    bool beyond = any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, textureSize(s, level)));\n"
        f"    return beyond ? vec4({outside}) : texelFetch(s, at, level);\n"
        "}\n#define texelFetch checked\n"
    )
    before = OUT + "uniform sampler2D u_history;\n" + (checked if outside else "")
    return modules("temporal/finite", "temporal/reproject", before=before, after=after)


def test_unfolded_is_the_vector_that_was_folded(egl: Context) -> None:
    n = vectors()
    p = n / np.abs(n).sum(axis=1, keepdims=True)
    low = p[:, 2] < 0
    folded = np.where(low[:, None], (1 - np.abs(p[:, 1::-1])) * np.where(n[:, :2] < 0, -1, 1), p[:, :2])
    text = seen_text("").replace(OUT, "")
    found = run(egl, text, "decode_octahedral({0})", [(VEC2, folded)], 3)
    np.testing.assert_allclose(found, n, atol=16 * ULP)


def same(egl: Context, cases: list[tuple[Any, Any, float, Any]], edge: bool = False) -> list[bool]:
    before, now, depth, way = zip(*cases, strict=True)
    text = seen_text("").replace(OUT, "")
    call = f"is_same({{0}}, {{1}}, {{2}}, {{3}}, {str(edge).lower()}) ? 1.0 : 0.0"
    given = [(VEC4, before), (VEC4, now), (FLOAT, depth), (VEC3, way)]
    return [bool(found) for found in run(egl, text, call, given)]


def facing(name: str, depth: float, material: float = 3.0) -> tuple[float, ...]:
    return (depth, *FACING[name], material)


def test_a_surface_is_known_by_its_distance_its_normal_and_its_material(egl: Context) -> None:
    ahead, grazing = (0, 0, -1), (1, 0, 0)
    cases = {
        "the same": ((facing("z", 5), facing("z", 5), 5, ahead), True),
        "its other side": ((facing("-z", 5), facing("-z", 5), 5, ahead), True),
        "a hundredth nearer": ((facing("z", 4.95), facing("z", 5), 5, ahead), True),
        "a twentieth nearer": ((facing("z", 4.75), facing("z", 5), 5, ahead), False),
        "a twentieth farther": ((facing("z", 5.25), facing("z", 5), 5, ahead), False),
        "a twentieth farther, its other side": ((facing("-z", 5.25), facing("-z", 5), 5, ahead), False),
        "a third nearer, grazing": ((facing("z", 3.4), facing("z", 5), 5, grazing), True),
        "half as far, grazing": ((facing("z", 2.5), facing("z", 5), 5, grazing), False),
        "another material": ((facing("z", 5, 2), facing("z", 5), 5, ahead), False),
        "another normal": ((facing("x", 5), facing("z", 5), 5, ahead), False),
        "the sky both times": ((SKY, SKY, 1, ahead), True),
        "before it was the sky": ((SKY, facing("z", 1), 1, ahead), False),
        "now it is the sky": ((facing("z", 1), SKY, 1, ahead), False),
    }
    found = same(egl, [case for case, _ in cases.values()])
    assert dict(zip(cases, found, strict=True)) == {name: known for name, (_, known) in cases.items()}
    assert same(egl, [cases["another normal"][0], cases["another material"][0]], edge=True) == [True, False]


@pytest.mark.parametrize("face", ["x", "-x", "y", "-z"])
def test_a_flat_picture_has_no_edge_and_a_fold_has_one(egl: Context, face: str) -> None:
    """Not at the ends of the picture either, where there is nothing around."""
    after = "void main() { c = vec4(is_edge(decode_octahedral(texelFetch(u_surface, ivec2(gl_FragCoord.xy), 0).yz))); }"
    flat = np.broadcast_to(np.float32(facing(face, 5.0)), (6, 8, 4)).copy()
    assert not draw(egl, seen_text(after), (8, 6), {"u_surface": flat})[0].any()
    for other in (facing("z", 5.0), SKY):
        fold = flat.copy()
        fold[:, 4:] = other
        found = draw(egl, seen_text(after), (8, 6), {"u_surface": fold})[0][..., 0]
        assert not found[:, :3].any() and found[:, 3].all()
        if other != SKY:
            assert not found[:, 5:].any() and found[:, 4].all()


SEEN = """
uniform sampler2D u_point;
uniform sampler2D u_way;
uniform vec3 u_position;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec2 pixel = vec2(-7.0);
    bool found = find_in_history(texelFetch(u_point, at, 0), u_position, texelFetch(u_way, at, 0).xyz, pixel);
    c = vec4(found ? 1.0 : 0.0, pixel, 0.0);
}
"""
FRAME = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]


def seen(egl: Context, points: np.ndarray, sky: bool = False, outside: str = "", history: Any = None) -> np.ndarray:
    """Whether points, (n, 3) in the space of the earlier camera, which looks along -z, were in its 8 x 6 pixels of half
    slope 0.75, where all is at the distance 10 and faces x; and where. The later camera is somewhere else."""
    before, position = np.array([3.0, -2, 7]), np.array([40.0, 30, -20])
    world = points @ FRAME.T + (0 if sky else before - position)
    depth = np.linalg.norm(world, axis=1, keepdims=True)
    surface = np.concatenate([depth, np.broadcast_to((1.0, 0, 3), (len(points), 3))], axis=1)
    if sky:
        surface[:] = SKY
    if history is None:
        history = np.broadcast_to(np.float32(SKY if sky else facing("x", 10.0)), (6, 8, 4))
    given = {
        "u_point": surface[None],
        "u_way": rgba((world / depth)[None]),
        "u_position": position,
        "u_surface": np.broadcast_to(np.float32(SKY if sky else facing("x", 10.0)), (1, 1, 4)),
        "u_history": np.zeros((6, 8, 4)),
        "u_history_surface": history,
        "u_before_position": before,
        "u_before_frame": FRAME,
        "u_before_tan_half_fov": 0.75,
    }
    return draw(egl, seen_text(SEEN, outside), (len(points), 1), given)[0][0, :, :3]


def through(pixels: Any, distance: float = 10.0) -> np.ndarray:
    """The points that the earlier camera saw at a distance through places of its picture."""
    p = (2 * np.asarray(pixels, float) - (8, 6)) / 6 * 0.75
    way = np.concatenate([p, -np.ones((len(p), 1))], axis=1)
    return distance * way / np.linalg.norm(way, axis=1, keepdims=True)


@pytest.mark.parametrize("sky", [False, True])
def test_a_point_is_found_where_the_earlier_camera_saw_it(egl: Context, sky: bool) -> None:
    """The sky by its direction alone: wherever the cameras stand, it is infinitely far."""
    pixels = np.array([(4, 3), (0.5, 0.5), (7.5, 5.5), (0.01, 5.99), (7.99, 0.01), (2.3, 4.6)])
    found = seen(egl, through(pixels), sky)
    assert found[:, 0].all()
    np.testing.assert_allclose(found[:, 1:], pixels, atol=2e-4)


@pytest.mark.parametrize("sky", [False, True])
def test_beside_the_picture_and_behind_the_camera_nothing_was_seen(egl: Context, sky: bool) -> None:
    pixels = [(-0.5, 3), (8.5, 3), (4, -0.5), (4, 6.5), (-0.01, 5), (8.01, 5), (4, -0.01), (4, 6.01), (900, 3)]
    assert not seen(egl, through(pixels), sky)[:, 0].any()
    behind = -through([(4, 3), (2, 2), (7, 5)])
    assert not seen(egl, behind, sky)[:, 0].any()


def test_a_point_at_another_distance_was_not_seen(egl: Context) -> None:
    pixels = [(4.2, 3.1), (0.5, 0.5), (7.5, 5.5)]
    assert not seen(egl, through(pixels, 12.0))[:, 0].any()
    assert not seen(egl, through(pixels, 8.0))[:, 0].any()


def test_any_texel_around_will_do_but_none_beyond_the_edge(egl: Context) -> None:
    """What lies outside of a texture may be anything, on some device even what would be taken for the point."""
    one = np.broadcast_to(np.float32(SKY), (6, 8, 4)).copy()
    corners = [(0.5, 0.5), (7.5, 0.5), (0.5, 5.5), (7.5, 5.5)]
    assert not seen(egl, through(corners), outside="10.0, 1.0, 0.0, 3.0", history=one)[:, 0].any()
    one[2, 3] = facing("x", 10.0)
    pixels = [(3.5, 2.5), (2.5, 1.5), (4.9, 3.9), (5.1, 2.5), (3.5, 4.1), (1.9, 2.5)]
    assert seen(egl, through(pixels), history=one)[:, 0].tolist() == [1, 1, 1, 0, 0, 0]


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("component", range(4))
def test_a_poisoned_surface_is_not_known_again(egl: Context, component: int, poison: float) -> None:
    for sky in (False, True):
        history = np.broadcast_to(np.float32(SKY if sky else facing("x", 10.0)), (6, 8, 4)).copy()
        history[..., component] = poison
        assert not seen(egl, through([(4, 3), (0.5, 5.5)]), sky, history=history)[:, 0].any()


# Pixels at rest.

AT_REST = """
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    c = vec4(moves_around(at, 9) ? 1.0 : 0.0, has_stayed(at, u_way, 9) ? 1.0 : 0.0, 0.0, 0.0);
}
"""
WAY = (0.0, 0.6, -0.8)


def at_rest(egl: Context, was: np.ndarray, now: np.ndarray, moved: Any = None) -> tuple[np.ndarray, np.ndarray]:
    """Whether something around each pixel moves, and whether all that was around has stayed."""
    ways = "uniform vec3 u_way;\nuniform sampler2D u_ways;\n"
    ways += "vec3 motion_vector(ivec2 at) { return texelFetch(u_ways, at, 0).xyz; }\n"
    before = OUT + "uniform sampler2D u_history;\n" + ways
    text = modules("temporal/finite", "temporal/reproject", "temporal/rest", before=before, after=AT_REST)
    given = {"u_surface": now, "u_history_surface": was, "u_way": WAY}
    given["u_ways"] = np.zeros_like(now) if moved is None else moved
    found = draw(egl, text, now.shape[1::-1], given)[0] > 0.5
    return found[..., 0], found[..., 1]


def floor_with(*others: tuple[tuple[Any, ...], tuple[float, ...]]) -> np.ndarray:
    """A picture of a surface that faces z, and others at some pixels."""
    made = np.broadcast_to(np.float32(facing("z", 5.0)), (8, 10, 4)).copy()
    for at, texel in others:
        made[at] = texel
    return made


BALL = facing("z", 4.0, 2.0)
NEAR = np.zeros((8, 10), bool)
NEAR[2:5, 3:6] = True


def test_motion_of_one_pixel_counts_in_the_nine_around_it(egl: Context) -> None:
    moved = np.zeros((8, 10, 4))
    moved[3, 4, 1] = 1e-6
    assert np.array_equal(at_rest(egl, floor_with(), floor_with(), moved)[0], NEAR)


@pytest.mark.parametrize("poison", [np.nan, np.inf])
@pytest.mark.parametrize("component", range(4))
def test_a_poisoned_surface_has_not_stayed(egl: Context, component: int, poison: float) -> None:
    was = floor_with()
    was[3, 4, component] = poison
    assert np.array_equal(at_rest(egl, was, floor_with())[1], ~NEAR)


@pytest.mark.parametrize("gone", [BALL, SKY, facing("z", 5.0, 2.0), facing("z", 4.0), facing("z", 6.5)])
def test_what_has_gone_is_missed_around_it(egl: Context, gone: tuple[float, ...]) -> None:
    """Another material, the sky, something nearer or farther."""
    assert np.array_equal(at_rest(egl, floor_with(((3, 4), gone)), floor_with())[1], ~NEAR)
    assert at_rest(egl, floor_with(), floor_with(((3, 4), gone)))[1].all(), "what comes is seen by its colour"


def test_what_is_a_pixel_away_has_stayed_unless_it_moved_there(egl: Context) -> None:
    was = floor_with(((3, 4), BALL))
    for beside in ((3, 5), (2, 3), (4, 4)):
        now = floor_with((beside, BALL))
        assert at_rest(egl, was, now)[1].all()
        moved = np.zeros((8, 10, 4))
        moved[beside] = 1e-3
        assert np.array_equal(at_rest(egl, was, now, moved)[1], ~NEAR)
    assert not at_rest(egl, was, floor_with(((3, 6), BALL)))[1][NEAR].any()


def test_at_the_edge_of_the_picture_something_may_be_beside_it(egl: Context) -> None:
    for at in ((0, 4), (7, 4), (3, 0), (3, 9)):
        assert at_rest(egl, floor_with((at, BALL)), floor_with())[1].all()


def test_parts_of_a_grazing_surface_are_one_whatever_their_distance(egl: Context) -> None:
    """The ground at the horizon, but not another material there, nor what faces elsewhere, nor what is seen steeply."""
    grazing = (0.0, 1.0, 0.0)
    far, near = facing("z", 90.0), facing("z", 20.0)
    picture = np.broadcast_to(np.float32(far), (8, 10, 4)).copy()
    text = OUT + "uniform sampler2D u_history;\nvec3 motion_vector(ivec2 at) { return vec3(0.0); }\n"
    made = modules("temporal/finite", "temporal/reproject", "temporal/rest", before=text).replace(OUT, "")
    cases = [
        (near, far, grazing, True),
        (near, far, (0.0, 0.995, -0.0999), True),
        (near, far, (0.0, 0.99, -0.11), False),
        (facing("z", 20.0, 2.0), far, grazing, False),
        (facing("x", 20.0), far, grazing, False),
        (SKY, far, grazing, False),
        (far, SKY, grazing, False),
        (SKY, SKY, grazing, True),
    ]
    was, now, way, known = zip(*cases, strict=True)
    given = [(VEC4, was), (VEC4, now), (VEC3, way)]
    found = run(egl, made, "is_part({0}, {1}, {2}) ? 1.0 : 0.0", given)
    assert [bool(part) for part in found] == list(known)
    assert at_rest(egl, picture, picture)[1].all()


# The pass that joins them.

STAND_INS = """
struct Ray { vec3 origin; vec3 direction; };
uniform sampler2D u_color;
uniform sampler2D u_surface;
uniform sampler2D u_history;
uniform bool u_known;
uniform float u_beside;
vec4 asked_for;
Ray camera_ray(vec2 pixel) { return Ray(vec3(0.0), vec3(pixel, 1.0)); }
bool find_in_history(vec4 surface, vec3 position, vec3 direction, out vec2 pixel) {
    asked_for = surface;
    pixel = direction.xy + vec2(u_beside, 0.0);
    return u_known;
}
vec4 history_at(vec2 pixel) { return texelFetch(u_history, ivec2(pixel), 0); }
vec3 clipped(vec3 color) { return u_nearest ? asked_for.xyw : color; }
vec3 motion_vector(ivec2 at) { return vec3(0.0); }
uniform float u_most;
float samples_kept(ivec2 at, float most) { return min(most, u_most); }
uniform bool u_moves;
uniform bool u_stayed;
bool moves_around(ivec2 at, int nine) { return nine == 9 && u_moves; }
bool has_stayed(ivec2 at, vec3 direction, int nine) { return nine != 9 || u_stayed; }
vec4 filter_sample(ivec2 at, vec4 color, vec2 jitter, float share) { return color; }
"""


def resolved(
    egl: Context, color: np.ndarray, history: np.ndarray, still: bool = False, **given: Any
) -> list[np.ndarray]:
    """Colour with its count, and surface. still : of a picture that is that of the history."""
    before = "uniform bool u_nearest;\n" + STAND_INS
    joins = "temporal/mean" if still else "temporal/resolve"
    text = modules("temporal/finite", "temporal/join", joins, before=before)
    values = {"u_color": color, "u_history": history, "u_keep": True, "u_known": True, "u_most": 1e9}
    values |= {"u_beside": 0.0}
    values |= {"u_camera_rests": False, "u_moves": False, "u_stayed": True, **given}
    values.setdefault("u_surface", np.broadcast_to(np.float32(SKY), color.shape))
    return draw(egl, text, color.shape[1::-1], values, 2)


def test_surfaces_around_that_are_nearer_tell_where_an_edge_was(egl: Context) -> None:
    """The nearest of nine, at the ends of the picture of those that there are; the sky is behind everything."""
    random = np.random.default_rng(6)
    surface = random.uniform(1, 9, (12, 16, 4)).astype(np.float32)
    surface[random.random((12, 16)) < 0.8] = SKY
    nine = around(surface)
    distance = np.where(nine[..., 0] < 0, np.inf, nine[..., 0])
    nearest = np.take_along_axis(nine, distance.argmin(axis=2)[..., None, None], axis=2)[:, :, 0]
    nothing = np.zeros((12, 16, 4))
    found, kept = resolved(egl, nothing, nothing + 1, u_surface=surface, u_nearest=True)
    assert np.array_equal(found[..., :3], nearest[..., [0, 1, 3]])
    assert np.array_equal(kept, surface), "what is kept of the pixel is its own surface"


def test_samples_that_are_joined_are_their_mean(egl: Context) -> None:
    """A moving pixel forgets all but ten, one at rest nothing. What was not seen, has gone or is not to be kept is new.
    Where light changes, as much is kept as there."""
    counts = np.array([[0.0, 1, 9, 10, 11, 1000]])
    history = np.stack([counts * 0 + 8, counts * 0, counts * 0 + 2, counts], axis=-1)
    color = np.broadcast_to(np.float32((0, 4, 2, 1)), history.shape)
    moving = np.minimum(counts, 10)
    for given, kept in (
        ({}, moving),
        ({"still": True}, counts),
        ({"u_known": False}, 0 * counts),
        ({"u_camera_rests": True}, counts),
        ({"u_camera_rests": True, "u_known": False}, counts),
        ({"u_camera_rests": True, "u_moves": True}, moving),
        ({"u_camera_rests": True, "u_stayed": False}, 0 * counts),
        ({"u_camera_rests": True, "u_stayed": False, "u_most": 3.0}, 0 * counts),
        ({"u_camera_rests": True, "u_stayed": False, "u_moves": True}, moving),
        ({"u_camera_rests": True, "u_most": 3.0}, np.minimum(counts, 3)),
        ({"u_camera_rests": True, "u_most": 12.0}, np.minimum(counts, 12)),
        ({"u_most": 3.0}, np.minimum(counts, 3)),
        ({"u_keep": False}, 0 * counts),
    ):
        found = resolved(egl, color, history, **given)[0]
        known = np.stack([8 * kept, 4 + 0 * kept, 2 * kept + 2, (kept + 1) ** 2], axis=-1) / (kept + 1)[..., None]
        np.testing.assert_allclose(found, known, rtol=4 * ULP, atol=4 * ULP)


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
def test_neither_a_poisoned_sample_nor_a_poisoned_history_leaves_a_trace(
    egl: Context, poison: float, still: bool
) -> None:
    clean = np.broadcast_to(np.float32((1, 2, 3, 4)), (1, 9, 4))
    spoilt = clean.copy()
    for k in range(4):
        spoilt[0, k, k] = poison
        spoilt[0, 4 + k, :] = poison
    sound = resolved(egl, clean, spoilt, still=still)[0]
    np.testing.assert_allclose(sound, [[(1, 2, 3, 4)] * 8 + [(1, 2, 3, 8)]], rtol=4 * ULP)
    sound = resolved(egl, spoilt, clean, still=still)[0]
    np.testing.assert_allclose(sound, [[(1, 2, 3, 4)] * 8 + [(1, 2, 3, 8)]], rtol=4 * ULP)
    nothing = resolved(egl, spoilt, spoilt, still=still)[0]
    assert not nothing[0, :8].any(), "no sample at all is black, and counts none"


# What changed since the frame before.


def changed_text(call: str) -> str:
    """A pass of one call of the module, `at` being the pixel."""
    main = f"void main() {{ ivec2 at = ivec2(gl_FragCoord.xy); c = {call}; }}"
    return OUT + modules("temporal/finite", "temporal/changed", before="uniform sampler2D u_color;", after=main)


@pytest.mark.parametrize("change", [0.0, 0.01, 0.1, 1.0])
def test_as_many_samples_are_kept_as_make_the_error_least(egl: Context, change: float) -> None:
    """The least of the sum of lag and noise, found by trying all; a quarter of the variance around is noise."""
    now = np.random.default_rng(3).random((9, 12, 4)).astype(np.float32)
    now[..., 3] = 1
    before = now.copy()
    before[..., 1] -= np.float32(change)
    given = {"u_color": now, "u_earlier_color": before, "u_changed": True}
    found = draw(egl, changed_text("vec4(samples_kept(at, 10.0))"), (12, 9), given)[0][..., 0]
    noise = 0.25 * around(now[..., :3].astype(float)).var(axis=2).sum(axis=2)
    tried = np.linspace(0, 10, 2001)
    cost = tried**2 * change**2 + noise[..., None] / (2 * tried + 1)
    np.testing.assert_allclose(found, tried[cost.argmin(axis=2)], atol=0.05)
    given["u_changed"] = False
    assert np.all(draw(egl, changed_text("vec4(samples_kept(at, 10.0))"), (12, 9), given)[0] == 10)


@pytest.mark.parametrize("poison", [np.nan, np.inf])
def test_a_sample_that_is_not_finite_counts_neither_as_noise_nor_as_change(egl: Context, poison: float) -> None:
    now = np.random.default_rng(3).random((7, 9, 4)).astype(np.float32)
    now[..., 3] = 1
    before = now.copy()
    before[..., 1] -= np.float32(0.1)
    now[3, 4, 1] = poison
    given = {"u_color": now, "u_earlier_color": before, "u_changed": True}
    found = draw(egl, changed_text("vec4(samples_kept(at, 10.0))"), (9, 7), given)[0][..., 0]
    near = around(now[..., :3].astype(float))
    near[~np.isfinite(near).all(axis=3)] = np.nan
    noise, tried = 0.25 * np.nanvar(near, axis=2).sum(axis=2), np.linspace(0, 10, 2001)
    cost = tried**2 * 0.1**2 + noise[..., None] / (2 * tried + 1)
    np.testing.assert_allclose(found, tried[cost.argmin(axis=2)], atol=0.05)


def test_what_changes_in_one_pixel_counts_in_all_around(egl: Context) -> None:
    now = np.ones((7, 9, 4))
    before = now.copy()
    before[3, 4, :3] = 0
    given = {"u_color": now, "u_earlier_color": before, "u_changed": True}
    kept = draw(egl, changed_text("vec4(samples_kept(at, 10.0))"), (9, 7), given)[0][..., 0]
    expected = np.full((7, 9), 10.0)
    expected[0:7, 1:8] = 0
    np.testing.assert_allclose(kept, expected, atol=1e-5)


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
def test_no_sample_is_kept_of_a_point_that_was_not_there_and_of_none_that_is_not_finite(
    egl: Context, poison: float
) -> None:
    now = np.ones((1, 8, 4))
    before = now.copy()
    before[0, 2, 3] = 0
    before[0, 6, 1] = poison
    ways = np.ones((1, 8, 4))
    ways[0, 6, 1] = poison
    given = {"u_color": now, "u_earlier_color": before, "u_earlier_motion": ways, "u_changed": True}
    kept = draw(egl, changed_text("vec4(samples_kept(at, 10.0))"), (8, 1), given)[0][0, :, 0]
    assert kept.tolist() == [10, 10, 0, 10, 10, 10, 0, 10]
    way = draw(egl, changed_text("vec4(motion_vector(at), 0.0)"), (8, 1), given)[0][0, :, 0]
    assert way.tolist() == [1, 1, 1, 1, 1, 1, 0, 1]


@pytest.mark.parametrize("jitter", [(0.0, 0.0), (0.4, -0.3), (-0.5, 0.5), (0.25, 0.25)])
def test_samples_beside_the_middle_tell_of_the_middle(egl: Context, jitter: tuple[float, float]) -> None:
    """At random straight edges they err less than a sample in the middle; a long history takes the sample itself."""
    random = np.random.default_rng(7)
    y, x = np.mgrid[:48, :64].astype(float)
    angle = random.uniform(0, 2 * np.pi, 40)
    errors = {"joined": 0.0, "middle": 0.0}
    inner = np.stack(np.meshgrid(*[(np.arange(8) + 0.5) / 8 - 0.5] * 2), axis=-1).reshape(-1, 2)
    for a in angle:

        def lit(dx: float, dy: float, a: float = a) -> np.ndarray:
            return ((x + dx - 32) * np.cos(a) + (y + dy - 24) * np.sin(a) > 0).astype(float)

        truth = np.mean([lit(*at) for at in inner], axis=0)
        drawn = np.repeat(lit(*jitter)[..., None], 4, axis=2)
        drawn[..., 3] = 1
        given = {"u_color": drawn, "u_jitter": jitter, "u_changed": True}
        text = "uniform vec2 u_jitter;\n" + changed_text("filter_sample(at, texelFetch(u_color, at, 0), u_jitter, 0.0)")
        found = draw(egl, text, (64, 48), given)[0][..., 0]
        errors["joined"] += float(np.sum((found - truth)[2:-2, 2:-2] ** 2))
        errors["middle"] += float(np.sum((lit(0, 0) - truth)[2:-2, 2:-2] ** 2))
    assert errors["joined"] < 0.9 * errors["middle"], errors
    text = "uniform vec2 u_jitter;\n" + changed_text("filter_sample(at, texelFetch(u_color, at, 0), u_jitter, 1.0)")
    np.testing.assert_array_equal(draw(egl, text, (64, 48), given)[0], drawn.astype(np.float32))


# A point in the frame before.

EARLIER = """
struct Ray { vec3 origin; vec3 direction; };
struct Hit { bool found; float t; };
uniform sampler2D u_surface;
uniform vec2 u_resolution;
uniform vec3 u_camera_position;
uniform mat3 u_camera_frame;
uniform float u_pixel, u_facing, u_moved, u_gap, u_steepness;
float u_side = 0.0;
Hit no_hit(float t) { return Hit(false, t); }
float field(vec3 p) {
    float r = u_steepness * u_facing * (p.z + 2.0);
    return u_gap > 0.0 ? u_facing * length(vec2(r, u_gap)) : r;
}
vec3 surface_normal(vec3 p, vec3 direction) { return vec3(0.0, 0.0, u_facing); }
vec3 previous_position(vec3 p) { return p + vec3(0.0, 0.0, u_moved); }
vec3 shade(Ray ray, Hit hit) { return vec3(u_side, float(hit.found), hit.t); }
"""


@pytest.mark.parametrize("facing", [1.0, -1.0])
@pytest.mark.parametrize("steepness", [1.0, 0.3, 0.0])
@pytest.mark.parametrize(("moved", "gap"), [(0.0, 0.0), (0.01, 0.0), (-0.01, 0.0), (0.01, 0.5)])
def test_a_point_is_shaded_where_it_was(
    egl: Context, facing: float, steepness: float, moved: float, gap: float
) -> None:
    """A plane at z = -2, from the side of its normal and from inside. A shape that changed is found from near by,
    unless a gap or no slope hides it."""
    size = (8, 6)
    text = modules("temporal/before", before=EARLIER, variants=frozenset({"OWN_START"}))
    x, y = np.meshgrid(np.arange(8) + 0.5, np.arange(6) + 0.5)
    screen = np.stack([(2 * x - 8) / 6, (2 * y - 6) / 6], axis=2) * 0.5
    t = 2 * np.sqrt(1 + np.sum(screen**2, axis=2))
    t[0, 0] = -1.0  # the sky
    values = {
        "u_surface": np.dstack([t, *np.zeros((3, 6, 8))]),
        "u_resolution": size,
        "u_now_frame": np.eye(3),
        "u_camera_frame": np.eye(3),
        "u_now_position": (0.0, 0.0, 0.0),
        "u_camera_position": (0.0, 0.0, 0.0),
        "u_now_tan_half_fov": 0.5,
        "u_jitter": (0.0, 0.0),
        "u_pixel": 0.01,
        "u_facing": facing,
        "u_moved": moved,
        "u_gap": gap,
        "u_steepness": steepness,
    }
    color, motion = draw(egl, text, size, values, attachments=2)
    np.testing.assert_array_equal(color[0, 0], (0.0, 0.0, 0.0, 1.0))
    np.testing.assert_array_equal(motion[0, 0], 0.0)
    color, motion, t = color.reshape(-1, 4)[1:], motion.reshape(-1, 4)[1:], t.ravel()[1:]
    np.testing.assert_array_equal(color[:, 3], float(gap == 0.0))
    assert np.all(np.isfinite(motion))
    if gap == 0.0:
        np.testing.assert_array_equal(color[:, :2], [(facing, 1.0)] * 47)
        near = 0.1 * 0.01 * t * (1 + 1e-3)  # a tenth of a pixel
        assert np.all(steepness * np.abs(2 - 2 * color[:, 2] / t) <= near)
        assert np.all(steepness * np.abs(motion[:, 2]) <= near) and not motion[:, :2].any()
    else:
        np.testing.assert_array_equal(color[:, :3], 0.0)


def test_a_pixel_has_the_samples_of_the_place_that_it_was_at(egl: Context) -> None:
    """Not as few as stand where it is now."""
    counts = np.array([[0.0, 3, 9, 10, 1000, 2]])
    history = np.stack([counts * 0 + 8, counts * 0, counts * 0 + 2, counts], axis=-1)
    color = np.broadcast_to(np.float32((0, 4, 2, 1)), history.shape)
    found = resolved(egl, color, history, u_beside=1.0)[0]
    assert np.array_equal(found[0, :-1, 3], np.minimum(counts[0, 1:], 10) + 1)


@pytest.mark.parametrize("variant", ["ORTHOGRAPHIC", ""])
def test_surfaces_at_other_distances_are_not_alike(egl: Context, variant: str) -> None:
    """Nearer as well as farther."""
    text = OUT + "uniform sampler2D u_history;\nvec3 motion_vector(ivec2 at) { return vec3(0.0); }\n"
    names = ("temporal/finite", "temporal/reproject", "temporal/rest")
    made = modules(*names, before=text, variants=frozenset({variant} - {""})).replace(OUT, "")
    cases = [(10.0, 10.0, True), (10.01, 10.0, True), (9.99, 10.0, True), (8.0, 10.0, False), (12.0, 10.0, False)]
    was, now, alike = zip(*((facing("z", a), facing("z", b), same) for a, b, same in cases), strict=True)
    given = {"u_before_half_height": 1.0} if variant else {}
    found = run(egl, made, "is_alike({0}, {1}) ? 1.0 : 0.0", [(VEC4, was), (VEC4, now)], uniforms=given)
    assert [bool(same) for same in found] == list(alike)
