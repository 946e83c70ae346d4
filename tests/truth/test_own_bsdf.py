"""A BSDF of a scene file: shader and reference evaluate the same class, and wrong ones are refused."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.node import Expr
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.scene.bsdf import BSDF, Microfacets
from raymarch.shader import assemble
from tests.support.refusals import refused


class Velvet(Microfacets):
    def eval(self, values: Mapping[str, Expr], normal: Expr, view: Expr, light: Expr) -> Expr:
        facing = rm.clamp(rm.dot(normal, view), 0.0, 1.0)
        rim = 0.5 * rm.dot(normal, light) * (1.0 - facing) ** 3 * values["color"]
        return Microfacets.eval(self, values, normal, view, light) + rim


class Flat(Velvet):
    def eval(self, values: Mapping[str, Expr], normal: Expr, view: Expr, light: Expr) -> Expr:
        return values["color"].x


class Misspelt(Velvet):
    def eval(self, values: Mapping[str, Expr], normal: Expr, view: Expr, light: Expr) -> Expr:
        return values["colour"]


VELVET = rm.Material(albedo=(0.6, 0.1, 0.2), roughness=0.9, bsdf=Velvet)
LIGHTS = [rm.Sun((1, 1, 1))]
PLAIN = rm.Material(albedo=(0.9, 0.8, 0.2), metalness=1.0)


@pytest.mark.parametrize("others", [(), (PLAIN,), (rm.Material((0.2, 0.3, 0.8)), PLAIN)])
def test_shader_and_reference_evaluate_it(egl: Context, others: tuple[rm.Material, ...]) -> None:
    """Alone, and blended smoothly with microfacets and with Phong."""
    balls = [rm.sphere().material(m).translate((0.8 * i, 0, 0)) for i, m in enumerate((VELVET, *others))]
    scene = rm.Scene(rm.union(*balls, k=0.3) if others else balls[0], rm.Camera((0, 1, 5)), LIGHTS)
    plainer = rm.Scene(rm.sphere().material(VELVET.replace(bsdf=None)), scene.camera, LIGHTS) if not others else None
    with rm.Renderer((24, 18), context=egl) as renderer:
        found = renderer.render(scene).color
        if plainer is not None:
            assert np.abs(found - renderer.render(plainer).color).max() > 0.02
    off = np.abs(found - rm.truth(scene, (24, 18)).color).max(axis=-1)
    assert np.quantile(off, 0.97) < 1e-4, np.sort(off.ravel())[-20:]
    assert ("float own;" in assemble(plan(scene)).text()) == bool(others)


def test_it_belongs_to_the_material() -> None:
    assert pickle.loads(pickle.dumps(VELVET)) == VELVET != VELVET.replace(bsdf=None)
    assert VELVET.replace(roughness=0.2).bsdf is Velvet and VELVET.physical
    assert plan(rm.Scene(rm.sphere().material(VELVET))).bsdf.fields == Microfacets().fields


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rm.Material(bsdf=3), ("bsdf = 3", "derived from a BSDF")),
        (lambda: rm.Material(bsdf=rm.Sun), ("Sun", "derived from a BSDF")),
        (lambda: rm.Material(bsdf=BSDF), ("BSDF", "eval")),
        (lambda: rm.Material(bsdf=Flat), ("Flat.eval gives float", "vec3")),
        (lambda: rm.Material(bsdf=Misspelt), ("Misspelt reads the value 'colour'", "color, shininess")),
        (lambda: rm.Material(shininess=3, bsdf=Velvet), ("shininess together with bsdf",)),
        (
            lambda: plan(rm.Scene(rm.sphere().material(VELVET) | rm.box(1).material(rm.Material(bsdf=Shiny)))),
            ("the BSDFs Velvet and Shiny", "one class"),
        ),
    ],
)
def test_what_is_no_bsdf_is_refused(make: Any, words: tuple[str, ...]) -> None:
    refused(make, *words)


class Shiny(Velvet):
    pass
