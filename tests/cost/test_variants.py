"""Axes over the light of a scene, over frames and over resolutions."""

from __future__ import annotations

import json

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.drawing import brought_to, nearest
from raymarch.cost.effects import evaluations_of
from raymarch.cost.reference import Reference, reference
from raymarch.cost.settings import Axis, Setting, axes, grid, parse_values
from raymarch.cost.sweep import Sweep, sweep
from raymarch.cost.text import as_csv, as_json, in_table, light_table, lights_of
from raymarch.cost.variants import VARIANTS, ideal_of, varied
from raymarch.errors import CostError

SIZE = (40, 24)


def lit() -> rm.Scene:
    ball = rm.sphere(0.6).material(rm.Material(color=(0.8, 0.2, 0.1), shininess=8))
    return rm.Scene(
        ball | rm.plane(offset=-0.6).material(rm.Material(color=(0.8, 0.8, 0.8))),
        camera=rm.Camera((1, 1.5, 4), (0, 0, 0)),
        lights=[rm.SphereLight((1.5, 2.5, 1), radius=1.2, intensity=5, shadow=True)],
        occlusion=rm.AmbientOcclusion(steps=4, decay=0.5),
        sky=rm.Sky(light=True),
    )


def names(scene: rm.Scene, *asked: Axis) -> list[str]:
    return [s.name for s in grid(scene, asked, SIZE) if not s.preset]


def test_only_what_a_scene_has_is_varied():
    plain = rm.Scene(rm.sphere(), lights=[rm.Sun()])
    chosen = [axis for axis in axes() if axis.name in ("shadow_steps", "light_samples", "masking", *VARIANTS)]
    assert names(plain, *chosen) == ["model physical"]
    found = names(lit(), *chosen)
    assert {"shadow_steps 16", "penumbra hard", "occlusion_samples 2", "model physical"} <= set(found)
    assert not {"light_samples 4", "masking separable", "model phong"} & set(found)
    sampled = varied(lit(), (("penumbra", "sampled"),))
    assert sampled is not None
    assert "light_samples 4" in names(sampled, *chosen)


def test_the_given_scene_stays_as_it_is():
    scene = lit()
    before = scene.lights[0].penumbra, scene.node, scene.occlusion.steps
    for variant in VARIANTS.values():
        for value in variant.values:
            variant.make(scene, value)
    assert (scene.lights[0].penumbra, scene.node, scene.occlusion.steps) == before


def test_more_samples_of_occlusion_count_what_is_near_as_before():
    """The share of the weight that lies in the nearer half of the reach."""
    scene = lit()

    def near(occlusion: rm.AmbientOcclusion) -> float:
        decay, steps = float(occlusion.decay.data), occlusion.steps
        weights = decay ** np.arange(steps)
        return float(weights[: steps // 2].sum() / weights.sum())

    finer = varied(scene, (("occlusion_samples", 16),))
    assert finer is not None
    assert near(finer.occlusion) == pytest.approx(near(scene.occlusion), abs=1e-9)


def test_the_model_is_turned_and_turned_back():
    scene = lit()
    physical = varied(scene, (("model", "physical"),))
    assert physical is not None
    assert all(m.physical for m in physical.materials)
    assert physical.node.distance([(2.0, 1.0, 0.5)]) == scene.node.distance([(2.0, 1.0, 0.5)])
    again = varied(physical, (("model", "phong"),))
    assert again is not None
    by_color = {tuple(m.color.data.tolist()): float(m.shininess.data) for m in again.materials}
    assert by_color[0.8, 0.2, 0.1] == pytest.approx(8.0, rel=0.01)


def test_values_are_checked():
    assert parse_values("penumbra", "hard,cone") == ("hard", "cone")
    assert parse_values("frames", "2,8") == (2, 8)
    assert parse_values("scale", "0.5,2") == (0.5, 2)
    for name, text in (("penumbra", "wide"), ("frames", "0"), ("frames", "1.5"), ("scale", "9"), ("model", "toon")):
        with pytest.raises(CostError, match=f"axis {name}"):
            parse_values(name, text)
    with pytest.raises(CostError, match="1 to 32"):
        parse_values("occlusion_samples", "99")


@pytest.fixture(scope="module")
def made(kept) -> Sweep:
    scene = lit()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYMARCH_CACHE", str(kept))
        known = reference(scene, SIZE, samples=16)

        def judge(setting: Setting) -> Reference:
            ideal = ideal_of(scene, setting.variations)
            return known if ideal is scene else reference(ideal, SIZE, samples=1)

        wanted = [
            Axis("penumbra", ("hard", "two-sided", "sampled")),
            Axis("shadow_steps", (2,)),
            Axis("frames", (9,)),
            Axis("scale", (0.5, 3.0)),
        ]
        settings = [s for s in grid(scene, wanted, SIZE) if not s.preset or s.name == "base"]
        with rm.Renderer(SIZE) as renderer:
            return sweep(scene, settings, known, renderer, repeats=1, judge=judge, count=evaluations_of)


def test_forms_of_shadows_are_held_against_the_whole_disc(made):
    found = {p.name: p for p in made.points}
    own, disc = found["base"], found["penumbra two-sided"]
    assert np.array_equal(own.color, disc.color)
    assert disc.known is not made.known
    assert found["penumbra hard"].errors.flip_p99 > 1.2 * disc.errors.flip_p99


def test_too_few_steps_of_shadows_show(made):
    found = {p.name: p for p in made.points}
    short = found["shadow_steps 2"]
    assert short.errors.flip_p99 > 2 * made.base.errors.flip_p99
    assert short.all_evaluations < made.base.all_evaluations
    assert short.errors.pixels_p99 == made.base.errors.pixels_p99


def test_frames_take_out_what_one_ray_leaves(made):
    edges = made.known.edges

    def off(name: str) -> float:
        point = next(p for p in made.points if p.name == name)
        return float(np.abs(point.color - made.known.picture)[edges].mean())

    assert off("9 frames") < 0.7 * off("base")
    assert off("scale 3") < 0.7 * off("base") < 0.7 * off("scale 0.5")
    assert made.points[-1].color.shape == made.base.color.shape


def test_the_light_has_a_table_of_its_own(made):
    apart = lights_of(made, "pixels_p99")
    assert apart[0] is made.base
    assert {p.name for p in apart[1:]} == {p.name for p in made.points if p.setting.light}
    assert not {id(p) for p in apart[1:]} & {id(p) for p in in_table(made, "pixels_p99")}
    assert not any(p.setting.light for p in made.front())
    assert light_table(made) is not None
    by_picture = {p.name for p in made.comparable("flip_p99")}
    assert "shadow_steps 2" in by_picture
    assert "penumbra hard" not in by_picture


def test_json_and_csv_say_what_was_varied(made):
    points = {p["name"]: p for p in json.loads(as_json(made))["points"]}
    hard = points["penumbra hard"]
    assert hard["variations"]["penumbra"] == "hard"
    assert hard["held_against"] == "the light's whole disc"
    assert hard["all_evaluations"] > 0
    assert (points["9 frames"]["frames"], points["scale 3"]["scale"]) == (9, 3.0)
    assert "variations.penumbra" in as_csv(made).splitlines()[0]


def test_pictures_are_brought_to_another_size():
    ramp = np.repeat(np.arange(12.0)[None, :, None], 6, axis=0).repeat(3, axis=2)
    half = brought_to(ramp, (6, 3))
    assert half[1, 1:-1, 0] == pytest.approx(ramp[0, ::2, 0][1:-1] + 0.5)
    twice = brought_to(ramp, (24, 12))
    assert twice[5, 1:-1, 0] == pytest.approx(np.clip((np.arange(24) + 0.5) / 2 - 0.5, 0, 11)[1:-1])
    assert brought_to(np.ones((5, 7, 3)), (3, 11)) == pytest.approx(1.0)
    depth = np.array([[1.0, np.inf], [3.0, 4.0]])
    assert np.array_equal(nearest(depth, (4, 4))[0], [1, 1, np.inf, np.inf])


def test_models_of_materials_with_patterns_are_swept() -> None:
    checks = rm.Material(color=rm.checker((0.2, 0.2, 0.2), (0.8, 0.8, 0.8), 1.0), shininess=10)
    settings = grid(rm.Scene(rm.sphere().material(checks)), axes())
    assert any(dict(setting.variations).get("model") == "physical" for setting in settings)
