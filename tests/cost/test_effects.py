"""Each effect left out in turn: what is left out, what it costs, and how its evaluations are counted."""

from __future__ import annotations

import json
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import raymarch as rm
from raymarch.cli import main
from raymarch.cost.effects import ablate, ablations, dearest, evaluation_counts, evaluations_of
from raymarch.errors import CostError
from raymarch.gpu.prepare import prepare
from raymarch.gpu.resource_cache import ResourceCache
from raymarch.plan.device import SOFTWARE
from raymarch.shader.tally import EVALUATIONS

SIZE = (48, 27)


def rich() -> rm.Scene:
    return rm.Scene(
        rm.sphere() | rm.plane(offset=-1),
        camera=rm.Camera(position=(0, 2, 5), target=(0, 0, 0)),
        lights=[rm.Sun(shadow=True, softness=0.05), rm.PointLight(position=(3, 3, 3), intensity=4)],
        sky=rm.Sky(light=True),
        fog=rm.Fog(density=0.02),
        occlusion=rm.AmbientOcclusion(),
        quality=rm.Quality(samples=2),
    )


@pytest.fixture(scope="module")
def renderer():
    with rm.Renderer(SIZE) as made:
        yield made


def test_each_effect_is_left_out_alone():
    scene = rich()
    names = dict(ablations(scene))
    assert set(names) == {
        *("fog", "occlusion", "shadow of lights", "softness of shadows", "light of the sky"),
        *("light 1, Sun", "light 2, PointLight", "anti-aliasing"),
    }
    assert names["fog"].fog is None
    assert names["fog"].occlusion is scene.occlusion
    assert [light.shadow for light in names["shadow of lights"].lights] == [False, False]
    assert names["softness of shadows"].lights[0].shadow
    assert not names["softness of shadows"].lights[0].soft
    assert not names["light of the sky"].sky.light
    assert names["light 2, PointLight"].lights == scene.lights[:1]
    assert names["anti-aliasing"].quality.samples == 1
    assert scene.lights[0].shadow, "the scene itself stays"
    assert scene.sky.light
    assert scene.fog is not None


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_bounces_are_left_out_all_and_the_last(renderer, integrator):
    glass = rm.Material(transmission=1, ior=1.5)
    scene = rm.Scene(rm.sphere().material(glass), lights=[], bounces=3, quality=rm.Quality(integrator=integrator))
    names = dict(ablations(scene))
    assert {name: made.bounces for name, made in names.items()} == {"bounces of light": 0, "bounce 3": 2}
    found = {e.name: e.evaluations for e in ablate(scene, renderer, repeats=2)}
    assert found["bounces of light"] > found["bounce 3"] > 0
    matte = rm.Scene(rm.sphere(), bounces=2, quality=rm.Quality(integrator="whitted"))
    assert not list(ablations(matte)), "nothing mirrors"


def test_without_maps_each_picture_is_its_mean(renderer):
    picture = np.random.default_rng(2).uniform(0, 1, (8, 8, 3))

    def scene(material):
        node = rm.union(rm.sphere().material(material), rm.box(1).translate((1, 0, 0)), k=0.2)
        return rm.Scene(node.repeat(4, 3))

    painted = rm.Material(albedo=rm.triplanar(picture), height=rm.triplanar(picture[..., 0], 0.5))
    ((name, bare),) = ablations(scene(painted))
    (plain,) = bare.materials[1:]
    assert name == "maps"
    assert not plain.textured
    assert not plain.relief
    evened = scene(rm.Material(albedo=tuple(picture.mean((0, 1)))))
    np.testing.assert_allclose(renderer.render(bare).color, renderer.render(evened).color, atol=1e-3)


def test_the_dearest_effects_save_what_they_cost():
    """By evaluations, which are exact: rays per pixel share evenly, and a shadow costs rays of its own."""
    scene = rm.Scene(rm.gyroid() & rm.sphere(), lights=[rm.Sun(shadow=True)], quality=rm.Quality(samples=4))
    found = {saving.name: saving for saving in dearest(scene, (16, 9))}
    assert found["anti-aliasing"].evaluations == 0.75
    assert 0.1 < found["shadow of lights"].evaluations < 1.0
    assert "% of the evaluations" in found["anti-aliasing"].words
    assert dearest(rm.Scene(rm.sphere()), (16, 9)) == []


def test_a_plain_scene_has_no_effects(renderer):
    assert not list(ablations(rm.Scene(rm.sphere())))
    with pytest.raises(CostError, match="no effects"):
        ablate(rm.Scene(rm.sphere()), renderer)


def test_what_an_effect_costs(renderer):
    found = {e.name: e for e in ablate(rich(), renderer, repeats=6)}
    assert next(iter(found)) == max(found.values(), key=lambda e: e.milliseconds.value).name
    assert found["fog"].shader_bytes > 100
    assert found["fog"].evaluations == 0
    assert found["shadow of lights"].evaluations > 3
    assert found["occlusion"].evaluations == pytest.approx(evaluated_hits(), abs=0.01), "5 samples where there is a hit"
    assert found["anti-aliasing"].texture_bytes > SIZE[0] * SIZE[1] * 16
    assert found["light of the sky"].flip_mean > 0.01
    assert found["light 1, Sun"].flip_region > 20
    for effect in found.values():
        assert effect.milliseconds.count == 6
        assert json.loads(json.dumps(effect.as_dict()))["name"] == effect.name


def evaluated_hits() -> float:
    """Evaluations a pixel of five samples at every hit."""
    return 5.0 * float(rm.truth(rich(), size=SIZE, outputs=()).hit.mean())


def test_times_are_differences_of_the_same_turn(monkeypatch):
    from raymarch.cost import effects

    clock, variants = iter(range(10**6)), 1 + len(list(ablations(rich())))
    stub, apart = SimpleNamespace(kept=1, resources=ResourceCache(SimpleNamespace(device=SOFTWARE))), set()

    def fake(scene, setting, renderer, time=0.0, params=None):
        apart.add(not stub.resources.live_lights)
        slow = 1.0 * (next(clock) // variants)  # each turn is slower than the one before
        return slow + 3.0 * (scene.fog is not None) + 5.0 * any(light.shadow for light in scene.lights), 0.0

    monkeypatch.setattr(effects, "timed", fake)
    monkeypatch.setattr(effects, "_figures", lambda *_: {
        "color": np.zeros((4, 4, 3)), "evaluations": 0.0, "texture_bytes": 0, "shader_bytes": 0
    })  # fmt: skip
    found = effects.ablate(rich(), stub, repeats=6)
    assert apart == {True}, "each variant is drawn as in a new renderer"
    assert stub.resources.live_lights
    assert [e.name for e in found[:3]] in (
        ["shadow of lights", "light 1, Sun", "fog"],
        ["light 1, Sun", "shadow of lights", "fog"],
    )
    by_name = {e.name: e.milliseconds for e in found}
    assert (by_name["fog"].value, by_name["fog"].low, by_name["fog"].high) == (3.0, 3.0, 3.0)
    assert by_name["occlusion"].value == 0.0


def test_the_counting_shader_counts(renderer):
    """Without lights nothing but the primary rays asks: the same count as the geometry pass gives."""
    scene = rm.Scene(rm.sphere() | rm.plane(offset=-1), lights=[], camera=rm.Camera((0, 2, 5), (0, 0, 0)))
    frame = renderer.render(scene, outputs=("evaluations",))
    assert evaluations_of(scene, renderer) == pytest.approx(float(frame.evaluations.mean()), rel=1e-6)
    lit = rm.Scene(scene.node, lights=[rm.Sun()], camera=scene.camera)
    more = evaluations_of(lit, renderer) - evaluations_of(scene, renderer)
    assert more == pytest.approx(float(np.isfinite(frame.depth).mean()), abs=1e-3), "one gradient where there is a hit"
    assert np.array_equal(renderer.render(scene).color, renderer.render(scene).color), "the picture is not the count"


def test_each_pixel_has_the_count_of_its_own_rays(renderer):
    """Without lights those of the camera ray, and one gradient more where a light shines on the hit."""
    scene = rm.Scene(rm.torus(1, 0.3), lights=[], camera=rm.Camera((0, 2, 5), (0, 0, 0)))
    scene = scene.replace(quality=rm.Quality(schedule="single"))
    frame = renderer.render(scene, outputs=("evaluations",))
    alone, hit = evaluation_counts(scene, renderer), np.isfinite(frame.depth)
    assert np.array_equal(alone, frame.evaluations)
    assert np.array_equal(evaluation_counts(scene.replace(lights=[rm.Sun()]), renderer), alone + hit)
    shadowed = scene.replace(lights=[rm.Sun(shadow=True)])
    counts = evaluation_counts(shadowed, renderer)
    assert np.array_equal(counts[~hit], alone[~hit]) and counts[hit].mean() > alone[hit].mean()
    assert evaluations_of(shadowed, renderer) == pytest.approx(counts.mean(), rel=1e-6)


def test_shadows_of_divided_fields_are_counted(renderer):
    """They ask a function of their own, the field before it is divided by its Lipschitz constant."""
    node = rm.box((0.6, 2, 0.6)).twist(1.0) | rm.plane(offset=-1)
    camera = rm.Camera((0, 2, 5), (0, 0, 0))
    hard, soft = (
        evaluations_of(rm.Scene(node, camera, [rm.Sun(shadow=True, softness=s)]), renderer) for s in (0.0, 0.1)
    )
    plain = evaluations_of(rm.Scene(node, camera, [rm.Sun()]), renderer)
    assert soft > hard > plain


@pytest.mark.parametrize("tracer", ["bracketing", "advance"])
def test_samples_of_occlusion_are_counted(renderer, tracer):
    """Also where no ray asks the field itself, because solids tell how far a ray is free."""
    node = rm.union(rm.sphere(), rm.box(1.2).translate((0.8, 0, 0)), k=0.1) | rm.plane(offset=-1)
    scene = rm.Scene(node, rm.Camera((0, 2, 5), (0, 0, 0)), [], rm.Sky(light=True), quality=rm.Quality(tracer=tracer))
    hit = np.isfinite(renderer.render(scene).depth)
    dimmed = scene.replace(occlusion=rm.AmbientOcclusion(steps=4))
    asked = evaluation_counts(dimmed, renderer) - evaluation_counts(scene, renderer)
    assert np.array_equal(asked, 4.0 * hit)


def test_calls_are_counted_once_in_what_is_left_of_the_text():
    """Only the functions of the field count, and only in a shader that is asked for counts."""
    scene = rm.Scene(rm.sphere() | rm.box(1), lights=[rm.Sun(shadow=True)])
    text = prepare(scene, ("all_evaluations",)).texts["tally"]
    lines = text.splitlines()
    counting = [head for head, line in pairwise(lines) if line == "    count_evaluation();"]
    names = {head.partition("(")[0].split()[-1] for head in counting}
    assert names and names <= EVALUATIONS and len(names) == len(counting)
    assert "count_evaluation" not in prepare(scene).texts["color"]


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.py").write_text("import raymarch as rm\nscene = rm.Scene(rm.sphere(), fog=rm.Fog())\n")
    with pytest.raises(SystemExit) as stop:
        main(["cost", "a.py", "--effects", "--size", "24x14", "--repeats", "1", "--json", "e.json"])
    assert stop.value.code == 0
    assert "fog" in capsys.readouterr().out
    data = json.loads((tmp_path / "e.json").read_text())
    assert [e["name"] for e in data["effects"]] == ["fog"]
    assert data["environment"]["clock"]["kind"]
    with pytest.raises(SystemExit) as stop:
        main(["cost", "a.py", "--effects", "--csv", "e.csv"])
    assert stop.value.code == 2
