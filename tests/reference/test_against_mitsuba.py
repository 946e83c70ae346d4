"""Light and materials against Mitsuba 3; `python -m tests.lab.reference` prints the figures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import expr
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import Microfacets
from raymarch.scene.layers import Coated
from tests.functions.directions import slanted
from tests.lab import media
from tests.lab.reference import SCENES, compare, judged, ours, theirs
from tests.lab.ztest import verdict
from tests.support.bsdf import evaluated, material

WIDTH = 32


@pytest.mark.parametrize(
    "name", [name for name in SCENES if name != "smooth, rectangle"]
)  # one pixel has half its light
def test_our_light_is_mitsubas(name: str, mitsuba: Any, egl: Context) -> None:
    """The mean light within a percent; single pixels, where a shadow's border does not cross them, as well."""
    with rm.Renderer((WIDTH, WIDTH * 3 // 4), context=egl) as renderer:
        error = compare(renderer.render(ours(name, WIDTH)), theirs(mitsuba, name, WIDTH))
    noise = 0.05 if SCENES[name].samples > 32 else 0.01  # of single pixels, in both pictures
    assert error.mean <= 0.01 and error.median <= noise, error


def test_an_error_would_be_seen(mitsuba: Any, egl: Context) -> None:
    """A picture two percent too bright, or of the other masking, is told from the right one."""
    with rm.Renderer((WIDTH, WIDTH * 3 // 4), context=egl) as renderer:
        known = theirs(mitsuba, "metal", WIDTH)
        right = ours("metal", WIDTH)
        frame = renderer.render(right)
        wrong = renderer.render(rm.Scene(right.node, right.camera, right.lights, right.sky))
        assert compare(frame, known, 1.02).mean > 0.01
        assert compare(wrong, known).median > 2 * compare(frame, known).median


@pytest.mark.parametrize("name", ["point", "one bounce", "glass", "frosted glass", "smooth, rectangle"])
def test_our_pixels_differ_from_mitsubas_by_no_more_than_noise(name: str, mitsuba: Any, egl: Context) -> None:
    """Shadows, light between surfaces, refraction: of pictures that are the same, one in a hundred would fail."""
    with rm.Renderer((24, 18), context=egl) as renderer:
        found = judged(mitsuba, renderer, name, batches=24, samples=16)
    assert found.pixels > 300
    assert found.different == 0 and found.whole < 4.0, found


@pytest.mark.parametrize("roughness", [0.3, 0.7])
@pytest.mark.parametrize("coat", [0.2, 0.5])
def test_the_lobes_of_a_clear_coat_are_mitsubas(mitsuba: Any, roughness: float, coat: float) -> None:
    """Its value is T(light) T(view) times Mitsuba's white rough conductor of the base, plus Schlick's reflectance times
    that of the coat; `test_clear_coat` judges the transmittance T."""
    bsdf = Coated(Microfacets("separable"))
    given = material(color=(1.0, 1.0, 1.0), metalness=1.0, roughness=roughness, clearcoat=0.7, clearcoat_roughness=coat)
    for light, view in (((0.9, 0.0), (0.6, 0.0)), ((0.5, 2.0), (0.8, 0.5)), ((0.4, 3.0), (0.45, 0.1))):
        to, eye = slanted(*light), slanted(*view)
        half = (to + eye) / np.linalg.norm(to + eye)
        base, over = (_rough_conductor(mitsuba, alpha**2, eye, to) for alpha in (roughness, coat))
        passed = [float(evaluator([bsdf.transmittance(given, expr(c))], [])()[0]) for c in (to[2], eye[2])]
        known = passed[0] * passed[1] * base + 0.7 * (0.04 + 0.96 * (1 - half @ eye) ** 5) * over
        found = evaluated(None, bsdf, given, to[None], eye[None])[0] / np.pi
        np.testing.assert_allclose(found, known, rtol=1e-5)


def _rough_conductor(mi: Any, alpha: float, view: Any, light: Any) -> float:
    bsdf = mi.load_dict({"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha})
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(*view.tolist())
    return float(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*light.tolist()))[0])


def test_the_test_of_significance_sees_what_it_should() -> None:
    """The same light passes; light that is a little brighter, and one pixel that is off, do not."""
    random = np.random.default_rng(1)
    noise = [1.0 + 0.05 * random.standard_normal((32, 16, 16, 1)) * np.ones(3) for _ in range(2)]
    every = np.ones((16, 16), bool)
    same = verdict(noise[0], noise[1], every)
    assert same.different == 0 and same.whole < 3.0 and same.worst < same.allowed
    brighter = verdict(1.004 * noise[0], noise[1], every)
    assert brighter.whole > 4.0
    noise[0][:, 3, 3] += 0.08
    assert verdict(noise[0], noise[1], every).different == 1
    still = np.ones((4, 16, 16, 3))
    assert verdict(still, still, every).worst == 0.0 and verdict(1.001 * still, still, every).different == 256


@pytest.mark.parametrize("case", [media.Case(4.0, 0.7, "sun"), media.Case(None, -0.5, "lamp")], ids=str)
def test_light_that_a_medium_scatters_once_is_mitsubas(case: media.Case, mitsuba: Any, egl: Context) -> None:
    """Even matter, and densities on a grid; another anisotropy is told from the right one."""
    size = (16, 12)
    batches = media.known(mitsuba, case, size, samples=1024)
    with rm.Renderer(size, context=egl) as renderer:
        right = media.compared(renderer.render(media.ours(case)), batches)
        wrong = media.compared(renderer.render(media.ours(replace(case, g=case.g + 0.1))), batches)
    assert abs(right.mean) <= 0.01 and abs(wrong.mean) > 0.02, (right, wrong)


@pytest.mark.parametrize("radius", [0.3, (0.3, 0.15, 0.1)])
def test_light_that_walks_in_a_ball_is_mitsubas(radius: Any, mitsuba: Any, egl: Context) -> None:
    """What leaves a ball of matter in a white sky, of the index of refraction of the air. All directions are equally
    bright there, so it does not matter how light enters and leaves. Other matter is told from it."""
    colors = np.array([0.3, 0.8, 0.95])
    s = 4.09712 + 4.20863 * colors - np.sqrt(9.59217 + 41.6808 * colors + 17.7126 * colors**2)
    paths = np.broadcast_to(np.asarray(radius, np.float64), 3)
    matter = {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": (0.01 / paths).tolist()},
        "scale": 100.0,
        "albedo": {"type": "rgb", "value": (1 - s * s).tolist()},
    }
    film = {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}}
    camera = mitsuba.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
    scene = {
        "type": "scene",
        "integrator": {"type": "volpathmis", "max_depth": 2000, "rr_depth": 50},
        "sensor": {"type": "orthographic", "to_world": camera, "film": film, "sampler": {"type": "independent"}},
        "sky": {"type": "constant", "radiance": 1.0},
        "ball": {"type": "sphere", "skin": {"type": "null"}, "interior": matter},
    }
    known = np.asarray(mitsuba.render(mitsuba.load_dict(scene), spp=256)).mean(axis=(0, 1))
    known = (known - (1 - np.pi / 4)) / (np.pi / 4)

    def found(color: Any, radius: Any = radius) -> Any:
        given = {"roughness": 1.0, "f0": 0.0, "subsurface": 1.0, "subsurface_radius": radius, "subsurface_color": color}
        camera = rm.Camera((0, 0, 60), (0, 0, 0), fov=1.8)
        sky, quality = rm.Sky((1, 1, 1), light=True), rm.Quality(samples=64)
        ball = rm.sphere(1).material(rm.Material(**given))
        frame = renderer.render(rm.Scene(ball, camera, [], sky, bounces=1, quality=quality))
        return frame.color[np.isfinite(frame.depth)].mean(axis=0)

    with rm.Renderer((24, 24), context=egl) as renderer:
        own = found((0, 0, 0), 1e-7)  # of the surface itself
        np.testing.assert_allclose((found(tuple(colors)) - own) / (1 - own), known, atol=0.016)
        assert abs((found(tuple(colors - 0.05)) - own) / (1 - own) - known)[0] > 0.03
