"""How much of a pixel solids cover, by edges.glsl on fields in closed form, against rays through 256 of its points."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.types import VEC4
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run_all

PIXEL, FAR, COUNT = 0.002, 30.0, 500
BEFORE = """
struct Ray { vec3 origin; vec3 direction; };
const float epsilon_pixels = 0.1;
const float contact_share = 0.0625;
const float cone_share = 0.25;
const float leap_pixels = 0.0875;
const float smoothing = 0.3;
const int march_steps = 512;
const mat3 u_camera_frame = mat3(1.0);
vec4 a, b, c;
float asked = 0.0;
float plane(vec3 p, vec4 of) { return dot(p - vec3(0.0, 0.0, -c.w), of.xyz) - of.w; }
float body(vec3 p) {
    vec3 q = p - vec3(0.0, 0.0, -c.w);
    BODY
}
float field(vec3 p) {
    asked += 1.0;
    return body(p);
}
vec2 range_of(Ray ray) { return vec2(0.0, 30.0); }
"""
PERSPECTIVE = "Ray camera_ray(vec2 pixel) { return Ray(vec3(0.0), normalize(vec3(0.002 * pixel, -1.0))); }\n"
PARALLEL = "Ray camera_ray(vec2 pixel) { return Ray(vec3(0.002 * pixel, 0.0), vec3(0.0, 0.0, -1.0)); }\n"
AFTER = """
vec4 seen(vec4 x, vec4 y, vec4 z) {
    a = x;
    b = y;
    c = z;
    Ray ray = camera_ray(vec2(0.0));
    March at = first_of(ray, vec2(0.0, 30.0));
    float rest = 1.0;
    float count = 0.0;
    float first = -1.0;
    edge_evaluations = 0.0;
    for (int i = 0; i <= MOST_EDGES && rest >= LEAST_SHARE; i++) {
        Ray found;
        Hit hit;
        float cover = next_surface(vec2(0.0), ray, at, 30.0, i == MOST_EDGES, found, hit);
        if (!hit.found) cover = 0.0;
        if (first < 0.0 && cover > LEAST_SHARE) first = hit.t;
        rest *= 1.0 - cover;
        count += hit.evaluations;
        if (!hit.found) break;
    }
    return vec4(1.0 - rest, count + edge_evaluations, asked, first);
}
"""
BODIES = {
    "ball": "return length(q - a.xyz) - a.w;",
    "wire": "return length(cross(q - a.xyz, b.xyz)) - a.w;",
    "wedge": "return max(plane(p, a), plane(p, b));",
    "bar": "return max(abs(plane(p, a)) - b.w, plane(p, vec4(b.xyz, 0.0)));",
    "balls": "return min(length(q - a.xyz) - a.w, length(q - b.xyz) - b.w);",
}
"""Bodies about the point at the depth c.w on the pixel's middle ray."""


def units(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    found = rng.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@cache
def given(body: str, parallel: bool) -> tuple[NDArray[np.float32], ...]:
    """Bodies whose edges are within a pixel or two of the middle, at sizes from a twentieth of a pixel on."""
    rng = np.random.default_rng(sorted(BODIES).index(body))
    depth = rng.uniform(2, 8, COUNT)
    pixel = PIXEL * (np.ones(COUNT) if parallel else depth)
    off = rng.uniform(-1.3, 1.3, COUNT) * pixel
    a, b = np.zeros((2, COUNT, 4))
    turn = rng.uniform(0, 2 * np.pi, COUNT)
    aside = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    if body in ("ball", "balls"):
        radius = pixel * 10 ** rng.uniform(-0.3, 2, COUNT)
        a[:, :3], a[:, 3] = aside * (radius + off)[:, None], radius
        second = pixel * 10 ** rng.uniform(-0.3, 1, COUNT)
        b[:, :3], b[:, 3] = -aside * (second + rng.uniform(-0.5, 1.2, COUNT) * pixel)[:, None], second
        b[:, 2] = rng.uniform(-1, 1, COUNT)
    elif body == "wire":
        a[:, 3] = pixel * 10 ** rng.uniform(-1.3, 0.3, COUNT)
        way = np.cross(aside, [0, 0, 1.0]) + rng.uniform(-2, 2, COUNT)[:, None] * [0, 0, 1.0]
        b[:, :3] = way / np.linalg.norm(way, axis=1, keepdims=True)
        a[:, :3] = aside * off[:, None]
    else:
        n = aside + 10 ** rng.uniform(-2, 1, COUNT)[:, None] * [0, 0, 1.0]
        a[:, :3] = n / np.linalg.norm(n, axis=1, keepdims=True)
        m = units(rng, COUNT)
        m[:, 2] = -np.abs(m[:, 2]) if body == "wedge" else m[:, 2]
        b[:, :3] = m
        a[:, 3] = off * np.linalg.norm(a[:, :2], axis=1)
        b[:, 3] = 0.3 * off if body == "wedge" else pixel * 10 ** rng.uniform(-1.3, 0.5, COUNT)
    c = np.column_stack([0 * depth, 0 * depth, 0 * depth, depth])
    return tuple(part.astype(np.float32) for part in (a, b, c))


def hits(body: str, a: Any, b: Any, o: NDArray[Any], d: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether rays meet a body, for each body a ray of `o` and `d`, about the body's own point."""

    def ball(of: Any) -> NDArray[np.bool_]:
        away = of[:3] - o
        along = np.sum(away * d, axis=1)
        return np.sum(away * away, axis=1) - along * along < of[3] ** 2

    def between(planes: list[tuple[Any, float]]) -> NDArray[np.bool_]:
        low, high = np.full(len(o), -np.inf), np.full(len(o), np.inf)
        for n, level in planes:
            rate, room = d @ n, level - o @ n
            t = room / rate
            low, high = np.where(rate < 0, np.maximum(low, t), low), np.where(rate > 0, np.minimum(high, t), high)
        return low < np.minimum(high, FAR)

    if body == "ball":
        return ball(a)
    if body == "balls":
        return ball(a) | ball(b)
    if body == "wire":
        across = np.cross(d, b[:3])
        return np.abs(np.sum((a[:3] - o) * across, axis=1)) < a[3] * np.linalg.norm(across, axis=1)
    if body == "wedge":
        return between([(a[:3], a[3]), (b[:3], b[3])])
    return between([(a[:3], a[3] + b[3]), (-a[:3], b[3] - a[3]), (b[:3], 0.0)])


@cache
def truth(body: str, parallel: bool) -> NDArray[np.float64]:
    """The share of 16 x 16 rays through a pixel that meet a body."""
    x, y = (v.ravel() for v in np.meshgrid((np.arange(16) + 0.5) / 16 - 0.5, (np.arange(16) + 0.5) / 16 - 0.5))
    at = np.column_stack([PIXEL * x, PIXEL * y, 0 * x])
    found = np.zeros(COUNT)
    for i, (a, b, c) in enumerate(zip(*given(body, parallel), strict=True)):
        d = np.array([0, 0, -1.0]) + (0 if parallel else at)
        d = np.broadcast_to(d, at.shape) / np.linalg.norm(np.broadcast_to(d, at.shape), axis=1, keepdims=True)
        o = np.array([0, 0, float(c[3])]) + (at if parallel else 0 * at)
        found[i] = np.mean(hits(body, a.astype(float), b.astype(float), o, d))
    return found


def seen(egl: Context, body: str, parallel: bool) -> NDArray[np.float64]:
    """The share of a pixel that is covered, evaluations as counted and as asked, and the first distance; (N, 4)."""
    (found,) = run_all(egl, text(body, parallel), [("seen({0}, {1}, {2})", 4)], inputs(body, parallel), UNIFORMS)
    return found.astype(float)


UNIFORMS = {"u_pixel": PIXEL, "u_side": 1.0, "u_start": (0.0, 0.0, 0.0, 0.0)}


def inputs(body: str, parallel: bool) -> list[tuple[Any, NDArray[np.float32]]]:
    return [(VEC4, part) for part in given(body, parallel)]


def text(body: str, parallel: bool, after: str = AFTER) -> str:
    before = BEFORE.replace("BODY", BODIES[body]) + (PARALLEL if parallel else PERSPECTIVE)
    names = "edge_width widths hit expected distance start refine on_exhausted aim_never bracketing loop edges".split()
    variants = frozenset({"EDGES"} | ({"ORTHOGRAPHIC"} if parallel else set()))
    return modules(*(f"march/{name}" for name in names), before=before, after=after, variants=variants)


FIGURES = {
    ("ball", False): (0.009624, 33.752),
    ("wire", False): (0.021433, 33.360),
    ("wedge", False): (0.024459, 97.374),
    ("bar", False): (0.081938, 81.498),
    ("balls", False): (0.021511, 57.342),
    ("wire", True): (0.020810, 35.158),
    ("wedge", True): (0.026155, 116.212),
    ("bar", True): (0.081202, 91.798),
    ("balls", True): (0.021820, 60.418),
}
"""The mean error of the share that is covered, and the mean evaluations of a pixel: for each body, and for cameras of
perspective and of parallel rays. Heuristics of edges.glsl decide both; whoever changes one sees here what it gives."""


@pytest.mark.parametrize(("body", "parallel"), FIGURES)
def test_the_share_of_a_pixel_and_its_price_are_those_of_the_figures(egl: Context, body: str, parallel: bool) -> None:
    share, counted, asked, _ = seen(egl, body, parallel).T
    np.testing.assert_array_equal(counted, asked)
    error, evaluations = FIGURES[body, parallel]
    off = share - truth(body, parallel)
    assert np.all((share >= 0) & (share <= 1)) and abs(np.mean(off)) < (0.07 if body == "bar" else 0.03)
    assert np.mean(np.abs(off)) == pytest.approx(error, rel=2e-4)
    assert np.mean(asked) == pytest.approx(evaluations, rel=1e-4)


def test_a_field_that_is_level_has_its_least_value_anywhere(egl: Context) -> None:
    """No slope of a parabola is then divided by."""
    after = """
    vec4 least(vec4 x) {
        Ray ray = camera_ray(vec2(0.0));
        vec2 found = least_between(ray, vec2(1.0, x.x), vec2(2.0, 2.0 * x.x), vec2(3.0, 3.0 * x.x));
        return vec4(found, asked, 0.0);
    }"""
    made = text("ball", False, after)
    (found,) = run_all(egl, made, [("least({0})", 4)], [(VEC4, np.full((3, 4), [[0.0], [0.25], [-0.5]]))], UNIFORMS)
    np.testing.assert_allclose(found, [[2, 0, 0, 0], [2, 0.5, 0, 0], [2, -1, 0, 0]], rtol=1e-6)
