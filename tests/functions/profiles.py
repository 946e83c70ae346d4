"""Fields along a ray whose surfaces are known: piecewise linear with eight knots, 1-Lipschitz, and marched by a tracer.

The ray runs along +z from the origin, so that a point's z is the distance on the ray, without rounding. The field
counts for itself how often, how far and where it is asked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.types import VEC4
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run

KNOTS = 8
PIXEL = 0.002
NEAR, CONTACT = 0.1 * PIXEL, 0.0625 * 0.1 * PIXEL
"""Width of a pixel at distance 1, and the shares of it within which a ray looks for a surface, and has met it."""
PASSED = 0.5 * 0.0875 * PIXEL
"""Share of the distance: a solid in which a ray is less deep may be passed."""
ROUNDING = 2.0**-22
"""2 ulp: below this share of the distance nothing is told apart."""

FIELD = """
struct Ray { vec3 origin; vec3 direction; };
float place[8];
float value[8];
float asked = 0.0;  // how often
float furthest = 0.0;
float twice = 0.0;  // how often at the same place as just before
float wasted = 0.0;  // how often where the spheres before had proven all free
float free = 0.0;
float last = -1.0;
vec2 spheres[4];  // the last that were found, from end to end
float known = 0.0;  // how often within one of them

float field(vec3 p) {
    float t = p.z;
    int k = 0;
    for (int i = 1; i < 7; i++) k = t >= place[i] ? i : k;
    float f = value[k] + (value[k + 1] - value[k]) / (place[k + 1] - place[k]) * (t - place[k]);
    asked += 1.0;
    twice += t == last ? 1.0 : 0.0;
    wasted += t < free * (1.0 - 4.0e-7) ? 1.0 : 0.0;
    furthest = max(furthest, t);
    bool within = false;
    for (int i = 0; i < 4; i++) {
        within = within || (float(i) < asked - 1.0 && t > spheres[i].x + 4.0e-7 * t && t < spheres[i].y - 4.0e-7 * t);
    }
    known += within ? 1.0 : 0.0;
    spheres[int(mod(asked - 1.0, 4.0))] = vec2(t - abs(f), t + abs(f));
    if (t - abs(f) <= free || asked == 1.0) free = max(free, t + abs(f));
    last = t;
    return f;
}
void given(vec4 a, vec4 b, vec4 c, vec4 d) {
    for (int i = 0; i < 4; i++) {
        place[i] = a[i];
        place[i + 4] = b[i];
        value[i] = c[i];
        value[i + 4] = d[i];
    }
}
"""
FREE = """
// The field, and how far the ray is free: known in full before the fourth knot, behind it by the value alone.
vec2 field_advance(vec3 p, vec3 direction, float level, float slope) {
    float t = p.z;
    float f = field(p);
    float side = f < 0.0 ? -1.0 : 1.0;
    float way = max(side * f - level, 0.0);
    for (int k = 6; t < place[3] && side * f > level && k >= 0; k--) {
        float a = k == 0 ? t : max(t, place[k]);
        float rate = (value[k + 1] - value[k]) / (place[k + 1] - place[k]);
        float over = side * (value[k] + rate * (a - place[k])) - level - slope * (a - t);
        float to = over < 0.0 ? a : a + over / (slope - side * rate);
        if (k == 6) way = 1.0e3;
        if ((side * rate < slope || over < 0.0) && (k == 6 || (a < place[k + 1] && to < place[k + 1]))) way = to - t;
    }
    if (place[3] > 1.5) way = max(0.8 * way, min(way, side * f - level));
    return vec2(f, side * way);
}
"""
UNKNOWN = 3.0
"""In place of a slope: none was handed on."""
CONSTANTS = """
const float epsilon_pixels = 0.1;
const float contact_share = 0.0625;
const float leap_pixels = 0.0875;
const float smoothing = 0.3;
const float step_scale = {scale};
const float relaxation = {relaxation};
const bool relax_again = {again};
const float step_variation = {variation};
float random_of_pixel(int i) {{ return 1.0; }}
uniform int march_steps;
vec2 marched;
vec2 range_of(Ray ray) {{ return marched; }}
"""
AFTER = """
vec4 traced(vec4 a, vec4 b, vec4 c, vec4 d, vec4 e) {
    given(a, b, c, d);
    marched = e.xy;
    Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0));
    March at = start_march(ray, e.x);
    if (e.w < 2.0) at.derivative = e.w;
    Hit hit = no_hit(e.x);
    march(ray, at, hit, e.y);
    if (e.z == 0.0) return vec4(hit.t, hit.residual, hit.iterations, hit.evaluations);
    if (e.z == 1.0) return vec4(hit.done, hit.found, hit.fallbacks, asked);
    return vec4(furthest, twice, wasted, known);
}
"""
TRACED = AFTER.replace("march(ray, at, hit, e.y)", "hit = trace(ray)")
TRACERS: Mapping[str, tuple[str, ...]] = {
    "plain": ("march/aim_never", "march/safe_step_scaled", "march/plain", "march/advance", "march/loop"),
    "varied": ("march/aim_never", "march/safe_step_varied", "march/plain", "march/advance", "march/loop"),
    "relaxed": ("march/aim_never", "march/relaxed", "march/advance", "march/loop"),
    "relaxed_again": ("march/aim_never", "march/relaxed", "march/advance", "march/loop"),
    "enhanced": ("march/aim_never", "march/enhanced", "march/advance", "march/loop"),
    "auto_relaxed": ("march/aim", "march/auto_relaxed", "march/advance", "march/loop"),
    "bracketing": ("march/aim_never", "march/bracketing", "march/loop"),
}


def text_of(
    tracer: str,
    settle: str = "refine",
    after: str = AFTER,
    scale: float = 1.0,
    variants: frozenset[str] = frozenset(),
) -> str:
    """The functions of a tracer, on the field of a profile. variants : as of `raymarch.glsl.load`."""
    constants = CONSTANTS.format(
        relaxation=0.88 if tracer == "enhanced" else 1.6,
        again="true" if tracer == "relaxed_again" else "false",
        scale=scale,
        variation=0.5,
    )
    ahead, cuts, noted = (name in variants for name in ("ADVANCE", "CUTS", "NOTED"))
    start = "start" if tracer in ("plain", "varied", "bracketing", "free") else "start_published"
    distance = ("rounding", "way_ahead", "distance_ahead") if ahead else ("rounding", "distance")
    doubts = ("membrane", *(("doubt_ahead",) if ahead else ())) if cuts else ()
    names = (
        *(("note",) if noted else ()),
        "widths",
        "hit",
        *(("expected",) if "EDGES" in variants else ()),
        *distance,
        start,
        settle,
        *doubts,
        "on_exhausted",
    )
    steps = ("march/free",) if tracer == "free" else TRACERS[tracer]
    whole = (*(f"march/{name}" for name in names), *steps, "march/begin", "march/trace")
    edges = "const float cone_share = 0.25;\nfloat edge_width = 0.0;\n"
    known = (FREE if ahead else "") + (edges if "EDGES" in variants else "")
    return modules(*whole, before=FIELD + known + constants, after=after, variants=variants)


@dataclass(frozen=True)
class Profiles:
    """Many fields along a ray: `places` and `values` of the knots, float32 (N, 8); linear beyond the first and last."""

    places: NDArray[np.float32]
    values: NDArray[np.float32]

    @classmethod
    def of(cls, lengths: NDArray[np.float64], slopes: NDArray[np.float64], first: NDArray[np.float64]) -> Profiles:
        """From the lengths and slopes of the seven parts, (N, 7), and the first value."""
        steps = np.cumsum(lengths, axis=1)
        places = np.column_stack([np.zeros(len(lengths)), steps])
        values = np.column_stack([first, first[:, None] + np.cumsum(lengths * slopes, axis=1)])
        return cls(places.astype(np.float32), values.astype(np.float32))

    def halves(self) -> list[NDArray[np.float32]]:
        """The knots as four inputs of vec4."""
        return [part[:, half] for part in (self.places, self.values) for half in (slice(4), slice(4, 8))]

    def __len__(self) -> int:
        return len(self.places)

    def __add__(self, other: Profiles) -> Profiles:
        return Profiles(np.vstack([self.places, other.places]), np.vstack([self.values, other.values]))

    def __getitem__(self, of: Any) -> Profiles:
        return Profiles(self.places[of], self.values[of])

    def at(self, t: NDArray[Any]) -> NDArray[np.float64]:
        """The field at a distance each, in float64."""
        p, v, t = self.places.astype(float), self.values.astype(float), np.asarray(t, float)
        k = np.clip(np.sum(t[:, None] >= p, axis=1) - 1, 0, KNOTS - 2)
        i = np.arange(len(p))
        return np.asarray(v[i, k] + (v[i, k + 1] - v[i, k]) / (p[i, k + 1] - p[i, k]) * (t - p[i, k]))

    def least(self, t: NDArray[Any]) -> NDArray[np.float64]:
        """The least value up to a distance each; (N,)."""
        v = np.where(self.places <= np.asarray(t)[:, None], self.values.astype(float), np.inf)
        return np.asarray(np.minimum(v.min(axis=1), self.at(t)))

    def root(self, level: float | NDArray[Any] = 0.0) -> NDArray[np.float64]:
        """The first distance at which the field is at a level or below; infinite if none."""
        p, v = self.places.astype(float), self.values.astype(float) - np.reshape(level, (-1, 1))
        found = np.full(len(p), np.inf)
        for k in reversed(range(KNOTS - 1)):
            falls = (v[:, k] > 0) & ((v[:, k + 1] <= 0) | ((k == KNOTS - 2) & (v[:, k + 1] < v[:, k])))
            drop = np.where(falls, v[:, k] - v[:, k + 1], 1.0)
            found = np.where(falls, p[:, k] + v[:, k] * (p[:, k + 1] - p[:, k]) / drop, found)
        return np.where(v[:, 0] <= 0, 0.0, found)

    def root_of_cut(self) -> NDArray[np.float64]:
        """The first distance at which the ray is deeper in the solid than half of what a step may leave unproven."""
        return Profiles(self.places, (self.values.astype(float) + PASSED * self.places).astype(np.float32)).root()


def plane(slope: NDArray[np.float64], first: NDArray[np.float64]) -> Profiles:
    """Fields of one slope each, (N,), from a first value each."""
    return Profiles.of(np.full((len(slope), 7), 3.0), np.repeat(slope[:, None], 7, axis=1), first)


def deepest(t: NDArray[Any]) -> NDArray[np.float64]:
    """The largest value at a hit: the last step may add three eighths of an epsilon to what a hit may leave."""
    return np.asarray((CONTACT + 0.375 * NEAR + ROUNDING) * np.asarray(t, float) * (1 + 1e-3) + 4e-7)


def contact(t: NDArray[Any]) -> NDArray[np.float64]:
    """Within this of a surface a ray has met it, with what the field itself is rounded by."""
    return np.asarray((CONTACT + ROUNDING) * np.asarray(t, float) * (1 + 1e-3) + 4e-7)


def last_steps(slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Steps from a tenth of a pixel above a plane of slope `-slope` onto it, each of which leaves at most 0.95 * 0.0875
    pixels between the two spheres."""
    r, count = np.full(np.shape(slope), NEAR / PIXEL), np.zeros(np.shape(slope))
    while np.any(r > 1e-6):
        longest = (2.0 * r + 0.95 * 0.0875) / (1.0 + slope)
        count += r > 1e-6
        r = r - slope * np.minimum(r / slope, longest)
    return count


@dataclass(frozen=True)
class Marched:
    """What a tracer found on each profile, and how the field was asked; see the module march/hit."""

    t: NDArray[np.float32]
    residual: NDArray[np.float32]
    iterations: NDArray[np.float32]
    evaluations: NDArray[np.float32]
    done: NDArray[np.bool_]
    found: NDArray[np.bool_]
    fallbacks: NDArray[np.float32]
    asked: NDArray[np.float32]
    furthest: NDArray[np.float32]
    twice: NDArray[np.float32]
    wasted: NDArray[np.float32]
    known: NDArray[np.float32]


def march(
    egl: Context,
    text: str,
    profiles: Profiles,
    begin: float = 0.0,
    far: float = 20.0,
    steps: int = 512,
    side: int = 1,
    slope: float | None = None,
    start: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
) -> Marched:
    """March all profiles from `begin` to `far`, with a slope that cones have handed on, or None.

    start : gradient and value of the field at distance 0, or zeros if they are not known.
    """
    count = len(profiles)
    part = np.repeat([0, 1, 2], count)
    about = np.column_stack(
        [
            np.full(3 * count, begin),
            np.full(3 * count, far),
            part,
            np.full(3 * count, UNKNOWN if slope is None else slope),
        ]
    )
    knots = [np.tile(half, (3, 1)) for half in profiles.halves()]
    uniforms = {"u_pixel": PIXEL, "u_side": float(side), "march_steps": steps, "u_start": tuple(start)}
    inputs = [(VEC4, given) for given in (*knots, about)]
    found = run(egl, text, "traced({0}, {1}, {2}, {3}, {4})", inputs, 4, uniforms).reshape(3, count, 4)
    t, residual, iterations, evaluations = found[0].T
    done, hit, fallbacks, asked = found[1].T
    furthest, twice, wasted, known = found[2].T
    return Marched(
        t, residual, iterations, evaluations, done == 1, hit == 1, fallbacks, asked, furthest, twice, wasted, known
    )
