"""The small functions of a march at the ends of their ranges, against their formulas in float64."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.types import FLOAT, VEC2, VEC3, VEC4
from raymarch.gpu.context import Context
from tests.functions.profiles import CONTACT, NEAR, PIXEL, ROUNDING, text_of
from tests.support.glsl_harness import modules, run, run_all

RAY = "struct Ray { vec3 origin; vec3 direction; };\nconst Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));\n"
UNIFORMS = {"u_pixel": PIXEL, "u_side": 1.0, "march_steps": 9, "u_start": (0.0, 0.0, 0.0, 0.0)}
ADVANCE = "vec2 field_advance(vec3 p, vec3 direction, float level, float slope) { return given; }\n"
STATE = "March(1.0, 0.5, 0.0, 0.0, {}, {}, false, false)"


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_ray_is_free_as_far_as_is_known_or_by_the_value_alone(egl: Context, side: float) -> None:
    """The fall of the field per way is at most 1, and that of far samples counts: near the surface it is rounding."""
    after = f"""
    vec4 freed(vec2 found, float level) {{
        approach = 0.5;
        float way = free_way(found, level, {side});
        return vec4(way, way_behind, approach, float(by_distance));
    }}"""
    found, level = (
        np.array([[3.0, 4.0], [3.0, 2.0], [3.0, 0.0], [1e-6, 1.0], [-1.0, 0.0], [3.0, -2.0], [-1.0, 2.0]]),
        1e-6,
    )
    values = run(
        egl,
        modules("march/rounding", "march/way_ahead", before=RAY + WIDTHS, after=after, variants=frozenset({"ADVANCE"})),
        "freed({0}, {1})",
        [(VEC2, side * found), (FLOAT, np.full(len(found), level))],
        4,
    )
    r, way = found[:, 0] - level, found[:, 1]
    tells = way > 0
    rate = np.where(tells & (r > 7 * level), np.minimum(r / np.where(tells, way, 1), 1), 0.5)
    known = np.column_stack([np.where(tells, way, r), np.abs(r), rate, way < 1.01 * r])
    np.testing.assert_allclose(values, known, rtol=1e-5, atol=1e-12)


WIDTHS = """
const float contact_share = 0.0625;
const float GROWTH = 1.1920929e-7;
vec2 field_advance(vec3 p, vec3 direction, float level, float slope) { return vec2(0.0); }
"""


def test_the_way_below_the_rounding_error_is_a_part_of_a_hit(egl: Context) -> None:
    """Where the field hardly falls, a quarter of the hit's width."""
    after = "float below(float rate, float width) { approach = rate; return way_below_level(ray, 2.0, width); }"
    text = modules(
        "march/rounding", "march/way_ahead", before=RAY + WIDTHS, after=after, variants=frozenset({"ADVANCE"})
    )
    rate, width = (a.ravel() for a in np.meshgrid([1.0, 0.1, 1e-3, 1e-7, 1e-30], [1e-2, 1e-5]))
    found = run(egl, text, "below({0}, {1})", [(FLOAT, rate), (FLOAT, width)])
    np.testing.assert_allclose(found, np.minimum(2 * ROUNDING / rate, 0.25 * width), rtol=1e-5)


def test_from_inside_solids_in_closed_form_are_walls_too(egl: Context) -> None:
    before = RAY + "float solved_field(vec3 p) { return p.z - 2.0; }\n" + WIDTHS.replace("vec2(0.0)", "vec2(1.0, 0.0)")
    variants = frozenset({"ADVANCE", "ANALYTIC"})
    text = modules("march/rounding", "march/way_ahead", before=before, variants=variants)
    found = run(egl, text, "way_ahead(ray, {0}, 1.0, {1} > 0.5)", [(FLOAT, [1.0, 1.0, 5.0]), (FLOAT, [1.0, 0.0, 1.0])])
    np.testing.assert_allclose(found, [-1.0, 1.0, 1.0], rtol=1e-5)


@pytest.mark.parametrize(
    ("kind", "distance"), [("CONE", "march_distance"), ("EDGES", "wide_way_ahead"), ("", "way_ahead")]
)
def test_a_stretch_follows_the_steps(egl: Context, kind: str, distance: str) -> None:
    """Twice as long after a step that was free as a whole; else one and a half times the step, at least 16 rounding
    errors; whichever side of the surface the ray is on."""
    own = "uniform float u_pixel;\nuniform float u_cone;\nfloat edge_width = 0.0;\nvec2 given;\n"
    before = f"{'#define CONE' if kind == 'CONE' else ''}\n{RAY}{own}{WIDTHS.replace('vec2(0.0)', 'given')}"
    names = ("march/hit", "march/rounding", "march/stretch", "march/way_ahead", "march/distance_ahead")
    variants = frozenset({"ADVANCE", "STRETCH"} | ({"CONES"} if kind == "CONE" else {kind} if kind else set()))
    call = {"march_distance": "march_distance(ray, 1.0)", "wide_way_ahead": "wide_way_ahead(ray, 1.0, 0.0, 0.0)",
            "way_ahead": "way_ahead(ray, 1.0, u_side)"}[distance]  # fmt: skip
    after = f"""
    float stretched(vec2 found) {{
        given = found;
        begin_stretch(4.0);
        {call};
        return stretch_ahead;
    }}"""
    text = modules(*names, before=before, after=after, variants=variants)
    found = np.array([[2.0, 2.0], [0.5, 0.5], [0.01, 1e-9], [0.01, 0.0]])
    known = [2.0, 0.75, 16 * ROUNDING, 16 * ROUNDING]
    for side in (1.0, -1.0):
        values = run(egl, text, "stretched({0})", [(VEC2, side * found)], 1, {"u_side": side})
        np.testing.assert_allclose(values, known, rtol=1e-5)


@pytest.mark.parametrize("tracer", ["relaxed", "enhanced", "plain"])
def test_a_step_that_is_undone_tells_no_rise(egl: Context, tracer: str) -> None:
    """Its derivative is a mark of the tracer's, which may be one that no field has."""
    after = """
    vec4 moved(vec2 about) {
        March at = March(1.0, 0.5, 0.0, 0.0, 0.25, 0.25, false, false);
        move(at, about.x > 0.5, 2.0, 0.75, 0.125);
        return vec4(at.t, at.r, at.last_derivative, at.derivative);
    }"""
    found = run(egl, text_of(tracer, after=after), "moved({0})", [(VEC2, [(1.0, 0.0), (0.0, 0.0)])], 4, UNIFORMS)
    mark = 2.0 if tracer == "relaxed" else -1.0
    np.testing.assert_array_equal(found, [[2, 0.75, 0.125, 0.125], [1, 0.5, min(mark, 0), mark]])


def test_a_gradient_at_the_camera_is_no_steeper_than_a_field(egl: Context) -> None:
    """One that is rounded, or of an estimate, counts as 1."""
    after = "float begun(vec3 way) { return start_march(Ray(vec3(0.0), way), 0.0).derivative; }"
    ways = np.array([[0, 0, 1.0], [0, 0, -1.0], [0.6, 0, 0.8], [1, 0, 0]])
    uniforms = {**UNIFORMS, "u_start": (0.0, 0.0, 1.5, 1.0)}
    found = run(egl, text_of("plain", after=after), "begun({0})", [(VEC3, ways)], 1, uniforms)
    np.testing.assert_allclose(found, -0.7 + 0.3 * np.clip(1.5 * ways[:, 2], -1, 1), rtol=1e-5)


PIXEL_AT = {
    camera: f"uniform float u_pixel;\nfloat pixel_at(float t) {{ return u_pixel{factor}; }}\n"
    for camera, factor in (("perspective", " * t"), ("ORTHOGRAPHIC", ""))
}


@pytest.mark.parametrize("camera", ["perspective", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("share", [1.0, 0.0625, 0.01])
def test_a_ray_out_of_steps_shows_what_is_within_a_pixel(egl: Context, camera: str, share: float) -> None:
    """And what is in closed form behind it, if it is farther away or rises. A flat field is closer than it says."""
    before = f"{RAY}{PIXEL_AT[camera]}const float contact_share = {share};\nfloat solved_t;\n"
    after = """
    bool shown(vec4 a) {
        Hit hit = Hit(false, false, a.x, a.y, 0.0, 0.0, 0.0);
        solved_t = a.w;
        on_exhausted(hit, a.z);
        return hit.found;
    }"""
    variants = frozenset({"ANALYTIC"} | ({camera} if camera == "ORTHOGRAPHIC" else set()))
    text = modules("march/hit", "march/on_exhausted", before=before, after=after, variants=variants)
    t, share_of, slope, solved = (
        a.ravel() for a in np.meshgrid([1.0, 3.0], [0.99, 1.01, 0.1, 3], [-0.5, 0.0, 0.5], [1e30, 7])
    )
    wide = min(16 * share, 1) * PIXEL * (t if camera == "perspective" else 1.0)
    inputs = [(VEC4, np.column_stack([t, share_of * wide, slope, solved]))]
    found = run(egl, text, "float(shown({0}))", inputs, 1, {"u_pixel": PIXEL})
    np.testing.assert_array_equal(found == 1, ((share_of < 1) & (slope <= 0)) | (solved >= 1e30))


@pytest.mark.parametrize("camera", ["perspective", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("kind", ["refine", "refine_slope", "refine_none"])
def test_a_hit_is_within_its_width_on_both_sides_of_a_surface(egl: Context, kind: str, camera: str) -> None:
    """Where it is refined, also no farther along the ray than the last step may go, which is its only one."""
    after = """
    vec4 ended(vec4 a) {
        vec3 widths = hit_widths(Ray(vec3(0.0), vec3(0.0, 0.0, 1.0)));
        March at = March(a.x, a.y, 0.0, 0.0, 0.0, a.z, true, false);
        return vec4(refined(widths, a.x, a.y, a.z), last_step(widths, at), 0.0, 0.0);
    }"""
    alike = camera == "ORTHOGRAPHIC"
    text = text_of("plain", kind, after, variants=frozenset({camera} if alike else set()))
    t, share, slope = (
        a.ravel()
        for a in np.meshgrid([0.5, 3.0], [-9, -1.01, -0.99, -0.2, 0.2, 0.99, 1.01, 9], [-1, -0.05, -0.01, 0, 0.5])
    )
    wide = np.ones_like(t) if alike else t
    contact = (CONTACT if kind == "refine" else NEAR) * wide + ROUNDING * t
    reach = 0.375 * (NEAR * wide + ROUNDING * t)
    r = share * contact
    (found,) = run_all(egl, text, [("ended({0})", 4)], [(VEC4, np.column_stack([t, r, slope, 0 * t]))], UNIFORMS)
    falls = slope < 0
    down = np.where(falls, r / np.where(falls, -slope, 1), 0)
    if kind == "refine":
        limit = np.where(falls, np.minimum(contact, -slope * reach), contact)
        known = np.where(falls, np.clip(down, -reach, reach), 0)
    else:
        limit, known = contact, np.minimum(down, t) if kind == "refine_slope" else 0 * t
    np.testing.assert_array_equal(found[:, 0] == 1, np.abs(r) <= limit)
    np.testing.assert_allclose(found[:, 1], known, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(("extent", "far", "known"), [(2.0, 10.0, 0.00066), (20.0, 10.0, 0.0033), (1e-3, 1e3, 3.3e-9)])
def test_secondary_rays_have_the_pixel_of_the_solids_at_most(
    egl: Context, extent: float, far: float, known: float
) -> None:
    """Of 1/300 of the path, whatever the size of the picture, and no more than the picture's own."""
    before = f"{RAY}uniform float u_far;\nconst float path_extent = {extent};\n"
    before += "const float epsilon_pixels = 0.1;\nconst float contact_share = 0.0625;\n"
    text = modules("march/widths", before=before, variants=frozenset({"BOUNCES"}))
    for pixel in (0.01, 0.001):
        found = run(egl, text, "secondary_pixel() + 0.0 * {0}", [(FLOAT, [0.0])], 1, {"u_pixel": pixel, "u_far": far})
        np.testing.assert_allclose(found, min(pixel, known), rtol=1e-5)


OWN = """
vec2 own_step(float r, float derivative, float undone, float memory, float t, float rest) {
    float each[4] = float[](r, derivative, undone, memory);
    return vec2(asked < 4 ? each[asked] : asked == 4 ? rest : 1.0e9, memory + 1.0);
}
"""


def test_a_tracer_of_a_function_gets_the_state_and_gives_the_step(egl: Context) -> None:
    """No longer than to the end of the ray and the distance there; after a step that was undone a plain one."""
    after = """
    vec2 stepped(vec4 a, float what) {
        asked = int(what);
        own_memory = 7.0;
        float z = step_length(March(2.0, a.x, 0.0, 0.0, a.y, 0.0, a.z > 0.5, false), 6.0);
        return vec2(z, own_memory);
    }"""
    text = modules("march/hit", "march/own", before=f"{RAY}int asked;\n{OWN}", after=after)
    states = np.array([[0.5, 0.25, 0, 0], [0.5, 0.25, 1, 0], [0.5, 2.0, 0, 0], [0.0, 0.25, 0, 0], [-0.5, 0.25, 0, 0]])
    plain = states[:, 0]
    steps = np.where((plain > 0) & (states[:, 1] < 2), 1.0, 0.0)
    for what, given in enumerate((plain, states[:, 1], 0 * plain, 7 + 0 * plain, 4 + 0 * plain, 4 + plain)):
        found = run(egl, text, "stepped({0}, {1})", [(VEC4, states), (FLOAT, np.full(5, float(what)))], 2)
        long = np.minimum(given, 4 + plain)
        np.testing.assert_allclose(found[:, 0], np.where((steps == 1) & (given > 0), long, plain), rtol=1e-6)
        np.testing.assert_array_equal(found[:, 1], [8, 7, 8, 0, 7])


def test_what_a_tracer_of_a_function_is_told_of_an_undone_step(egl: Context) -> None:
    """The steepest derivative, and 1; what it then remembers shows both."""
    before = RAY + "vec2 own_step(float r, float m, float undone, float memory, float t, float rest) {"
    before += " return vec2(r, 10.0 * undone + m); }\n"
    state = "March(2.0, 0.5, 0.0, 0.0, m, 0.0, false, false)"
    after = f"vec2 told(float m) {{ return vec2(step_length({state}, 6.0), own_memory); }}"
    found = run(
        egl, modules("march/hit", "march/own", before=before, after=after), "told({0})", [(FLOAT, [0.25, 2.0])], 2
    )
    np.testing.assert_allclose(found, [[0.5, 0.25], [0.5, 9.0]])


def test_rays_close_to_an_edge_look_for_it_within_half_a_pixel(egl: Context) -> None:
    after = "float width_of(float y) { return close_width(vec3(0.0, y, 0.1 * y)); }"
    text = text_of("plain", after=after, variants=frozenset({"EDGES"}))
    found = run(egl, text, "width_of({0})", [(FLOAT, [0.0, 0.4 * PIXEL, 3 * PIXEL])], 1, UNIFORMS)
    np.testing.assert_allclose(found, [0.5 * PIXEL, 0.5 * PIXEL, 3 * PIXEL], rtol=1e-6)
