"""What a scene calls for is planned, what it does not call for is left out, and both with a reason."""

from __future__ import annotations

import functools
import io
import json
import operator
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import raymarch as rm
from raymarch.errors import Doubt, PlanError
from raymarch.plan import explain, plan
from raymarch.plan.plan import Plan
from raymarch.plan.shading import patterned
from raymarch.plan.stages import LARGEST
from raymarch.shader import assemble

RED, BLUE = rm.Material((1, 0, 0)), rm.Material((0, 0, 1))


def modules(made: Plan) -> list[str]:
    return list(assemble(made).modules)


def used(made: Plan) -> set[str]:
    return {feature.name for feature in made.features if feature.used}


def scene(node: Any = None, **parts: Any) -> rm.Scene:
    return rm.Scene(rm.sphere() if node is None else node, **parts)


# Features and modules.


def test_nothing_is_planned_that_a_plain_scene_does_not_call_for() -> None:
    made = plan(scene(lights=[]))
    assert used(made) == {"ray clipping"}
    named = " ".join(modules(made))
    for word in ("light", "shadow", "material", "normal", "fog", "geometry"):
        assert word not in named
    assert made.gradient is None and made.material is None and made.material_index is None
    assert [p.name for p in made.passes] == ["color"] and made.passes[0].textures == 1


FEATURES: list[tuple[str, str | None, dict[str, Any]]] = [
    ("sun light", None, {"lights": [rm.Sun()]}),
    ("point lights", None, {"lights": [rm.PointLight((0, 3, 0))]}),
    ("hard shadows", "light/shadow", {"lights": [rm.Sun(shadow=True)]}),
    ("hard shadows", "light/shadow", {"lights": [rm.Sun(), rm.PointLight((0, 3, 0), shadow=True)]}),
    ("fog", None, {"fog": rm.Fog()}),
    ("materials", None, {"node": rm.sphere().material(RED)}),
    ("parameters", None, {"node": rm.sphere(rm.Param("r", 1, 0.5, 2))}),
    ("parameters", None, {"sky": (rm.Param("r", 1, 0.5, 2), 0, 0)}),
    ("parameters", None, {"camera": rm.Camera(fov=rm.Param("fov", 45, 1, 90))}),
    ("time", None, {"node": rm.sphere().translate((rm.time, 0, 0))}),
    ("time", None, {"lights": [rm.Sun((rm.time, 1, 0))]}),
    ("time", None, {"camera": rm.Camera((0, rm.time, 9))}),
    ("ray clipping", None, {"node": rm.plane()}),
]


@pytest.mark.parametrize(("feature", "module", "parts"), FEATURES)
def test_a_feature_is_planned_where_it_is_called_for(feature: str, module: str | None, parts: dict[str, Any]) -> None:
    with_it, without = plan(scene(**parts)), plan(scene(rm.plane((1, 2, 3)), lights=[]))
    assert feature in used(with_it) and feature not in used(without)
    if module is not None:
        assert module in modules(with_it) and module not in modules(without)


def test_light_without_shadow_plans_no_shadow() -> None:
    made = plan(scene(lights=[rm.Sun(), rm.PointLight((0, 3, 0)), rm.PointLight((3, 0, 0), shadow=False)]))
    assert "hard shadows" not in used(made) and "light/shadow" not in modules(made)


@pytest.mark.parametrize("normals", ["analytic", "tetrahedron", "central", "forward"])
def test_the_gradient_is_made_for_analytic_normals_only(normals: Any) -> None:
    made = plan(scene(quality=rm.Quality(normals=normals)))
    assert made.gradient is None and made.material is not None
    assert ("gradient" in dict(made.material.type.fields)) == (normals == "analytic")
    used_normals = [m for m in modules(made) if m.startswith("normal/")]
    assert used_normals == ["normal/facing" if normals == "analytic" else f"normal/{normals}"]
    both = plan(scene(quality=rm.Quality(normals=normals)), ("geometry",))
    assert (both.gradient is not None) == (normals == "analytic") and f"normal/{normals}" in modules(both)


def test_the_picture_of_an_unlit_scene_needs_no_normal_but_its_geometry_does() -> None:
    unlit = scene(lights=[])
    assert plan(unlit, ["color"]).gradient is None
    made = plan(unlit, ["geometry"])
    assert made.gradient is not None and made.material_index is not None and made.material is None
    both = plan(scene(), ["color", "geometry"])
    assert both.material is not None and both.material_index is not None
    assert [p.name for p in both.passes] == ["color", "geometry"]


@pytest.mark.parametrize(
    ("node", "clipped"),
    [
        (rm.sphere(), True),
        (rm.plane(), True),
        (rm.plane((1, 1, 0)), False),
        (rm.box(1).repeat((2, None, None)), True),
        (rm.box(1).repeat(2), False),
        (rm.sphere() | rm.plane((1, 1, 0)), False),
        (rm.sphere() & rm.plane((1, 1, 0)), True),
    ],
)
def test_rays_are_clipped_where_the_box_ends(node: Any, clipped: bool) -> None:
    made = plan(scene(node))
    assert ("ray clipping" in used(made)) == clipped
    assert any(f"{name}(" in assemble(made).text() for name in ("clip_to_box", "below")) == clipped


def test_every_module_and_feature_has_a_reason() -> None:
    rich = scene(
        rm.sphere(rm.Param("r", 1, 0.5, 2)).material(RED),
        lights=[rm.Sun(shadow=True), rm.PointLight((rm.time, 1, 0))],
        fog=rm.Fog(),
    )
    for made in (plan(scene(lights=[])), plan(rich, ["color", "geometry"])):
        assert len({feature.name for feature in made.features}) == len(made.features)
        assert all(reason.strip() for reason in [*made.choices.values(), *assemble(made).modules.values()])
        assert all(feature.reason.strip() for feature in made.features)
        assert all(p.reason.strip() for p in made.passes)


# Counts.


def test_equal_shapes_count_once() -> None:
    ball = rm.sphere(0.2)
    assert plan(scene(ball | ball | rm.sphere(0.2))).shapes == 1
    assert plan(scene(ball | ball.translate((1, 0, 0)) | ball.translate((1, 0, 0)))).shapes == 2


def test_only_shapes_count_as_shapes() -> None:
    """Not the blends between them, and not the functions that hold them."""
    three = rm.union(rm.sphere(), rm.box(1), rm.torus(), k=0.3)
    assert plan(scene(three)).shapes == 3
    inside = (rm.sphere().translate((0.3, 0, 0)) | rm.box(1)).repeat((4, None, None))
    assert plan(scene(inside)).shapes == 2


def test_more_is_more_work() -> None:
    one, two = plan(scene(rm.sphere())), plan(scene(rm.sphere() | rm.box(1)))
    assert 0 < one.operations < two.operations
    copies = plan(scene((rm.sphere() | rm.box(1).translate((0.3, 0.2, 0.1))).repeat(5)))
    assert copies.operations > 8 * two.operations  # as many look-ups of a child that is not its own mirror image


# Limits.


def balls(n: int) -> list[rm.Node]:
    return [rm.sphere(0.1).translate((0.5 * i, 0, 0)) for i in range(n)]


def test_a_field_up_to_the_limit_is_planned() -> None:
    assert plan(as_text(rm.union(*balls(LARGEST)))).shapes == LARGEST


def as_text(node: rm.Node) -> rm.Scene:
    return scene(node).replace(quality=rm.Quality(objects="text"))


MANY = LARGEST + 1


@pytest.mark.parametrize(
    ("count", "make"),
    [
        (MANY, lambda: functools.reduce(operator.or_, balls(MANY))),
        (MANY, lambda: rm.union(*balls(MANY))),
        (MANY, lambda: rm.union(*balls(MANY), k=0.1)),
        (MANY, lambda: rm.union(*balls(MANY)).rotate(0.1, "z").repeat((10_000, None, None))),
    ],
    ids=["chain", "union", "smooth union", "inside a repetition"],
)
def test_a_field_beyond_the_limit_is_refused(count: int, make: Any) -> None:
    node = make()
    with pytest.raises(PlanError, match=rf"{count} shapes.*{LARGEST} distinct shapes") as caught:
        plan(as_text(node))
    assert caught.value.where == node.where


def test_clashing_parameters_are_refused() -> None:
    node = rm.sphere(rm.Param("r", 1, 0.5, 2)) | rm.sphere(rm.Param("r", 1, 0.5, 3)).translate((3, 0, 0))
    with pytest.raises(PlanError, match="two parameters are named 'r'") as caught:
        plan(scene(node))
    assert caught.value.where is not None and caught.value.where.file == __file__


# Warnings.


def test_warnings_are_about_what_may_not_be_meant() -> None:
    assert plan(scene()).warnings == []
    (empty,) = plan(scene(rm.sphere() & rm.sphere().translate((5, 0, 0)))).warnings
    assert "empty" in empty
    cut = (rm.sphere() - rm.box(1)).shell(0.1)
    (offset,) = plan(scene(cut)).warnings
    assert offset.startswith(f"{cut.where}: shell acts on a bound field")
    assert plan(scene(rm.sphere().round(0.1))).warnings == []

    @rm.shape(exactness="estimate", bounds=lambda: ((-1.0,) * 3, (1.0,) * 3))
    def guess(p: Any) -> Any:
        return p.x * p.y

    (estimate,) = plan(scene(guess())).warnings
    assert "estimate" in estimate


# Explain.


RICH = rm.Scene(
    (rm.sphere(rm.Param("rich", 1, 0.5, 2)) - rm.box(1)).shell(0.1).material(RED)
    | rm.plane().translate((0, -2, 0)).material(BLUE),
    lights=[rm.Sun((rm.time, 1, 0), shadow=True)],
    fog=rm.Fog(),
)


@pytest.mark.parametrize(
    "given",
    [scene(lights=[]), scene(rm.plane((1, 2, 3))), RICH, scene(rm.sphere() & rm.sphere().translate((5, 0, 0)))],
)
def test_explain_is_json(given: rm.Scene) -> None:
    made = plan(given, ["color", "geometry"])
    plain = explain.as_dict(made, assemble(made).modules)
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain


def test_explain_holds_the_plan() -> None:
    made = plan(RICH)
    plain = explain.as_dict(made, assemble(made).modules)
    assert plain["field"]["exactness"] == "bound" and plain["field"]["lipschitz"] == 1
    assert plain["field"]["bounds"][0] == [None] * 3 and plain["field"]["bounds"][1][1] is not None
    assert plain["field"]["shapes"] == 3
    assert [m["name"] for m in plain["modules"]] == modules(made) and all(m["reason"] for m in plain["modules"])
    assert [p["name"] for p in plain["passes"]] == ["color"]
    by_name = {f["name"]: f for f in plain["features"]}
    assert by_name["hard shadows"]["used"] and by_name["hard shadows"]["where"] == str(RICH.lights[0].where)
    assert not by_name["point lights"]["used"] and by_name["point lights"]["reason"] == "no PointLight in the scene"
    assert by_name["point lights"]["where"] is None
    order = [f["used"] for f in plain["features"]]
    assert order == sorted(order, reverse=True), "what is used comes first"
    (parameter,) = plain["parameters"]
    told = {"name": "rich", "value": 1, "min": 0.5, "max": 2}
    assert {key: parameter[key] for key in told} == told
    assert __file__ in parameter["where"]
    assert any("shell" in warning for warning in plain["warnings"])


def test_an_estimate_has_no_number_for_its_slope() -> None:
    @rm.shape(exactness="estimate", bounds=lambda: ((-1.0,) * 3, (1.0,) * 3))
    def guess(p: Any) -> Any:
        return p.x * p.y

    assert explain.as_dict(plan(scene(guess())), {})["field"]["lipschitz"] is None


def test_explain_in_words_says_all_that_the_data_says() -> None:
    made = plan(RICH)
    text = io.StringIO()
    linked = assemble(made).modules
    explain.show(made, linked, 4321, Console(file=text, width=20, soft_wrap=True, force_terminal=False))
    said = text.getvalue()
    lines = [line.strip() for line in said.splitlines()]
    for name, reason in linked.items():
        assert any(line.startswith(name) and reason in line for line in lines), name
    for feature in made.features:
        assert any(line.startswith(feature.name) and feature.reason in line for line in lines), feature.name
    called, left_out = said.index("\nUsed\n"), said.index("Left out")
    assert called < said.index("hard shadows") < left_out < said.index("point lights")
    assert "4321" in said and "inf" in said and "a number >= 0.5 and <= 2" in said
    for warning in made.warnings:
        assert warning in said


def test_an_empty_part_is_warned_of_with_its_line() -> None:
    """Its boxes show it: two balls that do not meet, in a scene that has more."""
    apart = rm.sphere() & rm.sphere().translate((5, 0, 0))
    assert apart.where is not None
    (warning,) = plan(rm.Scene(apart.rotate(0.3, "x") | rm.box(1))).warnings
    assert warning.startswith(f"{apart.where}: intersection is empty")
    assert any("the solid is empty" in found for found in plan(rm.Scene(apart)).warnings)
    assert not plan(rm.Scene(rm.sphere() & rm.sphere().translate((1, 0, 0)))).warnings


def test_unions_under_rigid_transforms_are_solved_one_by_one() -> None:
    def solved(node: rm.Node) -> tuple[int, int]:
        closed = plan(rm.Scene(node)).analytic
        return len(closed.solved), len(closed.marched)

    pair = rm.sphere() | rm.box(1).translate((2, 0, 0)).material(rm.Material())
    assert solved(pair.rotate(0.3).scale(2.0).material(rm.Material()).translate((0, 1, 0)) | rm.plane()) == (3, 0)
    assert solved(pair.scale((1, 2, 1)) | rm.plane()) == (1, 1)
    assert solved((pair | rm.torus()).rotate(0.3) | rm.plane()) == (1, 1)
    moved = plan(rm.Scene(pair.translate((5, 0, 0)) | rm.torus())).analytic
    assert sorted(float(node.facts.lower[0]) for node in moved.solved) == [4.0, 6.5]


def test_of_many_solids_with_closed_forms_only_the_unbounded_are_solved() -> None:
    many = rm.union(*[rm.sphere(0.1 * i + 0.1).translate((i, 0, 0)) for i in range(25)])
    assert not plan(rm.Scene(many)).analytic.used
    closed = plan(rm.Scene(many | rm.plane())).analytic
    assert (len(closed.solved), len(closed.marched)) == (1, 25)
    assert len(plan(rm.Scene(many, quality=rm.Quality(analytic=True))).analytic.solved) == 25


def test_a_material_of_a_texture_or_of_the_point_is_patterned() -> None:
    picture = rm.triplanar(np.linspace(0, 1, 48).reshape(4, 4, 3))
    for color, known in (((1, 0, 0), False), (picture, True), (lambda p: 0.5 + 0.5 * p, True)):
        assert patterned(rm.Scene(rm.sphere().material(rm.Material(color)))) is known


@pytest.mark.parametrize(("epsilon", "integrator", "told"), [(1.0, "path", 1), (0.5, "path", 0), (10.0, "whitted", 0)])
def test_a_wide_epsilon_of_paths_is_doubted(epsilon: float, integrator: str, told: int) -> None:
    """Mean light against Mitsuba, `thin2` of tests.lab.rooms at 32 x 32: 1.6 % off at 1, 9.8 % at 3 and 10."""
    quality = rm.Quality(epsilon=epsilon, integrator=integrator)
    found = plan(rm.Scene(rm.box(), bounces=2, quality=quality)).warnings
    assert sum("with bounces" in d for d in found) == told


def test_each_warning_of_a_plan_is_a_doubt_that_knows_its_parts() -> None:
    cut = rm.box(1) - rm.sphere(0.6)
    rounded, apart = cut.round(0.1), rm.sphere(1) & rm.sphere(1).translate((5, 0, 0))
    far = rm.Camera(position=(0, 0, 1e5 + 2), target=(0, 0, 1e5))
    scenes = {
        "acts on": (rm.Scene(rounded), rounded.where),
        "is empty": (rm.Scene(rm.box(1) | apart), apart.where),
        "coordinates reach": (rm.Scene(rm.sphere(1) | rm.sphere(1).translate((0, 0, 1e5)), camera=far), None),
    }
    for words, (scene, where) in scenes.items():
        doubts = plan(scene).warnings
        assert all(isinstance(doubt, Doubt) and doubt.stage == "plan" for doubt in doubts), doubts
        found = [doubt for doubt in doubts if words in doubt.what]
        assert [doubt.where for doubt in found] == [where], (words, doubts)
    one = [rm.box(1).twist(1.0).round(0.1).translate((4 * i, 0, 0)) for i in range(2)]
    assert len(plan(rm.Scene(rm.union(*one))).warnings) == 1  # equal sentences of one line are said once
