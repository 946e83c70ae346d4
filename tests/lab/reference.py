"""Light and materials against Mitsuba 3, an independent renderer: the relative error of the mean, and of each pixel.

python -m tests.lab.reference [WIDTH [BATCHES [SAMPLES]]]

Needs `pip install mitsuba scipy`. Geometry is a floor and balls. The first picture of ours is of the
pixels' middles, Mitsuba's are means over them, so single pixels differ at edges. Then both are drawn in independent
batches, as means over the pixel, and each pixel's difference is tested against its noise (`tests.lab.ztest`).
Brightness: our intensities are times pi in physical units.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.scene.bsdf import Microfacets
from tests.lab.ztest import Verdict, our_batches, verdict
from tests.support.bsdf import LIGHT, VIEW, Z, material

PI = math.pi
CAMERA = {"position": (0.4, 2.2, 4.5), "target": (0.1, 0.4, 0.0), "fov": 40.0}
BALL, RADIUS = (0.2, 0.7, 0.1), 0.5


@dataclass(frozen=True)
class Compared:
    """One scene, both ways: our lights, sky and material, and Mitsuba's emitters and BSDF.

    samples : Mitsuba's rays a pixel. depth : its `max_depth`. floor : whether there is one, not only a ball.
    """

    ours: Callable[[], dict[str, Any]]
    skin: Callable[[], rm.Material]
    emitters: Callable[[Any], dict[str, Any]]
    bsdf: dict[str, Any]
    samples: int = 32
    floor: bool = True
    depth: int = 2
    ball: dict[str, Any] | None = None  # another BSDF for the ball
    ball_skin: Callable[[], rm.Material] | None = None


def _color(*rgb: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(rgb)}


MATTE = {"type": "diffuse", "reflectance": _color(0.6, 0.4, 0.3)}


def _matte() -> rm.Material:
    return rm.Material((0.6, 0.4, 0.3), specular=0.0, ambient=0.0)


def _sun(mi: Any) -> dict[str, Any]:
    return {"sun": {"type": "directional", "direction": [-1.0, -1.5, -0.5], "irradiance": _color(PI, PI, PI)}}


def _point(mi: Any) -> dict[str, Any]:
    return {"lamp": {"type": "point", "position": [1.5, 2.5, 1.5], "intensity": _color(*[8 * PI] * 3)}}


def _spot(mi: Any) -> dict[str, Any]:
    look = mi.ScalarTransform4f().look_at([0.5, 3.5, 1.0], [0.2, 0.2, 0.1], [0, 0, 1])
    whole = math.degrees(0.6)
    return {
        "lamp": {
            "type": "spot",
            "to_world": look,
            "intensity": _color(*[12 * PI] * 3),
            "cutoff_angle": whole,
            "beam_width": whole - 1e-3,
        }
    }


def _ball_of_light(mi: Any) -> dict[str, Any]:
    emitter = {"type": "area", "radiance": _color(*[10 / 0.3**2] * 3)}
    return {"lamp": {"type": "sphere", "center": [1.2, 3.2, 0.8], "radius": 0.3, "light": emitter}}


def _rectangle(mi: Any) -> dict[str, Any]:
    place = mi.ScalarTransform4f().look_at([1.2, 3.2, 0.8], [0.2, 0.2, 0.2], [0, 1, 0])
    emitter = {"type": "area", "radiance": _color(*[10 * PI / (1.2 * 0.8)] * 3)}
    return {"lamp": {"type": "rectangle", "to_world": place.scale([0.6, 0.4, 1.0]), "light": emitter}}


def _sky(mi: Any) -> dict[str, Any]:
    return {"sky": {"type": "constant", "radiance": _color(0.4, 0.6, 0.9)}}


SHADOWED = {"shadow": True}
SUN = {"sun_direction": (1.0, 1.5, 0.5), **SHADOWED}


def _metal(roughness: float) -> tuple[Callable[[], rm.Material], dict[str, Any]]:
    bsdf = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": roughness**2}
    return lambda: rm.Material(albedo=(1, 1, 1), metalness=1.0, roughness=roughness), bsdf


METAL, METAL_BSDF = _metal(0.6)

SEPARABLE = rm.Quality(masking="separable", energy_compensation=False)
"""What Mitsuba's rough conductors are: one reflection, and Smith's separable masking."""

SCENES = {
    "sun": Compared(lambda: {"lights": [rm.Sun(**SUN)]}, _matte, _sun, MATTE),
    "point": Compared(
        lambda: {"lights": [rm.PointLight((1.5, 2.5, 1.5), intensity=8, shadow=True)]}, _matte, _point, MATTE
    ),
    "spot": Compared(
        lambda: {
            "lights": [
                rm.SpotLight((0.5, 3.5, 1.0), (-0.3, -3.3, -0.9), half_angle=0.6, blend=0.0, intensity=12, shadow=True)
            ]
        },
        _matte,
        _spot,
        MATTE,
    ),
    "area": Compared(
        lambda: {"lights": [rm.SphereLight((1.2, 3.2, 0.8), 0.3, intensity=10, shadow=True)]},
        _matte,
        _ball_of_light,
        MATTE,
        samples=96,
    ),
    "sky": Compared(
        lambda: {"lights": [], "sky": rm.Sky((0.4, 0.6, 0.9), light=True)}, _matte, _sky, MATTE, samples=96, floor=False
    ),
    "metal": Compared(lambda: {"lights": [rm.Sun(**SUN)], "quality": SEPARABLE}, METAL, _sun, METAL_BSDF),
    "dielectric": Compared(
        lambda: {"lights": [rm.Sun(**SUN)]},
        lambda: rm.Material(albedo=(0.7, 0.3, 0.2), roughness=0.45),
        _sun,
        {"type": "raymarch_dielectric"},
        samples=8,
    ),
}


MANY = rm.Quality(samples=256)

SCENES |= {
    "rectangle": Compared(
        lambda: {
            "lights": [rm.RectLight((1.2, 3.2, 0.8), 1.2, 0.8, (-1.0, -3.0, -0.6), intensity=10, shadow=True)],
            "quality": rm.Quality(samples=256, masking="separable", energy_compensation=False),
        },
        METAL,
        _rectangle,
        METAL_BSDF,
        256,
    ),
    "area, sampled": Compared(
        lambda: {
            "lights": [rm.SphereLight((1.2, 3.2, 0.8), 0.3, intensity=10, shadow=True, penumbra="sampled")],
            "quality": rm.Quality(samples=256, masking="separable", energy_compensation=False),
        },
        _metal(0.35)[0],
        _ball_of_light,
        _metal(0.35)[1],
        256,
    ),
    "smooth, rectangle": Compared(
        lambda: {
            "lights": [rm.RectLight((1.2, 3.2, 0.8), 1.2, 0.8, (-1.0, -3.0, -0.6), intensity=10, shadow=True)],
            "quality": rm.Quality(samples=256, masking="separable", energy_compensation=False),
        },
        _metal(0.2)[0],
        _rectangle,
        _metal(0.2)[1],
        256,
    ),
    "sky on a floor": Compared(
        lambda: {"lights": [], "sky": rm.Sky((0.4, 0.6, 0.9)), "bounces": 1, "quality": MANY}, _matte, _sky, MATTE, 256
    ),
    "one bounce": Compared(
        lambda: {"lights": [rm.Sun(**SUN)], "bounces": 1, "quality": MANY}, _matte, _sun, MATTE, 256, depth=3
    ),
    "metal in a sky": Compared(
        lambda: {
            "lights": [],
            "sky": rm.Sky((0.4, 0.6, 0.9)),
            "bounces": 2,
            "quality": rm.Quality(samples=256, masking="separable", energy_compensation=False),
        },
        _matte,
        _sky,
        MATTE,
        256,
        depth=3,
        ball=_metal(0.3)[1],
        ball_skin=_metal(0.3)[0],
    ),
    "another sky's light": Compared(
        lambda: {"lights": [], "sky": rm.Sky((1, 0.2, 0.1), light=rm.Sky((0.4, 0.6, 0.9)))},
        _matte,
        _sky,
        MATTE,
        samples=96,
        floor=False,
    ),
    "half a sky's light": Compared(
        lambda: {"lights": [], "sky": rm.Sky((0.8, 1.2, 1.8), light=0.5), "bounces": 1, "quality": MANY},
        _matte,
        _sky,
        MATTE,
        256,
    ),
    "metal in another sky": Compared(
        lambda: {
            "lights": [],
            "sky": rm.Sky("white", light=rm.Sky((0.4, 0.6, 0.9))),
            "bounces": 2,
            "quality": rm.Quality(samples=256, masking="separable", energy_compensation=False),
        },
        _matte,
        _sky,
        MATTE,
        256,
        depth=3,
        ball=_metal(0.3)[1],
        ball_skin=_metal(0.3)[0],
    ),
    "glass": Compared(
        lambda: {"lights": [], "sky": rm.Sky((0.4, 0.6, 0.9)), "bounces": 6, "quality": MANY},
        _matte,
        _sky,
        MATTE,
        256,
        depth=7,
        ball={"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0},
        ball_skin=lambda: rm.Material(transmission=1.0, ior=1.5),
    ),
    "frosted glass": Compared(
        lambda: {"lights": [], "sky": rm.Sky((0.4, 0.6, 0.9)), "bounces": 16, "quality": MANY},
        _matte,
        _sky,
        MATTE,
        256,
        depth=64,
        ball={"type": "roughdielectric", "distribution": "ggx", "alpha": 0.6**2, "int_ior": 1.5, "ext_ior": 1.0},
        ball_skin=lambda: rm.Material(transmission=1.0, ior=1.5, roughness=0.6),
    ),
}


def ours(name: str, width: int) -> rm.Scene:
    """The scene for us."""
    chosen = SCENES[name]
    ball = rm.sphere(RADIUS).translate(BALL)
    if chosen.ball_skin is not None:
        ball = ball.material(chosen.ball_skin())
    node = (ball | rm.plane() if chosen.floor else ball).material(chosen.skin())
    return rm.Scene(node, camera=rm.Camera(**CAMERA), **{"sky": (0, 0, 0), **chosen.ours()})


def theirs(mi: Any, name: str, width: int, seed: int = 0, samples: int | None = None) -> NDArray[np.float64]:
    """Mitsuba's picture, (H, W, 3), and its hits, alpha as the fourth value. samples : rays a pixel."""
    chosen = SCENES[name]
    if chosen.bsdf["type"] == "raymarch_dielectric":
        _register(mi)
    to_world = mi.ScalarTransform4f()
    height = width * 3 // 4
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": chosen.depth, "rr_depth": 100},
        "sensor": {
            "type": "perspective",
            "fov": CAMERA["fov"],
            "fov_axis": "y",
            "to_world": to_world.look_at(list(CAMERA["position"]), list(CAMERA["target"]), [0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "rfilter": {"type": "box"},
                "pixel_format": "rgba",
            },
            "sampler": {"type": "independent", "sample_count": samples or chosen.samples},
        },
        "ball": {"type": "sphere", "center": list(BALL), "radius": RADIUS, "skin": chosen.ball or chosen.bsdf},
        **chosen.emitters(mi),
    }
    if chosen.floor:
        lying = to_world.rotate([1, 0, 0], -90).scale([40, 40, 1])
        scene["floor"] = {"type": "rectangle", "to_world": lying, "skin": chosen.bsdf}
    return np.asarray(mi.render(mi.load_dict(scene), seed=seed), np.float64)


def _register(mi: Any) -> None:
    """Our dielectric as a BSDF of Mitsuba's: only evaluated, for lights that have a direction."""

    given = material(color=(0.7, 0.3, 0.2), metalness=0.0, roughness=0.45)
    value = evaluator([Microfacets().eval(given, Z, VIEW, LIGHT)], [VIEW, LIGHT])

    class Dielectric(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_flags, self.m_components = flags, [flags]

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            wi, to = np.array([float(si.wi[k]) for k in range(3)]), np.array([float(wo[k]) for k in range(3)])
            if wi[2] <= 0 or to[2] <= 0:
                return mi.Color3f(0.0)
            return mi.Color3f(*(value(wi, to)[0] / PI).tolist())

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return 0.0

        def sample(self, ctx: Any, si: Any, one: Any, two: Any, active: Any = True) -> Any:
            return mi.BSDFSample3f(), mi.Color3f(0.0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), 0.0

        def to_string(self) -> str:
            return "raymarch_dielectric"

    mi.register_bsdf("raymarch_dielectric", Dielectric)


@dataclass(frozen=True)
class Error:
    """mean : relative error of the mean light over the hits. median, p95 : of single pixels, over the mean light."""

    mean: float
    median: float
    p95: float


def compare(frame: rm.Frame, known: NDArray[Any], factor: float = 1.0) -> Error:
    """Our picture, times a factor, against theirs (H, W, 4), where a pixel and all around it are hit."""
    near = np.pad((frame.depth < 20.0) & (known[..., 3] > 0.999), 1, "edge")  # the floor of theirs ends
    rows, columns = frame.depth.shape
    hit = np.all([near[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=0)
    found = factor * frame.color
    a, b = np.asarray(found, np.float64)[hit], known[hit][:, :3]
    off = np.abs(a - b).mean(axis=1) / b.mean()
    return Error(float(abs(a.mean() - b.mean()) / b.mean()), float(np.median(off)), float(np.percentile(off, 95)))


def judged(mi: Any, renderer: rm.Renderer, name: str, batches: int, samples: int) -> Verdict:
    """Whether our picture is Mitsuba's, but for noise: all that is nearer than where their floor ends."""
    width, scene = renderer.size[0], ours(name, renderer.size[0])
    mine = our_batches(renderer, scene, batches, samples)
    known = np.stack([theirs(mi, name, width, 1 + k, samples) for k in range(batches)])
    depth = renderer.render(scene).depth
    far = ~np.isfinite(depth) | (depth > 20.0) if SCENES[name].floor else np.zeros_like(depth, bool)
    around = np.pad(far, 1, "edge")
    rows, columns = far.shape
    near = ~np.any([around[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=0)
    return verdict(mine, known[..., :3], near)


def main() -> None:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    width, batches, samples = (int(v) for v in (*sys.argv[1:], *("96", "32", "16")[len(sys.argv) - 1 :]))
    print(f"{'':<16}{f'relative errors, {width} pixels wide':>30}{f'z-test, {batches} times {samples} samples':>40}")
    heads = ("mean", "median", "p95", "pixels", "different", "worst", "allowed", "whole")
    print(f"{'scene':<16}" + "".join(f"{head:>10}" for head in heads))
    with rm.Renderer((width, width * 3 // 4)) as renderer:
        for name in SCENES:
            error = compare(renderer.render(ours(name, width)), theirs(mi, name, width))
            few = min(samples, SCENES[name].samples)
            z = judged(mi, renderer, name, batches, few)
            shares = "".join(f"{v:>10.4%}" for v in (error.mean, error.median, error.p95))
            print(
                f"{name:<16}{shares}{z.pixels:>10}{z.different:>10}{z.worst:>10.2f}{z.allowed:>10.2f}{z.whole:>10.2f}"
            )


if __name__ == "__main__":
    main()
