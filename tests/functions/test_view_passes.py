"""The passes of a picture, each whole, with stand-ins for the rays and for what they meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.expr.types import VEC2, VEC3
from raymarch.gpu.context import Context
from tests.support.glsl_harness import draw, modules, run
from tests.support.required import needs_extension

ULP = 2.0**-24
CLOCK = "GL_ARB_shader_clock"
RAY = """
struct Ray { vec3 origin; vec3 direction; };
Ray camera_ray(vec2 pixel) { return Ray(vec3(0.0, 0.0, 10.0), vec3(pixel, -1.0)); }
"""
MET = """
uniform sampler2D u_met;  // found, done, distance, residual
uniform sampler2D u_lit;
Hit trace(Ray ray) {
    vec4 met = texelFetch(u_met, ivec2(gl_FragCoord.xy), 0);
    return Hit(met.y > 0.0, met.x > 0.0, met.z, met.w, 20.0, 30.0, 2.0);
}
vec3 shade(Ray ray, Hit hit) {
    if (!hit.found) return vec3(4.0, 5.0, 6.0);
    return texelFetch(u_lit, ivec2(gl_FragCoord.xy), 0).rgb;
}
vec3 surface_normal(vec3 p, vec3 direction) { return texelFetch(u_lit, ivec2(gl_FragCoord.xy), 0).rgb; }
vec3 visible_side(vec3 normal, vec3 direction) { return normal; }
float material_index(vec3 p) { return p.z; }
"""
SHAPE = (4, 6, 4)


def passed(
    egl: Context, name: str, *others: str, count: int = 1, start: str = "", extra: str = "", **given: Any
) -> list[np.ndarray]:
    """What a pass draws; the left half of the picture meets something at 2, the right half nothing up to 7."""
    given = {"u_met": halves((1, 1, 2, 0.5), (0, 1, 7, 0.25)), "u_lit": halves((1, 2, 3, 0)), **given}
    with_hits = modules("march/hit", before=start + RAY, after=MET + extra)
    return draw(egl, with_hits + modules(*others, name), given["u_met"].shape[1::-1], given, count)


def halves(left: tuple[float, ...], right: tuple[float, ...] | None = None) -> np.ndarray:
    picture = np.empty(SHAPE, np.float32)
    picture[:, :3], picture[:, 3:] = left, left if right is None else right
    return picture


ACCUMULATED = ("temporal/finite", "view/accumulate")
PROBED = """
const float color_fault = 12.0;
vec2 surface_faults(vec3 p) { return vec2(u_broken ? 35.0 : 0.0, p.z); }
"""


@pytest.mark.parametrize("name", ["color", "accumulate", "sample", "lipschitz", "nonfinite", "cycles"])
def test_a_pixel_has_the_colour_of_what_it_meets_or_of_the_sky(egl: Context, name: str) -> None:
    others, count, at, start, extra = ("temporal/finite",), 1, 0, "", ""
    if name in ("color", "cycles"):
        others = (*others, "view/pixel_color")
    if name == "cycles":
        needs_extension(egl, CLOCK)
        start = f"#extension {CLOCK} : require\n"
    if name == "lipschitz":
        others, count, at = (*others, "probe/watch"), 3, 2
    if name == "nonfinite":
        others, count, at, start, extra = (*others, "probe/note"), 3, 2, "uniform bool u_broken;\n", PROBED
    if name == "sample":
        count = 2
    color = passed(egl, f"view/{name}", *others, count=count, start=start, extra=extra)[at]
    known = halves((1, 2, 3, 1), (4, 5, 6, 1))
    if name == "cycles":
        color, known = color[..., 1:], known[..., :3]
    assert np.array_equal(color, known)


def test_cycles_are_counted_for_each_pixel(egl: Context) -> None:
    """The second reading is not before the colour is known."""
    needs_extension(egl, CLOCK)
    assert np.all(
        passed(egl, "view/cycles", "view/pixel_color", start=f"#extension {CLOCK} : require\n")[0][..., 0] > 0
    )


def test_samples_are_averaged(egl: Context) -> None:
    history = halves((8, 0, 2, 1), (8, 0, 2, 3))
    color = passed(egl, "view/accumulate", "temporal/finite", u_history=history, u_keep=True)[0]
    np.testing.assert_allclose(color, halves((4.5, 1, 2.5, 2), (7, 1.25, 3, 4)), rtol=4 * ULP)
    assert np.array_equal(
        passed(egl, "view/accumulate", "temporal/finite", u_history=history, u_keep=False)[0],
        halves((1, 2, 3, 1), (4, 5, 6, 1)),
    )


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
def test_neither_a_poisoned_sample_nor_a_poisoned_history_leaves_a_trace(egl: Context, poison: float) -> None:
    def drawn(lit: np.ndarray, history: np.ndarray, keep: bool = True) -> np.ndarray:
        return passed(egl, "view/accumulate", "temporal/finite", u_lit=lit, u_history=history, u_keep=keep)[0][:, :3]

    clean, history = halves((1, 2, 3, 0)), halves((1, 2, 3, 4))
    spoilt, before = clean.copy(), history.copy()
    for k in range(3):
        spoilt[0, k, k] = poison
        before[0, k, k] = before[1, k, 3] = poison
    spoilt[1:] = before[2:] = poison
    assert np.array_equal(drawn(clean, before), np.broadcast_to(np.float32((1, 2, 3, 1)), (4, 3, 4)))
    assert np.array_equal(drawn(spoilt, history), history[:, :3])
    for none in (drawn(spoilt, before), drawn(spoilt, history, keep=False)):  # of no sample: told, and then forgotten
        assert not np.isfinite(none).all(axis=-1).any()
        assert np.array_equal(drawn(clean, np.resize(none, history.shape)), drawn(clean, before))


def test_what_was_hit_and_what_it_took(egl: Context) -> None:
    met = halves((1, 1, 2, 0.5), (0, 1, 7, 0.25))
    met[0, :, 1] = 0  # the march came to no end
    march, surface, more = passed(egl, "view/geometry", count=3, u_met=met, u_side=1.0)
    assert np.array_equal(march, halves((2, 0.5, 20, 30), (-1, 0, 20, 30)))  # a miss has no residual
    assert np.array_equal(surface, halves((1, 2, 3, 8), (0, 0, 0, -1)))
    ended = halves((2, 1, 2, 0), (2, 1, 7, 0))
    ended[0, :, 1] = 0
    assert np.array_equal(more, ended)


def test_the_sample_of_a_pixel_holds_what_it_saw(egl: Context) -> None:
    """A depth, a normal that can be unfolded again in both hemispheres, on the axes too, and the material."""
    n = np.random.default_rng(7).normal(size=(40, 60, 3))
    n[:10, :, 2] = 0
    n[10:20, :, 0] = 0
    n[20:30, :, 1] = 0
    n[0, :6] = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    lit = np.concatenate([n, np.zeros((40, 60, 1))], axis=2)
    met = np.broadcast_to(np.float32((1, 1, 2, 0)), lit.shape)
    surface = passed(egl, "view/sample", count=2, u_met=met, u_lit=lit, u_side=1.0)[1]
    assert np.all(surface[..., 0] == 2) and np.all(surface[..., 3] == 8)
    e = surface[..., 1:3].reshape(-1, 2).astype(float)
    assert np.abs(e).max() <= 1 + 4 * ULP
    upper = np.abs(e).sum(axis=1) <= 1 + 4 * ULP
    assert np.array_equal(upper, n[..., 2].ravel() >= 0), "the upper half is the inner square"
    text = modules("temporal/finite", "temporal/reproject", before="uniform sampler2D u_history;")
    np.testing.assert_allclose(
        run(egl, text, "decode_octahedral({0})", [(VEC2, e)], 3), n.reshape(-1, 3), atol=16 * ULP
    )
    missed = passed(egl, "view/sample", count=2, u_met=0 * met)[1]
    assert np.all(missed == (-1, 0, 0, -1))


# The cones.

CONED = """
uniform sampler2D u_range;  // where the range of the cone begins and ends, the cone's slope, where a coarser cone ends
uniform sampler2D u_march;  // what the march finds: distance, field, slope, 1 if a surface
const vec2 u_cell = vec2(2.0, 3.0);
float u_cone = texelFetch(u_range, ivec2(gl_FragCoord.xy), 0).z;
vec2 range_of(Ray ray) { return texelFetch(u_range, ivec2(gl_FragCoord.xy), 0).xy; }
bool carry_on(inout March at, inout vec2 spent) {
    float carried = texelFetch(u_range, ivec2(gl_FragCoord.xy), 0).w;
    spent = vec2(5.0, 6.0);
    at.t = max(at.t, carried);
    return carried >= 0.0;
}
void march(Ray ray, inout March at, inout Hit hit, float far) {
    vec4 known = texelFetch(u_march, ivec2(gl_FragCoord.xy), 0);
    at.t = known.x;
    at.r = known.y;
    at.derivative = known.z;
    hit.found = known.w > 0.0;
    hit.iterations = 7.0;
    hit.evaluations = 12.0;
}
"""


def cones(egl: Context, cases: list[tuple[tuple[float, ...], tuple[float, ...]]]) -> np.ndarray:
    ranges, marches = (np.array([list(side)]) for side in zip(*cases, strict=True))
    text = modules("march/hit", "march/start_published", before=RAY, after=CONED) + modules("view/cone")
    return draw(egl, text, (len(cases), 1), {"u_range": ranges, "u_march": marches})[0][0]


def test_how_far_a_cone_is_free(egl: Context) -> None:
    """Never a negative distance where something may be met: that would say that nothing can be."""
    cases = {
        "stops at a surface": (((1, 9, 0.5, 0), (4, 0.25, 0.5, 1)), (4.25, 1.25, 12, 8)),
        "stops within a solid": (((0, 9, 0.5, 0), (0.125, -0.5, 0.5, 1)), (0, 1.25, 12, 8)),
        "runs out of steps": (((1, 9, 0.5, 0), (4, 0.25, -0.5, 0)), (4.25, -0.25, 12, 8)),
        "is free to its end": (((1, 9, 0.5, 0), (8, 2, 0.25, 0)), (-1, 0.875, 12, 8)),
        "finds at its very end": (((1, 9, 0.5, 0), (8, 2, 0.25, 1)), (10, 0.875, 12, 8)),
        "has no range": (((2, 1, 0.5, 0), (4, 0.25, 0.5, 1)), (-1, -1, 0, 0)),
        "lies in free cones": (((1, 9, 0.5, -1), (4, 0.25, 0.5, 1)), (-1, -1, 5, 6)),
        "starts behind its range": (((1, 9, 0.5, 9.5), (4, 0.25, 0.5, 1)), (-1, -1, 5, 6)),
        "knows no slope": (((1, 9, 0.5, 0), (4, 0.25, -1, 1)), (4.25, -1, 12, 8)),
    }
    found = cones(egl, [case for case, _ in cases.values()])
    assert dict(zip(cases, found.tolist(), strict=True)) == {name: list(known) for name, (_, known) in cases.items()}


def test_an_unknown_slope_stays_unknown_however_wide_the_cone(egl: Context) -> None:
    """To the bit: a slope of -1 + 2^-24 would be taken for known."""
    widths = np.random.default_rng(8).uniform(0, 0.5, 2000)
    found = cones(egl, [((1, 9, width, 0), (4, 0.25, -1, 1)) for width in widths])
    assert np.all(found[:, 1] == -1)


# The slice.


def sliced(egl: Context, plane: tuple[float, ...], origin: tuple[float, ...]) -> np.ndarray:
    """Where the rays through 4 x 3 pixels, (x, y, -1) from the origin, meet a plane: the field is z, slope 3."""
    before = f"""
    struct Ray {{ vec3 origin; vec3 direction; }};
    Ray camera_ray(vec2 pixel) {{ return Ray(vec3{origin}, vec3(pixel - vec2(2.0, 1.5), -1.0)); }}
    vec4 field_gradient(vec3 p) {{ return vec4(0.0, 0.0, 3.0, p.z); }}
    """
    return draw(egl, modules("view/slice", before=before), (4, 3), {"u_slice": plane})[0]


def test_a_slice_shows_the_field_where_rays_meet_it(egl: Context) -> None:
    assert np.all(sliced(egl, (0, 0, 1, -2), (0.0, 0.0, 3.0)) == (-2, 3, 5, 1)), "z = -2 before the camera"
    assert np.all(sliced(egl, (0, 0, 1, 5), (0.0, 0.0, 3.0)) == (0, 0, -1, 0)), "z = 5 behind it"
    floor = sliced(egl, (0, 1, 0, -1), (0.0, 0.0, 3.0))
    assert np.all(floor[0] == (2, 3, 1, 1)), "down: y falls by 1 while z falls by 1"
    assert np.all(floor[1:] == (0, 0, -1, 0)), "along y = -1, or away from it"


def test_rays_in_the_plane_of_a_slice_meet_it_at_the_camera(egl: Context) -> None:
    """The middle row looks along y = 0, from it: it is not to be undefined, and not to be beside the plane."""
    found = sliced(egl, (0, 1, 0, 0), (0.0, 0.0, 3.0))
    assert np.all(found == (3, 3, 0, 1))
    for beside in (1e-30, 1e-3, 0.5, 2.0, 1e30):
        for side in (beside, -beside):
            assert np.all(sliced(egl, (0, 1, 0, side), (0.0, 0.0, 3.0))[1] == (0, 0, -1, 0)), "near it, yet never met"


def test_points_of_a_lens_keep_the_areas_of_the_square(egl: Context) -> None:
    """Squares about the centre become circles (Shirley and Chiu 1997), and the centre stays."""
    before = """
        uniform int u_sample;
        vec2 drawn;
        int calls;
        uint pcg(uint v) { calls++; return uint((calls == 2 ? drawn.x : drawn.y) * 16777216.0) << 8; }
    """
    after = "vec2 point(vec2 x) { drawn = x; calls = 0; return lens_point(); }"
    drawn = np.vstack([np.random.default_rng(2).uniform(0, 0.999, (500, 2)), [(0.5, 0.5), (0.5, 0.9), (0.1, 0.5)]])
    text = modules("view/lens", before=before, after=after)
    found = run(egl, text, "point({0})", [(VEC2, drawn)], 2, {"u_sample": 0, "u_lens": (0.25, 3.0)})
    x, y = (2 * drawn.astype(np.float32).astype(float) - 1).T
    wide = np.abs(x) > np.abs(y)
    r = np.where(wide, x, y)
    share = np.divide(np.where(wide, y, x), r, out=np.zeros_like(r), where=r != 0)
    angle = np.pi / 4 * np.where(wide, share, 2 - share)
    np.testing.assert_allclose(found, 0.25 * r[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1), atol=1e-6)


def test_an_orbit_begins_where_the_camera_is(egl: Context) -> None:
    """Also almost straight above and below its target, where rounding may raise the sine of its elevation above 1."""
    random = np.random.default_rng(4)
    ups, sides = random.normal(size=(2, 600, 3))
    sides = np.cross(ups, sides)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    away = np.geomspace(1e-3, 1e3, 600)[:, None] * (ups / np.linalg.norm(ups, axis=1, keepdims=True) + 2e-4 * sides)
    away[::2] *= -1
    after = "vec3 placed(vec3 away, vec3 up) { place_camera(away, vec3(0.0), up); return u_camera_position; }"
    text = modules("view/pose", after=after)
    inputs = [(VEC3, away), (VEC3, ups)]
    uniforms = {"u_orbit": (1e-30, 0.0, 0.0), "u_pan": (0.0, 0.0)}
    found = run(egl, text, "placed({0}, {1})", inputs, 3, uniforms)
    off = np.linalg.norm(found - away, axis=1) / np.linalg.norm(away, axis=1)
    assert np.max(off) < 2e-3  # asin is the driver's own


def test_an_orbit_ends_just_before_the_axis(egl: Context) -> None:
    """However far the pointer is moved, the camera sees its target with the axis upwards."""
    text = modules("view/pose").replace("uniform vec3 u_orbit;", "vec3 u_orbit;")
    after = "vec3 placed(vec3 orbit) { u_orbit = orbit; place_camera(vec3(2.0, 0.0, 0.0), vec3(0.0),"
    after += " vec3(0.0, 0.0, 1.0));"
    after += " return u_camera_position; }"
    moved = np.array([0.5, 1.5, 3.0, -1.5, -3.0])
    orbits = np.column_stack([0 * moved, moved, 0 * moved])
    found = run(egl, text + after, "placed({0})", [(VEC3, orbits)], 3, {"u_pan": (0.0, 0.0)})
    known = np.clip(moved, -1.55, 1.55)
    np.testing.assert_allclose(found, 2 * np.column_stack([np.cos(known), 0 * known, np.sin(known)]), atol=1e-5)


@pytest.mark.parametrize("samples", [0, 3])
def test_a_picture_is_black_where_no_light_is_finite_and_never_below_or_above_its_range(
    egl: Context, samples: int
) -> None:
    """Its tone curve gets nothing negative, and nothing that is infinite."""
    before = f"""
        struct Ray {{ vec3 origin; vec3 direction; }};
        struct Hit {{ bool done; }};
        const int picture_samples = {samples};
        vec3 light;
        void begin_sample(int i) {{}}
        vec2 sample_offset(int i) {{ return vec2(0.0); }}
        Ray camera_ray(vec2 pixel) {{ return Ray(vec3(0.0), vec3(0.0)); }}
        Hit trace(Ray ray) {{ return Hit(true); }}
        vec3 shade(Ray ray, Hit hit) {{ return light; }}
        vec3 toned(vec3 c) {{ return 2.0 * c / (1.0 + c); }}
        float linear_to_srgb(float c) {{ return c; }}
    """
    after = "vec3 shown(vec3 x) { light = x; return picture(vec2(0.0)); }"
    variants = frozenset({"SAMPLES"} if samples else ())
    text = modules("temporal/finite", "view/pixel_color", "view/picture", before=before, after=after, variants=variants)
    light = np.array(
        [(1 / 3, 3.0, 0.0), (-2.0, -1.0, -0.5), (np.inf, 1.0, 1.0), (1.0, np.nan, 1.0), (0.0, -np.inf, 0.0)]
    )
    known = np.zeros((5, 3))
    known[0] = (0.5, 1.0, 0.0)
    np.testing.assert_allclose(run(egl, text, "shown({0})", [(VEC3, light)], 3), known, rtol=8 * ULP)


def test_each_pixel_keeps_another_sample_of_one_ray(egl: Context) -> None:
    """Kinds are told after a sample; a ray of fewer samples leaves the other pixels empty."""
    marching = """
    uniform vec2 u_resolution;
    struct Ray { vec3 origin; vec3 direction; };
    struct Hit { bool found; float t; };
    Ray camera_ray(vec2 pixel) { return Ray(vec3(pixel, 0.0), vec3(0.0)); }
    """
    traced = """
    Hit trace(Ray ray) {
        note_sample(ray.origin.x, 1.0, 0.5, STARTS);
        note_sample(ray.origin.y, 2.0, 1.5, SEARCHES);
        note_kind(IS_UNDONE);
        note_sample(7.0, 3.0, 2.5, REFINES);
        return Hit(ray.origin.x < 5.0, 9.0);
    }
    """
    text = modules("march/note", before=marching, after=traced) + modules("view/ray")
    for x, end in ((4.5, 9.0), (5.5, -1.0)):
        given = {"u_resolution": (2.0, 2.0), "u_ray_pixel": (x, 8.5)}
        samples, ends = draw(egl, text, (2, 2), given, 2)
        assert samples.reshape(-1, 4).tolist() == [[x, 1, 0.5, 3], [8.5, 2, 1.5, 2], [7, 3, 2.5, 1], [-1] * 4]
        assert np.array_equal(ends, np.full((2, 2, 4), (end, 3.0, 0.0, 0.0), np.float32))
