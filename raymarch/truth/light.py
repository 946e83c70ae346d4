"""Incident light of emitters, soft shadows and the microfacet BRDF in float64."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.walk import free_variables
from raymarch.scene.light import FAR, POINT, SAMPLE, Light, sample_of
from raymarch.scene.parameter import Values
from raymarch.sdf.facts import Facts
from raymarch.truth.rays import Rays, unit

Array = NDArray[np.float64]

MAX_STEPS = 5_000
"""Maximum steps of a soft shadow; after these the visibility found so far is used."""


@dataclass(frozen=True, slots=True)
class Incoming:
    """Light at N points: unit directions towards its source (N, 3), distances (N,), radiance (N, 3)."""

    direction: Array
    distance: Array
    radiance: Array


def incoming(light: Light, values: Values, points: Array, far: float, u: tuple[float, float] = (0.5, 0.5)) -> Incoming:
    """Incident light of an emitter at some points, by its `sample_direction`.

    far : far distance of camera rays. No two points of the scene are farther apart than twice that. u : the random
    numbers of a light with an area.
    """
    shape = points.shape
    with bound(values.params, values.time):
        found = evaluator(sample_of(light), [POINT, SAMPLE, FAR])
        direction, distance, radiance = found(
            points, np.broadcast_to(u, (len(points), 2)), np.full(len(points), 2.0 * far)
        )
    return Incoming(
        np.broadcast_to(direction, shape), np.broadcast_to(distance, shape[:1]), np.broadcast_to(radiance, shape)
    )


DISC_SAMPLES = 64
"""Number of points that replace the shader's random point on the disc of a light."""


def area_samples(light: Light) -> list[tuple[float, float]]:
    """Random numbers for the reference: evenly spread for a light with an area, else a single pair."""
    if SAMPLE not in free_variables(sample_of(light)):
        return [(0.5, 0.5)]
    side = math.isqrt(DISC_SAMPLES)
    return [((i + 0.5) / side, (j + 0.5) / side) for i in range(side) for j in range(side)]


def disc_samples(incident: Incoming, width: Array) -> Iterator[Incoming]:
    """The same light from evenly spread points of its disc; `width` is the sin2_h of its angular radius, (N,)."""
    helper = np.where(np.abs(incident.direction[:, 1:2]) < 0.9, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    across = unit(np.cross(incident.direction, helper))
    along = np.cross(incident.direction, across)
    for k in range(DISC_SAMPLES):
        r, phi = np.minimum(width[:, None], 0.999) * np.sqrt((k + 0.5) / DISC_SAMPLES), k * 2.399963
        c = np.sqrt(1.0 - r * r)
        direction = c * incident.direction + r * (np.cos(phi) * across + np.sin(phi) * along)
        yield Incoming(direction, incident.distance, incident.radiance / c)


def soft_visibility(
    light: Light, values: Values, field: Callable[[Array], Array], rays: Rays, box: Facts, near: Array, end: Array
) -> Array:
    """Visible fraction of a soft light along each ray, (N,), by the light's `penumbra`.

    field : distances, positive outside. near : start of the rays, > 0. end : distance of the light.

    These forms approximate the visible fraction of the disc. They are evaluated with the steps of the shader, in
    float64. `tests/truth/test_truth_soft_shadows.py` measures their errors against the disc.
    """
    width = values.of(light.softness) / (np.maximum(end, 1e-300) if light.has_position else 1.0)
    width = np.broadcast_to(width, end.shape)
    s, stop = _inside_cone(rays, box, width, near, end)
    rule = {"two-sided": _TwoSided, "cone": _Cone, "triangulated": _Triangulated}[light.penumbra](len(end))
    row = np.flatnonzero(s < stop)
    for _ in range(MAX_STEPS):
        if not row.size:
            break
        r = field(rays.at(row, s[row]))
        s[row] += rule.step(row, r, s[row], width[row], near[row])
        row = row[(rule.least[row] > -1.0) & (s[row] < stop[row])]
    return rule.visibility()


class _Cone:
    """The smallest clearance over the disc's radius so far, from -1 (fully occluded) to 1; (N,)."""

    def __init__(self, n: int) -> None:
        self.least = np.ones(n)

    def step(self, row: NDArray[Any], r: Array, s: Array, width: Array, near: Array) -> Array:
        """Update with the distances r at s on some rays; returns the length of the next step."""
        least = np.minimum(self.least[row], r / (width * s))
        self.least[row] = np.where(r <= 0.125 * near, -1.0, least)
        return r

    def visibility(self) -> Array:
        """Visible fraction of the light, (N,)."""
        result: Array = np.maximum(self.least, 0.0)
        return result


class _Triangulated(_Cone):
    """`_Cone` with the clearance between samples estimated; `last` is the previous distance, 0 for none."""

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.last = np.zeros(n)

    def step(self, row: NDArray[Any], r: Array, s: Array, width: Array, near: Array) -> Array:
        last = self.last[row]
        back = np.where(last > 0.0, r * r / (2.0 * np.where(last > 0.0, last, 1.0)), 0.0)
        back = np.where(back > last, 0.0, back)
        found = np.sqrt(np.maximum(r * r - back * back, 0.0)) / (width * np.maximum(s - back, near))
        self.least[row] = np.where(r <= 0.125 * near, -1.0, np.minimum(self.least[row], found))
        self.last[row] = r
        return r


class _TwoSided(_Cone):
    """`_Cone` with signed clearance: negative inside of an occluder."""

    def step(self, row: NDArray[Any], r: Array, s: Array, width: Array, near: Array) -> Array:
        reach = width * s
        self.least[row] = np.maximum(np.minimum(self.least[row], r / reach), -1.0)
        result: Array = np.maximum(np.maximum(0.5 * np.abs(r), r - width * (s + r)), 0.05 * reach)
        return result

    def visibility(self) -> Array:
        r = self.least
        result: Array = 0.5 + (r * np.sqrt(1.0 - r * r) + np.arcsin(r)) / np.pi
        return result


def _inside_cone(rays: Rays, box: Facts, width: Array, near: Array, end: Array) -> tuple[Array, Array]:
    """Distances at which cones about the rays enter and leave a box; `width` is the tangent of their half angle."""
    start, stop = near.copy(), end.copy()
    for axis in range(3):
        o, d = rays.origins[:, axis], rays.directions[:, axis]
        for side, plane in ((1.0, box.upper[axis]), (-1.0, -box.lower[axis])):
            if not np.isfinite(plane):
                continue
            slope = side * d - width
            slope = np.where(np.abs(slope) < 1e-20, 1e-20, slope)
            t = (plane - side * o) / slope
            stop = np.where(slope > 0.0, np.minimum(stop, t), stop)
            start = np.where(slope > 0.0, start, np.maximum(start, t))
    return start, stop


def microfacets(
    normal: Array,
    view: Array,
    light: Array,
    color: Array,
    metalness: Any,
    roughness: Any,
    f0: Array,
    masking: str,
    compensated: bool = True,
) -> Array:
    """Cook-Torrance BRDF times n_dot_l and pi, (N, 3).

    normal, view, light : unit vectors (N, 3). color, f0 : (N, 3). metalness, roughness : (N, 1). masking : see
    `Quality`. compensated : add the multiple scattering of metals, see `multiscatter_albedo`.

    D is GGX (Walter et al. 2007), F is Schlick (1994), and the masking-shadowing is Smith's, height-correlated (Heitz
    2014) or separable. The diffuse term uses `interface_transmittance`. The result is 0 where n_dot_l <= 0.
    """
    n_dot_l = np.einsum("ij,ij->i", normal, light)[:, None]
    n_dot_v = np.maximum(np.einsum("ij,ij->i", normal, view)[:, None], 1e-4)
    lit = n_dot_l > 0.0
    n_dot_l = np.where(lit, n_dot_l, 1.0)
    half_vector = unit(light + view)
    alpha = np.maximum(roughness * roughness, 1e-3)
    alpha2, one_minus_alpha2 = alpha**2, 1.0 - alpha**2
    n_dot_h = np.einsum("ij,ij->i", normal, half_vector)[:, None]
    sin2_h = np.sum(np.cross(normal, half_vector) ** 2, axis=1, keepdims=True)
    d_ggx = alpha2 / (sin2_h + alpha2 * n_dot_h**2) ** 2  # times pi
    lambda_v, lambda_l = (np.sqrt(c * c * one_minus_alpha2 + alpha2) for c in (n_dot_v, n_dot_l))
    if masking == "correlated":
        v_smith = 0.5 / (n_dot_l * lambda_v + n_dot_v * lambda_l)
    else:
        v_smith = 1.0 / ((n_dot_l + lambda_l) * (n_dot_v + lambda_v))
    base = f0 * (1.0 - metalness) + color * metalness
    v_dot_h = np.einsum("ij,ij->i", half_vector, view)[:, None]
    specular = (base + (1.0 - base) * np.clip(1.0 - v_dot_h, 0.0, 1.0) ** 5) * d_ggx * v_smith
    transmitted = interface_transmittance(n_dot_l, n_dot_v, roughness) * (1.0 - metalness)
    multiscatter: Any = 0.0
    if compensated:
        lobe = missing_albedo(n_dot_l, roughness, masking) / mean_missing_albedo(roughness, masking)
        multiscatter = lobe * multiscatter_albedo(n_dot_v, color, metalness, roughness, masking)
    result: Array = np.where(lit, n_dot_l * (specular + multiscatter + transmitted * (1.0 - f0) * color), 0.0)
    return result


@dataclass(frozen=True)
class _Missing:
    """Coefficients of `missing_albedo`: polynomials of alpha, from the constant on, by the power of the cosine."""

    above: tuple[tuple[float, ...], ...]
    below: tuple[tuple[float, ...], ...]
    mean_above: tuple[float, ...]
    mean_below: tuple[float, ...]


_MISSING = {
    "correlated": _Missing(
        ((0.0,), (0.2448, -0.0067, 3.9077), (1.3351, -0.281, 2.9461), (-1.9867, 10.9215, -6.6435)),
        ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.3633, 7.3622), (0.0, -0.6629, 1.5333), (0.588, 3.8876)),
        (0.0, 0.0, 0.0, 0.0, 9.1786, -13.3576, 7.2436),
        (1.0, 7.9611, -17.1284, 13.3432),
    ),
    "separable": _Missing(
        (
            (0.0, 0.0457, 0.2015, 0.142),
            (4.5024, 2.3809, 102.1036),
            (52.1098, 7.7107, 106.6024),
            (-88.7519, 436.681, -264.5132),
        ),
        ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 58.4572, 217.8073), (0.0, -36.7, 123.225), (16.5361, 141.6331)),
        (0.0, 0.0, 0.0, 0.0, 6.9992, -31.8371, 54.3927, -22.8858),
        (1.0, 0.8659, -12.5989, 21.4558),
    ),
}


def missing_albedo(v: Any, r: Any, masking: str) -> Array:
    """1 minus the single-scattering directional albedo of white microfacets of roughness r at n_dot_v = v.

    A fit to the integral of `microfacets`: at most 0.008 below it and 0.005 above with correlated masking, 0.01 and
    0.005 with separable."""
    fit, alpha, c = _MISSING[masking], np.maximum(r * r, 1e-6), np.clip(v, 1e-4, 1.0)
    above = polyval(c, [polyval(alpha, k) for k in fit.above], tensor=False)
    below = polyval(c, [polyval(alpha, k) for k in fit.below], tensor=False)
    result: Array = np.clip(alpha**2 * above / below, 0.0, 1.0)
    return result


def mean_missing_albedo(r: Any, masking: str) -> Array:
    """Cosine-weighted mean of `missing_albedo`."""
    fit, r = _MISSING[masking], np.maximum(r, 1e-3)
    result: Array = polyval(r, fit.mean_above) / polyval(r, fit.mean_below)
    return result


def multiscatter_albedo(v: Array, color: Array, metalness: Any, r: Any, masking: str) -> Array:
    """Multiple-scattering directional albedo of a metal at n_dot_v = v (Kulla and Conty 2017)."""
    missing = mean_missing_albedo(r, masking)
    mean = color + (1.0 - color) / 21.0  # cosine-weighted mean of Schlick's Fresnel term
    further = mean**2 * (1.0 - missing) / (1.0 - mean * missing)
    result: Array = metalness * missing_albedo(v, r, masking) * further
    return result


def albedo_f90(v: Array, r: Array) -> Array:
    """Directional albedo of the f90 part of Schlick's Fresnel term, (1 - v)^5 averaged over a surface of roughness r.

    The directional albedo is f0 (1 - this) + this. A fit to the integral of `microfacets`: at most 0.003 below it, 0.03
    above, and 0.1 above where v < 0.1."""
    result: Array = np.maximum(1.0 - v, 0.0) ** _power(r) / (1.0 + r * r * (6.6 + 17.43 * r))
    return result


def _power(r: Array) -> Array:
    return 5.0 + r * (6.06 * r - 7.04)


def interface_transmittance(to_light: Array, v: Array, r: Array) -> Array:
    """Transmittance through the interface, in at n_dot_l = `to_light` and out at n_dot_v = v, over (1 - f0).

    (1 - a(to_light)) (1 - a(v)) / (1 - mean) with a = `albedo_f90` and its cosine-weighted mean, 2 times the integral
    of v a(v) (Kelemen and Szirmay-Kalos 2001). At roughness 0 this is the diffuse term of Ashikhmin and Shirley (2000).
    """
    power = _power(r)
    mean = 2.0 * albedo_f90(np.zeros_like(power), r) / ((power + 1.0) * (power + 2.0))
    return (1.0 - albedo_f90(to_light, r)) * (1.0 - albedo_f90(v, r)) / (1.0 - mean)


def directional_albedo(v: Array, r: Array, masking: str) -> tuple[Array, Array]:
    """Single-scattering directional albedo of microfacets of roughness r at n_dot_v = v.

    It is f0 times the first value plus the second."""
    total = 1.0 - missing_albedo(v, r, masking)
    edge = np.minimum(albedo_f90(v, r), total)
    return total - edge, edge
