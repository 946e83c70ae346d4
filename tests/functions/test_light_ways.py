"""Rays of light past balls, as single functions with all that a solid may tell: against closed forms in float64."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import FLOAT, VEC4
from raymarch.gpu.context import Context
from tests.functions.profiles import FIELD, FREE, Profiles
from tests.support.glsl_harness import modules, run, run_all

COUNT, FAR, PIXEL = 1500, 4.0, 0.002
BEFORE = """
struct Ray { vec3 origin; vec3 direction; };
struct Surface { vec3 p; vec3 normal; float t; };
struct Light { vec3 direction; float distance; vec3 radiance; };
const float epsilon_pixels = 0.1;
const float contact_share = 0.0625;
const float smoothing = 0.3;
const int shadow_steps = 512;
const int secondary_steps = 512;
const float u_far = 2.0;
vec4 a, b, c;
float asked = 0.0;
vec2 scene_box(Ray ray, vec2 range) { return vec2(range.x, min(range.y, 4.0)); }
vec2 scene_cone(Ray ray, vec2 range, float width) { return range; }
vec3 geometric_normal(Surface surface) { return surface.normal; }
float field(vec3 p) {
    asked += 1.0;
    float balls = min(length(p - a.xyz) - a.w, min(length(p - b.xyz) - b.w, length(p - c.xyz) - c.w));
    return min(p.z, balls);
}
float undivided_field(vec3 p) { return field(p); }
float divided(float value) { return value; }
// How far from p nothing of a ball is nearer than a distance that grows along the ray.
float way_to(vec3 p, vec3 direction, vec4 ball, float level, float growth) {
    vec3 to = ball.xyz - p;
    float along = dot(to, direction) + growth * (ball.w + level);
    float square = 1.0 - growth * growth;
    float rest = dot(to, to) - (ball.w + level) * (ball.w + level);
    float inner = along * along - square * rest;
    if (rest <= 0.0) return 0.0;
    if (inner <= 0.0 || along <= 0.0) return 1.0e3;
    return rest / (along + sqrt(inner)) * (1.0 - 1.0e-6);
}
vec2 field_advance(vec3 p, vec3 direction, float level, float growth) {
    float f = field(p);
    float way = min(way_to(p, direction, a, level, growth), way_to(p, direction, b, level, growth));
    way = min(way, way_to(p, direction, c, level, growth));
    if (direction.z <= growth) way = 0.0;
    return vec2(f, f < 0.0 ? f : max(way, f - level));
}
"""
NAMES = "march/widths march/nearness march/epsilon march/contact march/hit march/safe_step march/auto_relaxed".split()
LATER = "march/advance march/extrapolate light/spawn_ray light/shadow_ray light/half_chord".split()


def text(kind: str, after: str, variants: frozenset[str] = frozenset(), before: str = BEFORE) -> str:
    ahead = ["march/rounding", "march/way_ahead"] if variants & {"AHEAD", "ADVANCE"} else ["march/rounding"]
    ahead += ["light/free_ahead"] if "AHEAD" in variants else []
    doubts = ["march/membrane", *(["march/doubt_ahead"] if "ADVANCE" in variants else [])] if "CUTS" in variants else []
    refine = ["march/refine"] if doubts else []
    soft = (
        ["light/clearance", "light/beside_edge", "light/seven"]
        if kind not in ("light/shadow", "path/secondary")
        else []
    )
    used = variants | ({"ADVANCE"} if "AHEAD" in variants else set())
    names = [*NAMES, *refine, *ahead, *doubts, *LATER, *soft, *([] if kind == "light/clearance" else [kind])]
    return modules(*names, before=before, after=after, variants=frozenset(used))


def balls(seed: int = 51) -> NDArray[np.float32]:
    """Three balls each, (3, N, 4): before, beside and across the z axis, none at its start."""
    rng = np.random.default_rng(seed)
    s = rng.uniform(0.3, 1.2 * FAR, (3, COUNT))
    off, radius = 10 ** rng.uniform(-2.5, 0.3, (3, COUNT)), 10 ** rng.uniform(-2.5, -0.5, (3, COUNT))
    across = rng.random((3, COUNT)) < 0.12
    off = np.where(across, radius * rng.uniform(0, 1, (3, COUNT)), off + radius)
    turn = rng.uniform(0, 2 * np.pi, (3, COUNT))
    s = np.maximum(s, radius + 0.1)
    return np.stack([off * np.cos(turn), off * np.sin(turn), s, radius], axis=2).astype(np.float32)


def along(given: NDArray[np.float32], s: NDArray[Any]) -> NDArray[np.float64]:
    """The field at distances on the axis, (N, M)."""
    x, y, z, r = np.moveaxis(given.astype(float), 2, 0)[..., None]
    return np.minimum(np.min(np.sqrt(x * x + y * y + (s - z) ** 2) - r, axis=0), s)


def free_cone(given: NDArray[np.float32], end: float) -> NDArray[np.float64]:
    """The sine of the half angle of the cone that is free up to all balls before an end, (N,); below 0 if the axis
    meets one."""
    x, y, z, r = np.moveaxis(given.astype(float), 2, 0)
    off, far = np.hypot(x, y), np.sqrt(x * x + y * y + z * z)
    sines = np.sin(np.arctan2(off, z) - np.arcsin(r / far))
    return np.where(z + r < end, sines, 1.0).min(axis=0)


def asked_of(given: NDArray[np.float32], more: Any) -> list[tuple[Any, NDArray[Any]]]:
    return [*((VEC4, ball) for ball in given), (VEC4, np.broadcast_to(more, (COUNT, 4)))]


UNIFORMS = {"u_pixel": PIXEL, "u_side": 1.0}
START, FIRST, NEAR = 0.01, 0.03, 1e-4
CLEAR = f"""
vec4 cleared(vec4 x, vec4 y, vec4 z, vec4 more) {{
    a = x;
    b = y;
    c = z;
    vec2 range = vec2({START}, {FAR});
    float found = clearance(Ray(vec3(0.0), vec3(0.0, 0.0, 1.0)), range, {FIRST}, {NEAR}, more.x, more.y > 0.5);
    return vec4(found, range, asked);
}}
"""
FIGURES = {
    ("", False): (20.0207, 0.665740),
    ("", True): (21.6133, 0.665740),
    ("AHEAD", False): (6.8400, 3.173498),
    ("AHEAD", True): (11.8927, 1.344593),
    ("HALVED", True): (36.8633, 0.586850),
    ("HALVED UNDIVIDED", False): (28.1260, 0.600199),
    ("HALVED UNDIVIDED", True): (30.8593, 0.613409),
}
"""Mean evaluations, and the length of the range that is left, for what is known of the field, and for rays that go on
to find how deep they are. Rules of clearance.glsl decide both; whoever changes one sees here what it gives."""


def cleared(egl: Context, known: str, deep: bool, given: Any, width: Any) -> NDArray[np.float64]:
    made = text("light/clearance", CLEAR, frozenset(known.split()))
    more = np.column_stack([width, np.full(COUNT, float(deep)), np.zeros((COUNT, 2))])
    (found,) = run_all(egl, made, [("cleared({0}, {1}, {2}, {3})", 4)], asked_of(given, more), UNIFORMS)
    return found.astype(float)


def widths() -> NDArray[np.float64]:
    return 10 ** np.random.default_rng(52).uniform(-2, -0.5, COUNT)


@pytest.mark.parametrize(("known", "deep"), FIGURES)
def test_the_clearance_of_a_ray_is_known_to_a_sixteenth(egl: Context, known: str, deep: bool) -> None:
    """Never below the least share at any distance, nor far above the cone that is free of all balls before the end."""
    given, width = balls(), widths()
    s = np.linspace(START, FAR, 1500)
    least = np.minimum((along(given, s) / (width[:, None] * s)).min(axis=1), 1)
    free = np.minimum(free_cone(given, 0.97 * FAR) / width, 1)
    found, low, high, asked = cleared(egl, known, deep, given, width).T
    clear, blocked = least > 0.03, (least < -1e-3) & (free < -1e-3)
    assert np.all(found[clear] >= 0.97 * least[clear]) and np.all(found[clear] <= free[clear] / 0.9375)
    assert np.all(found <= 1) and np.all(found >= -1) and np.all(found[blocked] <= 0)
    depth = np.clip(-least[blocked], 0, 1)
    assert not deep or np.all(np.abs(-found[blocked] - depth) < 0.3)
    inside = (free_cone(given, 0.95 * FAR) < 0.9 * width) & (found > 0)
    assert np.all((high > low)[inside]) and np.all((low >= START) & (high <= FAR))
    evaluations, left = FIGURES[known, deep]
    assert np.mean(asked) == pytest.approx(evaluations, rel=1e-4)
    assert np.mean((high - low)[found > 0]) == pytest.approx(left, rel=1e-4)


def met(given: NDArray[np.float32]) -> NDArray[np.float64]:
    """Where the axis first meets a ball, (N,); infinite if nowhere."""
    x, y, z, r = np.moveaxis(given.astype(float), 2, 0)
    inner = r * r - x * x - y * y
    return np.where(inner > 0, z - np.sqrt(np.maximum(inner, 0)), np.inf).min(axis=0)


@cache
def seen_of_disc() -> NDArray[np.float64]:
    """The share of a light's disc that no ball hides before its distance, by 200 rays to a spiral over the disc."""
    i = np.arange(200)
    far, turn = np.sqrt((i + 0.5) / 200), 2.399963 * i
    sine = widths()[:, None] * far
    ways = np.stack([sine * np.cos(turn), sine * np.sin(turn), np.sqrt(1 - sine * sine)], axis=2)
    free = np.ones(sine.shape, bool)
    for ball in balls().astype(float):
        along = np.einsum("nd,nkd->nk", ball[:, :3], ways)
        inner = ball[:, 3:] ** 2 - np.sum(ball[:, :3] ** 2, axis=1)[:, None] + along**2
        free &= (inner < 0) | (along - np.sqrt(np.maximum(inner, 0)) > FAR)
    return free.mean(axis=1)


LIT = """
vec4 lit(vec4 x, vec4 y, vec4 z, vec4 more) {
    a = x;
    b = y;
    c = z;
    Surface surface = Surface(vec3(0.0), vec3(0.0, 0.0, 1.0), 1.0);
    Light light = Light(vec3(0.0, 0.0, 1.0), more.y, vec3(1.0));
    return vec4(SHADOW, asked, 0.0, 0.0);
}
"""
SECOND = """
vec4 lit(vec4 x, vec4 y, vec4 z, vec4 more) {
    a = x;
    b = y;
    c = z;
    float start;
    Ray ray = spawn_ray(vec3(0.0), vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0), 1.0, start);
    Hit hit = trace_secondary(ray, start, 1.0, more.x);
    return vec4(hit.found ? hit.t : -1.0, asked, hit.evaluations, hit.residual);
}
"""
PRICES = {
    ("light/shadow", ""): (18.8647, 0.713137),
    ("light/shadow", "ADVANCE"): (1.6453, 0.713137),
    ("light/shadow", "CUTS"): (19.0487, 0.713137),
    ("light/shadow", "ADVANCE CUTS"): (1.8867, 0.713137),
    ("path/secondary", ""): (20.7273, -0.148425),
    ("path/secondary", "ADVANCE"): (1.5840, -0.148425),
    ("path/secondary", "CUTS"): (20.9993, -0.148425),
    ("path/secondary", "ADVANCE CUTS"): (1.8267, -0.148425),
    ("light/two_sided", ""): (102.3087, 0.777343),
    ("light/two_sided", "AHEAD"): (47.4613, 0.778037),
    ("light/triangulated", ""): (21.3160, 0.253057),
    ("light/triangulated", "AHEAD"): (6.7007, 0.256243),
    ("light/triangulated", "HALVED"): (25.9913, 0.251916),
}
"""Mean evaluations of a ray, as the rules of steps give them; and the mean of what it finds."""


def lit(egl: Context, kind: str, known: str, begin: float = 0.0) -> NDArray[np.float64]:
    """The share of the light, or where a ray ends; and evaluations. begin : of the scene's box."""
    name = kind.removeprefix("light/")
    shadow = "hard_shadow(surface, light)" if name == "shadow" else f"{name}_shadow(surface, light, more.x)"
    after = SECOND if kind == "path/secondary" else LIT.replace("SHADOW", shadow)
    more = np.column_stack([widths() if name in ("triangulated", "two_sided") else np.ones(COUNT), np.full(COUNT, FAR)])
    more = np.column_stack([more, 0 * more])
    made = text(kind, after, frozenset(known.split()))
    made = made.replace("vec2(range.x, min(range.y, 4.0))", f"vec2(max(range.x, {begin}), min(range.y, 4.0))")
    made = made.replace(
        "float width) { return range; }", f"float width) {{ return vec2(max(range.x, {begin}), range.y); }}"
    )
    (found,) = run_all(egl, made, [("lit({0}, {1}, {2}, {3})", 4)], asked_of(balls(), more), UNIFORMS)
    return found.astype(float)


@pytest.mark.parametrize(("kind", "known"), PRICES)
def test_a_ray_meets_the_balls_that_are_in_its_way(egl: Context, kind: str, known: str) -> None:
    """Up to the light or the box, whatever the field tells ahead, and whether it may have membranes."""
    share, asked, counted, residual = lit(egl, kind, known).T
    end = met(balls())
    sure = (np.abs(end - FAR) > 0.01) & (np.abs(free_cone(balls(), 2 * FAR)) > 1e-4)
    if kind == "light/shadow":
        np.testing.assert_array_equal(share[sure] == 1, (end > FAR)[sure])
        assert np.all((share == 0) | (share == 1))
    elif kind == "path/secondary":
        np.testing.assert_array_equal(asked, counted)
        np.testing.assert_array_equal((share >= 0)[sure], (end <= FAR)[sure])
        hit = sure & (share >= 0)
        np.testing.assert_allclose(share[hit], end[hit], rtol=3e-4)
        assert np.all(residual >= 0)
    elif kind == "light/two_sided":
        off = share - seen_of_disc()
        assert np.mean(np.abs(off)) < 0.025 and np.quantile(np.abs(off), 0.99) < 0.3
    else:
        cone = np.minimum(free_cone(balls(), 0.9 * FAR) / widths(), 1)
        assert np.all((share >= 0) & (share <= 1)) and not share[end < FAR - 0.01].any()
        clear = end > FAR + 0.01
        assert np.all(share[clear] <= cone[clear] * 1.1 + 0.02) and np.mean(share[clear]) > 0.75 * np.mean(cone[clear])
    price, mean = PRICES[kind, known]
    assert np.mean(asked) == pytest.approx(price, rel=1e-4)
    assert np.mean(share[sure]) == pytest.approx(mean, rel=1e-5)


@pytest.mark.parametrize("deep", [False, True])
def test_a_clearance_out_of_steps_leaves_nothing_if_a_wall_comes_nearer(egl: Context, deep: bool) -> None:
    made = text("light/clearance", CLEAR).replace(f"vec2({START}, {FAR})", f"vec2({START}, 5000.0)")
    assert not walls(egl, made.replace("return min(p.z, balls);", "return 0.05 - 0.00002 * p.z;"), deep).any()


@pytest.mark.parametrize("wall", np.linspace(3.7, 3.99, 12))
def test_a_solid_is_as_deep_as_the_ray_is_long(egl: Context, wall: float) -> None:
    """Its depth is that at the end; what is beyond does not count."""
    made = text("light/clearance", CLEAR).replace("return min(p.z, balls);", f"return {wall} - p.z;")
    depth = (FAR - wall) / (np.linspace(0.02, 0.2, COUNT) * FAR)
    np.testing.assert_array_less(-walls(egl, made, True), np.minimum(depth * 1.0001, 1) + 1e-6)


def walls(egl: Context, made: str, deep: bool) -> NDArray[np.float64]:
    """The clearance of rays of many widths."""
    more = np.column_stack([np.linspace(0.02, 0.2, COUNT), np.full(COUNT, float(deep)), np.zeros((COUNT, 2))])
    (found,) = run_all(egl, made, [("cleared({0}, {1}, {2}, {3})", 4)], asked_of(balls(), more), UNIFORMS)
    return found[:, 0].astype(float)


def rising(depth: NDArray[np.float64], seed: int) -> Profiles:
    """From a surface the field rises, falls to minus a depth, rises again, and is anything behind that."""
    rng = np.random.default_rng(seed)
    count = len(depth)
    lengths, slopes = 10 ** rng.uniform(-2, 0, (count, 7)), rng.uniform(-1, 1, (count, 7))
    up, down, again = rng.uniform(0.05, 1, (3, count))
    lengths[:, 0] = 10 ** rng.uniform(-2.5, 0, count)
    lengths[:, 1], lengths[:, 2] = (up * lengths[:, 0] + depth) / down, rng.uniform(0.01, 1, count)
    slopes[:, 0], slopes[:, 1], slopes[:, 2] = up, -down, again
    return Profiles.of(lengths, slopes, np.zeros(count))


@pytest.mark.parametrize("kind", ["light/shadow", "light/triangulated", "path/secondary"])
def test_a_ray_whose_range_begins_late_asks_for_nothing_before(egl: Context, kind: str) -> None:
    """The box of the solids may begin behind the first sample: what is met is the same, for fewer evaluations."""
    early, late = (lit(egl, kind, "", begin) for begin in (0.0, 0.08))
    near = np.abs(late[:, 0] - early[:, 0]) <= (1e-3 if kind != "light/triangulated" else 0.03)
    assert np.mean(near) > 0.99
    saved = {"light/shadow": 1.98667, "light/triangulated": 1.11, "path/secondary": 4.62467}
    assert np.mean(early[:, 1] - late[:, 1]) == pytest.approx(saved[kind], rel=1e-3)


SHEETS = {
    ("light/shadow", "CUTS"): (44.468, 0.0),
    ("light/shadow", "ADVANCE CUTS"): (9.252667, 0.0),
    ("path/secondary", ""): (24.582, 0.40232618),
    ("path/secondary", "CUTS"): (47.266667, 0.84398126),
    ("path/secondary", "ADVANCE CUTS"): (9.522, 0.84397949),
}
"""Mean evaluations of a ray, and the mean of what it finds."""


@pytest.mark.parametrize(("kind", "known"), SHEETS)
def test_rays_from_a_surface_pass_membranes_and_meet_sheets(egl: Context, kind: str, known: str) -> None:
    """Half of the solids are as thin as some pixels, half are membranes, where the field is 0 and nothing is met."""
    depth = np.where(np.arange(COUNT) % 2 == 0, 0.0, 0.002 * 10 ** np.random.default_rng(61).uniform(0, 1.5, COUNT))
    of = rising(depth, 62)
    before = BEFORE[: BEFORE.index("vec4 a, b, c;")].replace("struct Ray { vec3 origin; vec3 direction; };", "")
    before = FIELD + (FREE if "ADVANCE" in known else "") + before
    before += "vec2 scene_box(Ray ray, vec2 range) { return vec2(range.x, min(range.y, 4.0)); }\n"
    before += "vec3 geometric_normal(Surface surface) { return surface.normal; }\n"
    after = (SECOND if kind == "path/secondary" else LIT.replace("SHADOW", "hard_shadow(surface, light)")).replace(
        "a = x;\n    b = y;\n    c = z;", "given(x, y, z, rest);"
    )
    after = after.replace("vec4 more)", "vec4 rest)").replace("more.y", "4.0").replace("more.x", "1.0")
    made = text(kind, after, frozenset(known.split()), before)
    given = [(VEC4, half) for half in of.halves()]
    (found,) = run_all(egl, made, [("lit({0}, {1}, {2}, {3})", 4)], given, UNIFORMS)
    values = of.values.copy()
    values[:, 0] = 1e-5
    values[depth == 0, 2] = 1e-5
    end = Profiles(of.places, values).root()
    sure = np.abs(end - FAR) > 0.01
    missed = found[:, 0] == (1 if kind == "light/shadow" else -1)
    wrong = sure & (missed != (end > FAR))
    assert np.mean(wrong) <= 0.002 or "CUTS" not in known, np.flatnonzero(wrong)
    price, mean = SHEETS[kind, known]
    assert np.mean(found[:, 1]) == pytest.approx(price, rel=1e-4)
    assert np.mean(found[sure & ~missed, 0].astype(float)) == pytest.approx(mean, rel=1e-6)


def test_a_wall_that_holds_the_light_casts_no_shadow_on_it(egl: Context) -> None:
    """A ray meets it at a cosine of 1/50: near the light what counts as near is less than the wall's own distance."""
    made = text("light/shadow", LIT.replace("SHADOW", "hard_shadow(surface, light)"))
    made = made.replace("return min(p.z, balls);", "return min(p.z, 0.02 * (4.0 - p.z));")
    (found,) = run_all(egl, made, [("lit({0}, {1}, {2}, {3})", 4)], asked_of(balls(), (1.0, FAR, 0.0, 0.0)), UNIFORMS)
    assert np.all(found[:, 0] == 1)


def test_a_light_at_the_surface_itself_has_a_direction_that_is_finite(egl: Context) -> None:
    after = """
    vec4 aimed(vec4 far) {
        vec2 range;
        float first;
        Surface surface = Surface(vec3(0.0), vec3(0.0, 0.0, 1.0), 1.0);
        Ray ray = shadow_ray(surface, Light(vec3(0.0, 0.0, 1.0), far.x, vec3(1.0)), range, first);
        return vec4(ray.direction, range.x - first);
    }"""
    far = np.zeros((3, 4))
    far[:, 0] = (0.0, 1e-20, 1.0)
    (found,) = run_all(egl, text("light/shadow", after), [("aimed({0})", 4)], [(VEC4, far)], UNIFORMS)
    assert np.all(np.isfinite(found)) and np.all(found[:, 3] <= 0)
    np.testing.assert_array_equal(found[0, :3], 0.0)
    np.testing.assert_array_equal(found[2, :3], [0, 0, 1])


def test_from_inside_a_solid_only_the_distance_is_known_ahead(egl: Context) -> None:
    ray = "Ray(vec3(0.0, 0.0, 2.0), vec3(0.0, 0.0, 1.0))"
    after = f"vec4 known(vec4 x) {{ a = b = c = x; return vec4(free_ahead({ray}, 0.0, 0.1), 0.0, 0.0); }}"
    given = [(VEC4, [(0.0, 0.0, 2.0, 0.5)])]
    for side, far in ((1.0, -0.5), (-1.0, 0.5)):
        made = text("light/clearance", after, frozenset({"AHEAD"}))
        (found,) = run_all(egl, made, [("known({0})", 4)], given, {**UNIFORMS, "u_side": side})
        np.testing.assert_allclose(found[0, :2], [far, -0.5 if side > 0 else 0.0], rtol=1e-5)


def test_an_edge_beyond_a_disc_leaves_all_or_nothing(egl: Context) -> None:
    edge = np.array([-2.0, -1.0 - 1e-6, -1.0, -0.5, 0.0, 0.5, 1.0, 1.0 + 1e-6, 2.0])
    c = np.clip(edge, -1, 1)
    found = run(egl, modules("light/beside_edge"), "beside_edge({0})", [(FLOAT, edge)])
    np.testing.assert_allclose(found, 0.5 + (c * np.sqrt(1 - c * c) + np.arcsin(c)) / np.pi, atol=1e-3)
