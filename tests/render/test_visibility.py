"""Solids hidden from kinds of rays: the shader and the reference, and scenes without the hidden solid."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import PlanError, SceneError
from raymarch.export.text.glsl import text_of
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.scene.parameter import Values
from raymarch.sdf.visibility import KINDS
from raymarch.shader import assemble

SIZE = (24, 18)
FLOOR = rm.plane(offset=-0.6).material(rm.Material(albedo=(0.6, 0.6, 0.5), roughness=0.9))
MIRROR = (
    rm.box((4, 3, 0.2))
    .translate((0, 0.5, -1.6))
    .material(rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1, roughness=0))
)
BALL = rm.sphere(0.6).translate((0, 0.2, 0)).material(rm.Material(albedo=(0.8, 0.1, 0.1), roughness=0.6))
PLACES = [(0.3 * (i % 8) - 1, 0.3 * (i // 8) - 0.3, 0) for i in range(40)]
BALLS = rm.union(*[rm.sphere(0.15 + 0.002 * i).translate(place) for i, place in enumerate(PLACES)])
PILE = rm.instances(rm.sphere(0.3), [(0.2 * i - 2.0, 0.3 * (i % 3), 0.1 * (i % 5)) for i in range(20)])
POST = rm.cylinder(0.3, 1.4).translate((1.1, 0.1, 0.3))
SUN = rm.Sun((0.8, 1.5, 1), shadow=True)


def scene_of(solid: rm.Node | None, **parts: Any) -> rm.Scene:
    given = {"camera": rm.Camera((1, 1.6, 5), (0, 0.2, 0)), "lights": [SUN], "sky": rm.GradientSky(light=True), **parts}
    return rm.Scene(FLOOR | MIRROR | solid if solid is not None else FLOOR | MIRROR, **given)


WAYS: dict[str, dict[str, Any]] = {
    "direct": {},
    "whitted": {"bounces": 2, "quality": rm.Quality(integrator="whitted")},
    "occluded": {"occlusion": rm.AmbientOcclusion(reach=1.0)},
    "soft": {"lights": [rm.Sun((0.8, 1.5, 1), shadow=True, softness=0.1)]},
    "loop": {"lights": [rm.PointLight((i - 4, 4, 3), intensity=2, shadow=True) for i in range(9)]},
}
HIDDEN = [("camera",), ("shadow",), ("reflection",), ("camera", "reflection"), ("camera", "shadow"), KINDS]


def seen(kinds: tuple[str, ...]) -> dict[str, bool]:
    return {kind: kind not in kinds for kind in KINDS}


def difference(egl: Context, scene: rm.Scene) -> float:
    """Of the picture and the reference, without pixels at silhouettes and borders of shadows."""
    with rm.Renderer(SIZE, context=egl) as renderer:
        found = renderer.render(scene).color
    return float(np.quantile(np.abs(found - rm.truth(scene, SIZE).color), 0.96))


@pytest.mark.parametrize("name", WAYS)
@pytest.mark.parametrize("kinds", [("camera",), ("shadow", "reflection")])
def test_the_shader_is_that_of_the_reference(name: str, kinds: tuple[str, ...], egl: Context) -> None:
    assert difference(egl, scene_of(BALL.visible(**seen(kinds)), **WAYS[name])) < 2e-3


@pytest.mark.parametrize("kinds", HIDDEN)
def test_it_is_absent_for_these_rays_alone(kinds: tuple[str, ...]) -> None:
    """Depth is that of camera rays; shadows and mirrors are those of scenes with and without the solid."""
    hidden = rm.truth(scene_of(BALL.visible(**seen(kinds)), **WAYS["whitted"]), SIZE)
    whole, without = (rm.truth(scene_of(ball, **WAYS["whitted"]), SIZE) for ball in (BALL, None))
    as_camera = without if "camera" in kinds else whole
    assert np.array_equal(hidden.depth, as_camera.depth)
    same = hidden.hit & (whole.depth == without.depth)  # where camera rays meet the same in all
    mirror = same & (hidden.normal[..., 2] > 0.9)
    floor = same & (hidden.normal[..., 1] > 0.9)
    # in the mirror stands the ball, and its shadow on the floor behind
    if ("reflection" in kinds) == ("shadow" in kinds):
        np.testing.assert_allclose(hidden.color[mirror], (without if "shadow" in kinds else whole).color[mirror])
    np.testing.assert_allclose(hidden.color[floor], (without if "shadow" in kinds else whole).color[floor])
    assert np.abs(whole.color - without.color)[floor].max() > 0.1 < np.abs(whole.color - without.color)[mirror].max()


@pytest.mark.parametrize(
    "solid",
    [
        rm.union(BALL.visible(camera=False), POST, k=0.4),
        POST - BALL.translate((1.2, 0, 0.3)).visible(shadow=False),
        BALLS.visible(camera=False),
        BALLS | BALL.visible(shadow=False),
        PILE.visible(shadow=False),
        BALL.visible(camera=False).repeat((1.2, None, None), (2, 1, 1)).twist(0.2),
    ],
    ids=["blend", "cut", "data", "beside data", "instances", "copies"],
)
def test_any_solid_may_be_hidden(solid: rm.Node, egl: Context) -> None:
    scene = scene_of(solid)
    assert difference(egl, scene) < 2e-3
    assert any(made.name == "visibility by rays" and made.used for made in plan(scene).features)


def test_many_objects_stay_rows_unless_one_of_them_is_hidden() -> None:
    assert plan(scene_of(BALLS.visible(camera=False))).gathered.data == 40
    some = rm.union(*[each.visible(camera=i > 3) for i, each in enumerate(BALLS.children)])
    made = plan(scene_of(some)).gathered
    assert made.data == 36 and made.text > 3


def test_a_path_is_a_ray_of_the_camera_and_then_of_reflections(egl: Context) -> None:
    """Of mirrors alone the random path is the ray of the tree, which the reference traces; two samples in one draw."""
    copper = rm.Material(albedo=(0.8, 0.1, 0.1), metalness=1, roughness=0)
    node = MIRROR | rm.sphere(0.6).translate((0, 0.2, 0)).material(copper).visible(camera=False)
    camera = rm.Camera((1, 1, 5), (0, 0.2, 0))
    parts: dict[str, Any] = {"camera": camera, "lights": [], "sky": rm.GradientSky(), "bounces": 2}
    with rm.Renderer(SIZE, context=egl) as renderer:
        found = renderer.render(rm.Scene(node, **parts)).color
    expected = rm.truth(rm.Scene(node, **parts, quality=rm.Quality(integrator="whitted")), SIZE).color
    assert np.quantile(np.abs(found - expected), 0.96) < 2e-3


def test_samples_of_one_draw_call_all_begin_at_the_camera() -> None:
    """A standalone shader draws all samples of a pixel; the kind of the last ray must not remain."""
    text = text_of(scene_of(BALL.visible(camera=False), **WAYS["whitted"]), Values({})).text
    end = text[text.index("vec3 shade(") :]
    assert end.index("ray_kind = 0.0;") > end.index("ray_kind = 2.0;") > 0


def test_a_camera_inside_of_what_it_does_not_see(egl: Context) -> None:
    """A room of darkness about the camera blocks the sun from all that is in it."""
    blocker = rm.sphere(30.0).visible(camera=False)
    scene = scene_of(BALL | blocker)
    assert difference(egl, scene) < 2e-3
    lit, dark = (rm.truth(scene_of(s), SIZE).color for s in (BALL, BALL | blocker))
    assert dark.sum() < lit.sum()


def test_scenes_without_it_have_the_same_text() -> None:
    texts = [assemble(plan(scene_of(ball))).text() for ball in (BALL, BALL.visible(), BALL.visible(True, True))]
    assert texts[0] == texts[1] == texts[2] and "ray_kind" not in texts[0]
    assert "ray_kind" in assemble(plan(scene_of(BALL.visible(reflection=False)))).text()


def test_what_it_is_as_a_node() -> None:
    node = BALL.visible(camera=False)
    assert node == pickle.loads(pickle.dumps(node)) != BALL.visible(shadow=False)
    assert np.array_equal(node.bounds, BALL.bounds) and node.exactness == "exact"
    assert BALL.visible(shadow=False).distance((0, 0.2, 2)) == BALL.distance((0, 0.2, 2))
    assert (node | POST).distance((0, 0.2, 0)) == POST.distance((0, 0.2, 0))


@pytest.mark.parametrize("given", [0, None, "no", 1.0])
def test_a_switch_that_is_none_is_refused(given: Any) -> None:
    with pytest.raises(SceneError, match=r"visible: camera = .*True or False"):
        BALL.visible(camera=given)


def test_what_cannot_be_hidden_is_refused_by_name() -> None:
    with pytest.raises(SceneError, match="instances of a solid with parts that are hidden by visible"):
        rm.instances(rm.sphere(0.3).visible(camera=False), [(0, 0, 0), (1, 0, 0)])
    glass = rm.sphere().material(rm.Material(transmission=1)).visible(reflection=False)
    with pytest.raises(PlanError, match=r"visible\(reflection=False\) hides a part that transmits light"):
        plan(rm.Scene(glass | rm.plane(offset=-1), bounces=2))
    plan(rm.Scene(glass | rm.plane(offset=-1), bounces=0))


def test_a_scene_of_which_the_camera_sees_nothing_is_drawn_in_any_unit(egl: Context) -> None:
    ball = rm.sphere(1e-3).translate((rm.Param("x", 0.0), 0, 0)).visible(camera=False)
    with rm.Renderer(SIZE, context=egl) as renderer:
        assert np.isinf(renderer.render(rm.Scene(ball, rm.Camera((0, 0, 0.01), (0, 0, 0)))).depth).all()


def test_a_hidden_mirror_leaves_a_ray_tree_of_phong_surfaces(egl: Context) -> None:
    """No lobe is left that a ray could trace."""
    solid = rm.sphere(0.6).material(rm.Material(color=(0.8, 0.1, 0.1)))
    scene = rm.Scene(
        solid | MIRROR.visible(camera=False, shadow=False, reflection=False),
        rm.Camera((1, 1.6, 5), (0, 0.2, 0)),
        bounces=2,
        quality=rm.Quality(integrator="whitted"),
    )
    with rm.Renderer(SIZE, context=egl) as renderer:
        found = renderer.render(scene).color.copy()
        alone = renderer.render(scene.replace(node=solid)).color
    assert np.abs(found - alone).max() < 1e-3
