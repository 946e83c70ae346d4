"""Lights, materials, sky, fog, quality and the scene that holds them: what is refused, what is filled in."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import Location, PlanError, SceneError
from raymarch.expr.vocabulary import fract, where
from raymarch.gpu.context import Context
from raymarch.plan import plan
from raymarch.scene.light import DirectionSample, Light
from raymarch.scene.light_kinds import KINDS, hard
from raymarch.scene.parameter import Values, set_values
from raymarch.shader import assemble
from raymarch.window.edits import editable_lights
from tests.support.refusals import refused

NAN, INF = math.nan, math.inf
FLAT = rm.shape(exactness="exact", bounds=lambda: ((-1.0, -1.0), (1.0, 1.0)), dimension=2)(lambda p: p.x * 0.5)

BAD = [
    (lambda: rm.Sun(sun_direction=(0, 0, 0)), "Sun: sun_direction = (0, 0, 0)", "not all zero"),
    (lambda: rm.Sun(sun_direction=(0, NAN, 0)), "Sun: sun_direction = (0, nan, 0)", "3 finite numbers"),
    (lambda: rm.Sun(sun_direction="up"), "Sun: sun_direction = 'up'", "3 finite numbers"),
    (lambda: rm.Sun(sun_direction=(1, 0)), "Sun: sun_direction = (1, 0)", "3 finite numbers"),
    (lambda: rm.Sun(color=(1, -0.1, 1)), "Sun: color = (1, -0.1, 1)", ">= 0"),
    (lambda: rm.Sun(color="redd"), "Sun: color = 'redd'", "did you mean 'red'"),
    (lambda: rm.Sun(color=1.0), "Sun: color = 1.0", "3 finite numbers"),
    (lambda: rm.Sun(intensity=-1), "Sun: intensity = -1", ">= 0"),
    (lambda: rm.Sun(intensity=NAN), "Sun: intensity = nan", ">= 0"),
    (lambda: rm.Sun(intensity=rm.Param("i", -2.0)), "Sun: intensity = -2.0 with its parameters", ">= 0"),
    (lambda: rm.Sun(intensity=(1, 2, 3)), "Sun: intensity = (1, 2, 3)", "a finite number"),
    (lambda: rm.Sun(shadow=1), "Sun: shadow = 1", "True or False"),
    (lambda: rm.Sun(shadow="soft"), "Sun: shadow = 'soft'", "True or False"),
    (lambda: rm.PointLight(position=None), "PointLight: position = None", "3 finite numbers"),
    (lambda: rm.PointLight((0, 1, INF)), "PointLight: position = (0, 1, inf)", "3 finite numbers"),
    (lambda: rm.PointLight((0, 1, 2), intensity="much"), "PointLight: intensity = 'much'", ">= 0"),
    (lambda: rm.PointLight((0, 1, 2), color=(0, 0, -1)), "PointLight: color = (0, 0, -1)", ">= 0"),
    (lambda: rm.PointLight((0, 1, 2), shadow=None), "PointLight: shadow = None", "True or False"),
    (lambda: rm.Material(color=(1, 1, 1.5)), "Material: color = (1, 1, 1.5)", ">= 0 and <= 1"),
    (lambda: rm.Material(color=(-1, 0, 0)), "Material: color = (-1, 0, 0)", ">= 0 and <= 1"),
    (lambda: rm.Material(color="#ff"), "Material: color = '#ff'", "linear RGB"),
    (lambda: rm.Material(color=(1, NAN, 1)), "Material: color = (1, nan, 1)", "3 finite numbers"),
    (lambda: rm.Material(shininess=0), "Material: shininess = 0", ">= 0.001"),
    (lambda: rm.Material(shininess=1e7), "Material: shininess = 10000000.0", "<= 1e+06"),
    (lambda: rm.Material(specular=1.1), "Material: specular = 1.1", "<= 1"),
    (lambda: rm.Material(ambient=-0.1), "Material: ambient = -0.1", ">= 0"),
    (lambda: rm.Material(ambient=[]), "Material: ambient = []", "a finite number"),
    (lambda: rm.Sky(color=(-1, 0, 0)), "Sky: color = (-1, 0, 0)", ">= 0"),
    (lambda: rm.Sky(color="bleu"), "Sky: color = 'bleu'", "did you mean 'blue'"),
    (lambda: rm.Fog(density=-0.5), "Fog: density = -0.5", ">= 0"),
    (lambda: rm.Fog(falloff=-0.5), "Fog: falloff = -0.5", ">= 0"),
    (lambda: rm.Fog(falloff=INF), "Fog: falloff = inf", "a finite number"),
    (lambda: rm.Fog(falloff=1, height="low"), "Fog: height = 'low'", "a finite number"),  # type: ignore[arg-type]
    (lambda: rm.Fog(density=INF), "Fog: density = inf", "a finite number"),
    (lambda: rm.Fog(color=(0, 0)), "Fog: color = (0, 0)", "3 finite numbers"),
    (lambda: rm.Quality(max_steps=0), "Quality: max_steps = 0", "1 to 60000"),
    (lambda: rm.Quality(max_steps=60001), "Quality: max_steps = 60001", "1 to 60000"),
    (lambda: rm.Quality(max_steps=10.0), "Quality: max_steps = 10.0", "an integer"),  # type: ignore[arg-type]
    (lambda: rm.Quality(max_steps=True), "Quality: max_steps = True", "an integer"),
    (lambda: rm.Quality(epsilon=0), "Quality: epsilon = 0", "0.001 to 10"),
    (lambda: rm.Quality(epsilon=NAN), "Quality: epsilon = nan", "0.001 to 10"),
    (lambda: rm.Quality(epsilon="fine"), "Quality: epsilon = 'fine'", "0.001 to 10"),  # type: ignore[arg-type]
    (lambda: rm.Quality(tracer="fast"), "Quality: tracer = 'fast'", "'plain'"),  # type: ignore[arg-type]
    (lambda: rm.Quality(normals="smooth"), "normals = 'smooth'", "'analytic', 'tetra"),  # type: ignore[arg-type]
    (lambda: rm.Scene(5), "Scene: node = 5 (int)", "a node such as sphere()"),  # type: ignore[arg-type]
    (lambda: rm.Scene(None), "Scene: node = None", "a node such as sphere()"),  # type: ignore[arg-type]
    (lambda: rm.Scene(rm.sphere), "Scene: node = <function sphere", "a node"),  # type: ignore[arg-type]
    (lambda: rm.Scene(FLAT()), "Scene: <lambda> is flat", "a solid"),
    (lambda: rm.Scene(rm.sphere(), camera=(0, 0, 5)), "Scene: camera = (0, 0, 5)", "Camera(...)"),  # type: ignore[arg-type]
    (lambda: rm.Scene(rm.sphere(), lights=rm.Sun()), "Scene: lights = Sun(...)", "a list of"),  # type: ignore[arg-type]
    (lambda: rm.Scene(rm.sphere(), lights=7), "Scene: lights = 7", "a list of"),  # type: ignore[arg-type]
    (lambda: rm.Scene(rm.sphere(), lights=[rm.Sun(), 7]), "lights = 7 (int)", "Sun(...), PointLight(...)"),  # type: ignore[list-item]
    (lambda: rm.Scene(rm.sphere(), lights="sun"), "lights = 's' (str)", "Sun(...), PointLight(...)"),  # type: ignore[arg-type]
    (lambda: rm.Scene(rm.sphere(), sky="bleu"), "Sky: color = 'bleu'", "did you mean 'blue'"),
    (lambda: rm.Scene(rm.sphere(), sky=(0, 0, NAN)), "Sky: color = (0, 0, nan)", "3 finite numbers"),
    (lambda: rm.Scene(rm.sphere(), fog=0.1), "Scene: fog = 0.1 (float)", "Fog(...)"),  # type: ignore[arg-type]
    (lambda: rm.Scene(rm.sphere(), quality="high"), "quality = 'high'", "Quality(...)"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("make", "what", "legal"), BAD, ids=[what for _, what, _ in BAD])
def test_a_bad_part_is_refused_where_it_is_made(make: Any, what: str, legal: str) -> None:
    refused(make, what, legal)


def test_a_label_that_is_no_material_is_refused_at_the_node_that_got_it() -> None:
    painted = rm.sphere().material(Fraction(1, 2))
    scene = rm.box(1) | painted
    with pytest.raises(SceneError, match=r"material = Fraction\(1, 2\) \(Fraction\)") as caught:
        rm.Scene(scene)
    assert caught.value.where == painted.where != scene.where


SOLID = rm.sphere()
MISPLACED: dict[str, Any] = {
    "Scene: lights = AmbientOcclusion() (AmbientOcclusion): an AmbientOcclusion belongs to Scene(occlusion=...)": (
        lambda: rm.Scene(SOLID, lights=[rm.AmbientOcclusion()])  # type: ignore[list-item]
    ),
    "a Sun belongs to Scene(lights=[...])": lambda: rm.Scene(SOLID, [rm.Sun()]),  # type: ignore[arg-type]
    "a Camera belongs to Scene(camera=...)": lambda: rm.sphere(rm.Camera()),  # type: ignore[arg-type]
    "a Quality belongs to Scene(quality=...)": lambda: rm.Scene(SOLID, sky=rm.Quality()),  # type: ignore[arg-type]
    "a Fog belongs to Scene(fog=...)": lambda: SOLID | rm.Fog(),  # type: ignore[operator]
    "a GradientSky belongs to Scene(sky=...)": lambda: rm.union(SOLID, rm.GradientSky()),  # type: ignore[arg-type]
    "a SpotLight belongs to Scene(lights=[...])": lambda: SOLID.material(rm.SpotLight((0, 1, 0))),
    "a Material belongs to node.material(...)": lambda: rm.Sun(color=rm.Material()),  # type: ignore[arg-type]
    "a Bloom belongs to Scene(post=[...])": lambda: rm.Scene(SOLID, tone=rm.Bloom()),  # type: ignore[arg-type]
    "a Scene belongs to rm.render(...)": lambda: rm.Scene(rm.Scene(SOLID)),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("kind", [rm.Sky, rm.GradientSky])
def test_a_class_in_place_of_a_sky_is_named(kind: Any) -> None:
    refused(lambda: rm.Scene(SOLID, sky=kind), f"Sky: color = the class {kind.__name__}", f"{kind.__name__}(...)")


@pytest.mark.parametrize("words", MISPLACED)
def test_a_part_in_another_place_is_told_where_it_belongs(words: str) -> None:
    refused(MISPLACED[words], words, "")


def test_every_part_of_a_scene_says_where_it_belongs() -> None:
    parts = [kind for name in rm.scene.__all__ if isinstance(kind := getattr(rm.scene, name), type)]
    assert {kind.__name__ for kind in parts if not getattr(kind, "BELONGS", "")} == {"DirectionSample", "TracerState"}


# What is filled in.


def test_a_scene_fills_in_what_is_not_given() -> None:
    scene = rm.Scene(rm.sphere())
    assert [type(light) for light in scene.lights] == [rm.Sun] and not scene.lights[0].shadow
    assert isinstance(scene.sky, rm.Sky) and scene.fog is None and scene.quality == rm.Quality()
    assert scene.camera.position is None and scene.parameters == {}
    assert scene.materials == (rm.Material(),)


def test_no_light_is_no_light() -> None:
    assert rm.Scene(rm.sphere(), lights=[]).lights == ()


class Blinds(rm.Sun):
    """The sun through blinds: stripes of light on what it meets."""

    @staticmethod
    def sample_direction(values: Any, p: Any, u: Any, far: Any) -> DirectionSample:
        found = rm.Sun.sample_direction(values, p, u, far)
        return found._replace(radiance=where(fract(4.0 * p.x) < 0.5, 1.0, 0.25) * found.radiance)


@pytest.mark.parametrize("count", [1, 9])
def test_a_kind_of_the_users_own_is_drawn_as_it_is_written(egl: Context, count: int) -> None:
    lights = [Blinds((0, 1, 0), intensity=1 / count)] * count
    floor = rm.plane().material(rm.Material((1, 1, 1), specular=0, ambient=0))
    scene = rm.Scene(floor, rm.Camera((0.1, 4, 0.1), (0.1, 0, 0), fov=20), lights=lights)
    with rm.Renderer(size=(32, 24), backend="egl") as renderer:
        drawn = renderer.render(scene).color[..., 0]
    made = rm.truth(scene, size=(32, 24))
    x = (made.position + made.depth[..., None] * made.direction)[..., 0]
    wanted = np.where(x * 4 % 1 < 0.5, 1.0, 0.25)
    clear = np.abs(x * 8 - np.round(x * 8)) > 0.01
    assert clear.mean() > 0.9 and {0.25, 1.0} == set(wanted[clear])
    np.testing.assert_allclose(made.color[clear][..., 0], wanted[clear], rtol=1e-9)
    np.testing.assert_allclose(drawn[clear], wanted[clear], rtol=1e-5)
    (edit,) = editable_lights(scene)[:1]
    assert edit.light() is lights[0] and edit.python({}) == "scene.lights[0]"


def bad_samples() -> dict[str, Any]:
    return {
        "a float": lambda values, p, u, far: far,
        "vec3, vec3, vec3": lambda values, p, u, far: DirectionSample(p, p, values["radiance"]),
    }


@pytest.mark.parametrize("given", bad_samples())
def test_a_sample_of_other_types_is_refused(given: str) -> None:
    class Dome(rm.Sun):
        sample_direction = staticmethod(bad_samples()[given])

    message = r"Dome.sample_direction gives .*a DirectionSample\(direction, distance, radiance\)"
    with pytest.raises(SceneError, match=message) as caught:
        rm.Scene(rm.sphere(), lights=[Dome()])
    assert caught.value.where is not None and caught.value.where.file == __file__


def test_a_light_without_a_sample_is_refused() -> None:
    class Nothing(Light):
        def __init__(self) -> None:
            Light.__init__(self, (1, 1, 1), 1.0, False, 0.0, "two-sided")

    with pytest.raises(SceneError, match="class with sample_direction"):
        rm.Scene(rm.sphere(), lights=[Nothing()])


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_light_is_in_every_table(kind: type[Light]) -> None:
    light = kind() if kind is rm.Sun else kind((0, 3, 0))  # type: ignore[call-arg, arg-type]
    scene = rm.Scene(rm.sphere(), lights=[light])
    assert [edit.kind for edit in editable_lights(scene)] == [kind.__name__]
    assert hard(light).softness.data == 0.0
    for count in (1, 9):
        assert "light" in assemble(plan(scene.replace(lights=[light] * count))).text()
    assert np.all(np.isfinite(rm.truth(scene, size=(4, 4)).color))


def test_any_sequence_of_lights_keeps_its_order() -> None:
    sun, lamp = rm.Sun(), rm.PointLight((0, 1, 0))
    for given in ([sun, lamp], (sun, lamp), (light for light in (sun, lamp))):
        assert rm.Scene(rm.sphere(), lights=given).lights == (sun, lamp)  # type: ignore[arg-type]


def test_a_sky_is_a_sky_or_a_colour() -> None:
    for sky in (rm.Sky((0.25, 0.5, 1)), (0.25, 0.5, 1), [0.25, 0.5, 1], np.array([0.25, 0.5, 1])):
        scene = rm.Scene(rm.sphere(), sky=sky)
        assert Values({}).of(scene.sky.color).tolist() == [0.25, 0.5, 1]


def test_light_may_be_brighter_than_white_and_a_material_not() -> None:
    assert Values({}).of(rm.Sun(color=(5, 0, 9), intensity=100).radiance).tolist() == [500, 0, 900]
    assert rm.Material(color=(1, 1, 1), shininess=1e6, specular=1, ambient=1) != rm.Material()


def test_a_suns_direction_has_length_one() -> None:
    for direction in ((0, 0, 9), (1, 2, -2), (1e-3, 0, 0), (rm.Param("x", 3.0), 4.0, 0.0)):
        given = Values({}).of(rm.Sun(sun_direction=direction).sun_direction)
        assert np.linalg.norm(given) == pytest.approx(1, abs=4e-16)


# Materials are labels with an index.


def test_materials_are_numbered_from_the_default() -> None:
    red, blue = rm.Material((1, 0, 0)), rm.Material((0, 0, 1))
    node = (rm.sphere().material(red) | rm.box(1).material(blue)).material(rm.Material()) | rm.torus()
    materials = rm.Scene(node).materials
    assert materials[0] == rm.Material()
    assert set(materials[1:]) == {red, blue} and len(materials) == 3


def test_equal_materials_are_one() -> None:
    assert rm.Material((1, 0, 0)) == rm.Material([1.0, 0.0, 0.0]) != rm.Material((1, 0, 0), ambient=0.2)
    assert rm.Material((1, 0, 0)) != (1, 0, 0)
    node = rm.sphere().material(rm.Material((1, 0, 0))) | rm.box(1).material(rm.Material((1, 0, 0)))
    assert len(rm.Scene(node).materials) == 2
    shiny = rm.Param("shiny", 10.0, 1, 100)
    assert rm.Material(shininess=shiny) == rm.Material(shininess=rm.Param("shiny", 10.0, 1, 100))
    assert hash(rm.Material(shininess=shiny)) == hash(rm.Material(shininess=shiny))


# Parameters.

BAD_PARAMS = [
    (lambda: rm.Param("", 1), "name = ''", "a letter or digit"),
    (lambda: rm.Param(" ", 1), "name = ' '", "a letter or digit"),
    (lambda: rm.Param("a;b", 1), "name = 'a;b'", "a letter or digit"),
    (lambda: rm.Param("a\nb", 1), "name = 'a\\nb'", "a letter or digit"),
    (lambda: rm.Param(3, 1), "name = 3", "a letter or digit"),  # type: ignore[arg-type]
    (lambda: rm.Param("r", "1"), "Param 'r': value = '1'", "finite number"),
    (lambda: rm.Param("r", None), "Param 'r': value = None", "finite number"),
    (lambda: rm.Param("r", NAN), "Param 'r': value = nan", "finite number"),
    (lambda: rm.Param("r", (1, INF)), "Param 'r': value = (1, inf)", "finite number"),
    (lambda: rm.Param("r", 1e39), "Param 'r': value = 1e+39", "3.4e38"),
    (lambda: rm.Param("r", (1, 2, 3, 4, 5)), "Param 'r': value = (1, 2, 3, 4, 5)", "2 to 4"),
    (lambda: rm.Param("r", [[1, 2], [3, 4]]), "Param 'r': value = [[1, 2]", "2 to 4"),
    (lambda: rm.Param("r", 1, min=NAN), "Param 'r': min = nan", "finite number"),
    (lambda: rm.Param("r", 1, max="2"), "Param 'r': max = '2'", "finite number"),
    (lambda: rm.Param("r", 1, min=2, max=0), "min = 2 above max = 0", "min <= max"),
    (lambda: rm.Param("r", 5, min=0, max=2), "'r' = 5", ">= 0 and <= 2"),
    (lambda: rm.Param("r", -1, min=0), "'r' = -1", "a number >= 0"),
    (lambda: rm.Param("r", (1, 9, 1), min=0, max=(1, 2, 3)), "'r' = (1, 9, 1)", "<= (1, 2, 3)"),
    (lambda: rm.Param("r", (1, 1, 1), min=(0, 0)), "range (0.0, 0.0) for a value of (3,)", "one number, or one each"),
    (lambda: rm.sphere(rm.Param("r", 1, 0, 2)), "sphere: radius", "> 0"),
    (lambda: rm.sphere(rm.Param("r", 1)), "sphere: radius", "> 0"),
]


@pytest.mark.parametrize(("make", "what", "legal"), BAD_PARAMS, ids=[repr(what) for _, what, _ in BAD_PARAMS])
def test_a_bad_parameter_is_refused_where_it_is_made(make: Any, what: str, legal: str) -> None:
    refused(make, what, legal)


def test_two_parameters_of_one_name_must_be_equal() -> None:
    scene = rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)) | rm.torus(rm.Param("r", 1, 0.5, 2), 0.2))
    assert list(scene.parameters) == ["r"]
    clashes = [
        lambda other: rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)) | rm.box(other)),
        lambda other: rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)), camera=rm.Camera(fov=20 * other)),
        lambda other: rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)), lights=[rm.Sun(intensity=other)]),
        lambda other: rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)), fog=rm.Fog(density=other)),
        lambda other: rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)).material(rm.Material(shininess=other))),
    ]
    for make in clashes:
        with pytest.raises(PlanError, match="two parameters are named 'r' but differ") as caught:
            _ = make(rm.Param("r", 1.5, 0.5, 2)).parameters
        assert caught.value.where is not None and caught.value.where.file == __file__
        assert caught.value.legal == "one Param, used twice"


def test_every_part_of_a_scene_may_read_parameters() -> None:
    names = iter("abcdefghijklmno")

    def value(default: Any = 0.5) -> Any:
        return rm.Param(next(names), default, 0.1, 0.9)

    @rm.operator(bounds=lambda child: (child.lower - 1.0, child.upper + 1.0))
    def shifted(p: Any, child: Any) -> Any:
        return child(p - hidden)

    @rm.shape(exactness="exact", bounds=lambda: ((-1.0,) * 3, (1.0,) * 3))
    def ball(p: Any) -> Any:
        return rm.sphere(1).definition.template(0, {}).inline(p, hidden)

    hidden = rm.Param("hidden", 0.5, 0.1, 0.9)
    node = shifted(rm.sphere(value()).translate((value(), 0, 0)).repeat((3, None, None), count=2)) | ball()
    material = rm.Material((value(), 0, 0), 10 * value(), value(), value())
    scene = rm.Scene(
        node.material(material),
        camera=rm.Camera((value(), 0, 9), (0, value(), 0), (0, 1, value()), 90 * value()),
        lights=[rm.Sun((1, value(), 0), (value(), 0, 0), value())],
        sky=(value(), 0, 0),
        fog=rm.Fog((0, 0, value()), 1.0),
    )
    assert set(scene.parameters) == {*"abcdefghijklmno", "hidden"}
    assert all(spec.where.file == __file__ for spec in scene.parameters.values())


SPECS = rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2)), sky=rm.Param("sky", (0.1, 0.2, 0.3), 0, 1)).parameters
HERE = Location("scene.py", 7)
BAD_VALUES = [
    ({"s": 1.0}, 0.0, "unknown parameter 's' = 1.0", "one of: r, sky"),
    ({"r": 3.0}, 0.0, "'r' = 3 ", ">= 0.5 and <= 2"),
    ({"r": NAN}, 0.0, "'r' = nan", "finite"),
    ({"r": "1"}, 0.0, "'r' = '1'", "finite"),
    ({"r": None}, 0.0, "'r' = None", "finite"),
    ({"r": (1, 1)}, 0.0, "'r' = (1, 1)", "a number >= 0.5"),
    ({"sky": 0.5}, 0.0, "'sky' = 0.5", "3 numbers >= 0 and <= 1"),
    ({"sky": (0, 0, 2)}, 0.0, "'sky' = (0, 0, 2)", "3 numbers >= 0 and <= 1"),
    ([("r", 1.0)], 0.0, "params = [('r', 1.0)] (list)", "a dict"),
    ({}, NAN, "time = nan", "a finite number of seconds"),
    ({}, INF, "time = inf", "a finite number of seconds"),
    ({}, "0", "time = '0'", "a finite number of seconds"),
    ({}, None, "time = None", "a finite number of seconds"),
    ({}, 1e39, "time = 1e+39", "a finite number of seconds"),
]


@pytest.mark.parametrize(("params", "time", "what", "legal"), BAD_VALUES, ids=[what for *_, what, _ in BAD_VALUES])
def test_a_bad_value_is_refused(params: Any, time: Any, what: str, legal: str) -> None:
    with pytest.raises(SceneError) as caught:
        set_values(SPECS, params, time, HERE)
    assert what in str(caught.value) and legal in str(caught.value)
    assert caught.value.where in (HERE, SPECS["r"].where, SPECS["sky"].where)


def test_a_scene_without_parameters_says_so() -> None:
    with pytest.raises(SceneError, match="this scene has no Param"):
        set_values({}, {"r": 1})


def test_values_replace_defaults() -> None:
    values = set_values(SPECS, {"r": np.float32(0.75), "sky": np.array([1, 0, 1])}, time=np.float64(2.5))
    assert values.params == {"r": 0.75, "sky": (1.0, 0.0, 1.0)} and values.time == 2.5
    assert set_values(SPECS, {"r": 2}).params == {"r": 2.0, "sky": (0.1, 0.2, 0.3)}  # both ends are legal
    radius = rm.Param("r", 1, 0.5, 2)
    assert float(values.of(radius * 2 + rm.time)) == 4.0


def test_a_changed_scene_keeps_all_other_parts():
    made = rm.Scene(rm.sphere(), rm.Camera((0, 0, 5)), [rm.Sun()], (1, 0, 0), rm.Fog(), rm.Quality(max_steps=9))
    other = made.replace(lights=[])
    assert other.lights == () and other.where == made.where
    for name in set(made.__slots__) - {"lights"}:
        assert getattr(other, name) is getattr(made, name), name
    with pytest.raises(rm.SceneError, match="node"):
        made.replace(node=3)


def test_what_transmits_is_smooth_unless_a_roughness_is_given() -> None:
    def roughness(material: rm.Material) -> float:
        return float(material.roughness.data)

    for none in (None, 0, 0.0, np.float32(0)):
        assert roughness(rm.Material(albedo=(1, 0, 0), transmission=none)) == 0.5
    assert (
        roughness(rm.Material(transmission=0.3)) == roughness(rm.Material(transmission=rm.Param("t", 0.0, 0, 1))) == 0.0
    )
    assert roughness(rm.Material(transmission=1, roughness=0.5)) == 0.5
    assert roughness(rm.Material(albedo=(1, 0, 0)).replace(transmission=1)) == 0.0
    assert roughness(rm.Material(transmission=1).replace(transmission=0)) == 0.5
    assert roughness(rm.Material(roughness=0.7).replace(transmission=1)) == 0.7


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("place", ["scale", "turn", "material", "move", "matrix", "twice"])
def test_the_size_of_a_scene_is_that_of_its_parts_when_all_is_placed_with_the_floor(size: float, place: str) -> None:
    """The default reach of ambient occlusion was 0.5 at any size, if the floor was moved together with the solids."""
    both = (rm.sphere(1) | rm.plane(offset=-1)).scale(size)
    placed = {
        "scale": both,
        "turn": both.rotate(0.3, "x"),
        "material": both.material(rm.Material(color="red")),
        "move": both.translate((3, 4, 5)),
        "matrix": both.transform(np.diag([-1.0, 1.0, 1.0, 1.0])),
        "twice": rm.union(both.rotate(1, "z"), rm.plane((1, 0, 0), offset=-9 * size)).rotate(1, "y"),
    }
    scene = rm.Scene(placed[place], sky=rm.Sky("white", light=True), occlusion=rm.AmbientOcclusion())
    assert scene.subject is not None
    np.testing.assert_allclose(scene.subject.size, 2 * size, rtol=1e-5)
    assert scene.ambient_occlusion is not None and scene.ambient_occlusion.reach is not None
    assert float(str(scene.ambient_occlusion.reach).strip("float()")) == pytest.approx(0.5 * size, rel=1e-5)


def test_a_part_that_moves_without_bounds_is_no_size_of_a_scene() -> None:
    moving = rm.sphere(1).translate((rm.time, 0, 0))
    assert rm.Scene(moving).subject is None and rm.Scene((moving | rm.plane()).scale(2)).subject is None
    still = rm.Scene(((moving | rm.plane()).scale(2)) | rm.box(4)).subject
    assert still is not None
    np.testing.assert_allclose(still.size, 4)
