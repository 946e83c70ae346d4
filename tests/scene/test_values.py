"""The parts of a scene are values: no way to make or change one goes past its constructor."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.vocabulary import sin
from raymarch.plan import plan
from raymarch.scene.fog import Atmosphere
from raymarch.scene.parameter import set_values
from raymarch.scene.post import PostEffect
from raymarch.scene.silhouette import Veil
from raymarch.scene.texture import Layout
from raymarch.scene.value import Part, Value, parameters_of
from raymarch.sdf.definition import REGISTRY
from raymarch.sdf.pickling import name_of
from raymarch.shader import assemble
from tests.support.refusals import refused

NAN = float("nan")
PICTURE = np.linspace(0, 1, 48).reshape(4, 4, 3)
NODE = rm.union(rm.box(1), rm.sphere(rm.Param("radius", 0.6, 0.2, 1.0)).translate((0.4, 0.3, 0)), k=0.1)

VALUES: dict[str, tuple[Callable[[], Value], dict[str, Any]]] = {
    "Scene": (lambda: rm.Scene(NODE, fog=rm.Fog(), sky=rm.SunSky(), bounces=2), {"quality": "high", "bounces": 99}),
    "Camera": (lambda: rm.Camera((0, 1, 5), (0, 0, 0), fov=30), {"fov": 180, "position": (0, 0, 0), "up": NAN}),
    "Light": (lambda: rm.scene.light.Light((1, 1, 1), 1, True, 0, "cone"), {"intensity": -1, "penumbra": "wide"}),
    "Sun": (lambda: rm.Sun((1, 2, 3), shadow=True), {"sun_direction": (0, 0, 0), "shadow": 1, "color": "redd"}),
    "PointLight": (lambda: rm.PointLight((0, 3, 0), range=9), {"position": None, "attenuation": (0, 0, 0)}),
    "SpotLight": (
        lambda: rm.SpotLight((0, 3, 0), half_angle=0.3),
        {"half_angle": 4.0, "blend": -0.1, "direction": "down"},
    ),
    "RectLight": (lambda: rm.RectLight((0, 3, 0), 0.2), {"width": 0, "direction": "down", "up": (0, 1, 0)}),
    "SphereLight": (lambda: rm.SphereLight((0, 3, 0), 0.2), {"radius": 0, "range": -1}),
    "Material": (
        lambda: rm.Material(albedo=rm.checker(0.1, 0.9), roughness=0.3, height=lambda p: 0.01 * sin(9 * p.x)),
        {"roughness": 2, "shininess": 5, "color": "redd", "height": 3},
    ),
    "Phong": (lambda: rm.Material((1, 0, 0), 50, ambient=rm.Param("ambient", 0.1, 0, 1)), {"specular": -1}),
    "Textured": (lambda: rm.Material(rm.planar(PICTURE), normal=rm.planar(PICTURE)), {"emission": (-1, 0, 0)}),
    "Sky": (lambda: rm.Sky(lambda d: (d.y, 0.5, 0.5), light=True), {"color": (-1, 0, 0), "light": None}),
    "GradientSky": (lambda: rm.GradientSky(zenith=(0, 0, 1)), {"zenith": "bleu", "ground": (0, 0, NAN)}),
    "SunSky": (lambda: rm.SunSky((1, 1, 0), 5), {"turbidity": 11, "sun_direction": (0, 0, 0)}),
    "Medium": (
        lambda: rm.Medium(lambda p: p.x, ((-1, -1, -1), (1, 1, 1)), albedo=(0.5, 1, 1), shadow=True),
        {"density": -1, "anisotropy": 1.0, "steps": 0, "bounds": 3},
    ),
    "Fog": (lambda: rm.Fog((1, 1, 1), 0.2), {"density": -1, "color": 5}),
    "Veil": (lambda: Veil(rm.Fog((1, 1, 1), 0.2, 1.0)), {"fog": "mist"}),
    "ToneMapping": (lambda: rm.ToneMapping("aces", 1.5), {"curve": "film", "exposure": 31, "dither": "yes"}),
    "Bloom": (lambda: rm.Bloom(rm.Param("glow", 0.2, 0, 1)), {"strength": 1.5, "radius": -1}),
    "AmbientOcclusion": (lambda: rm.AmbientOcclusion(7, 0.4), {"steps": 33, "reach": 0, "decay": 2}),
    "Quality": (
        lambda: rm.Quality(samples=4),
        {"max_steps": 131071, "tracer": "fast", "steps_per_pass": 8, "samples": None},
    ),
    "Texture": (lambda: rm.planar(PICTURE, 2.0, channel="g"), {"wrap": "round", "channel": "a", "picture": "none.png"}),
    "Slice": (lambda: rm.Slice((1, 2, 3), 0.5), {"normal": (0, 0, 0), "offset": NAN}),
    "Layout": (lambda: Layout("x", (1, 2)), {"axis": "w", "extents": (0, 1), "hardness": 0}),
}
WRONG = [(name, field) for name, (_, wrong) in VALUES.items() for field in wrong]


def all_value_classes() -> set[type]:
    found: set[type] = set()
    pending = [Value]
    while pending:
        for kind in pending.pop().__subclasses__():
            pending.append(kind)
            own = kind.__module__.startswith("raymarch.")  # not a kind of light of another test
            if own and getattr(sys.modules[kind.__module__], kind.__name__, None) is kind:
                found.add(kind)
    return found


def test_every_value_class_is_tried() -> None:
    kinds = all_value_classes() - {Part, PostEffect, Atmosphere}  # bases without fields
    assert {type(make()) for make, _ in VALUES.values()} | {rm.ImageSky} == kinds
    public = {getattr(rm, name) for name in rm.__all__ if inspect.isclass(getattr(rm, name))}
    assert kinds - public == {Layout, Veil}
    for kind in kinds:
        assert dataclasses.is_dataclass(kind) and kind.__dataclass_params__.frozen  # type: ignore[attr-defined]
    assert not any(hasattr(make(), "__dict__") for make, _ in VALUES.values())


@pytest.mark.parametrize(("name", "field"), WRONG)
def test_a_bad_value_is_refused_however_it_comes_in(name: str, field: str) -> None:
    make, wrong = VALUES[name]
    made, bad = make(), wrong[field]
    kind = type(made)
    with pytest.raises(SceneError) as first:
        kind(**{**made._unchanged({field: bad}), field: bad})
    for change in (
        lambda: made.replace(**{field: bad}),
        lambda: dataclasses.replace(made, **{field: bad}),  # type: ignore[type-var]
        lambda: pickle.loads(pickle.dumps(Forged(kind, {**made._unchanged({field: bad}), field: bad}))),
    ):
        with pytest.raises(SceneError) as caught:
            change()
        assert caught.value.legal and "\n" not in str(caught.value)
        assert caught.value.where is not None and caught.value.where.file == __file__
    with pytest.raises(SceneError, match=r"cannot be assigned .*\.replace"):
        setattr(made, field, bad)
    with pytest.raises(SceneError):
        delattr(made, field)
    with pytest.raises(SceneError):
        made.__setstate__({field: bad})
    assert first.value.legal
    assert made == make() or name in ("Material", "Sky")  # nothing has changed


class Forged:
    """Pickled as a value with arguments of one's own."""

    def __init__(self, kind: type, arguments: dict[str, Any]) -> None:
        self.made = (kind, arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        from raymarch.scene.value import _remade

        return _remade, (*self.made, None)


@pytest.mark.parametrize("name", VALUES)
def test_a_value_comes_back(name: str) -> None:
    made = VALUES[name][0]()
    back = pickle.loads(pickle.dumps(made))
    assert back == made and hash(back) == hash(made) and back.where == made.where
    assert copy.copy(made) == copy.deepcopy(made) == made.replace() == dataclasses.replace(made) == made  # type: ignore[type-var]
    assert made != rm.Sun((9, 9, 9)) and made != 3
    assert len(repr(made)) <= 400 and repr(made).startswith(type(made).__name__) and "\n" not in repr(made)


def test_a_change_of_one_field_leaves_the_others() -> None:
    light = rm.SpotLight((0, 3, 0), (1, -1, 0.3), half_angle=0.3, range=rm.Param("end", 5, 1, 9), shadow=True)
    moved = light.replace(position=(1, 2, 3))
    assert moved.where == light.where and moved != light
    same = [n for n in parameters_of(rm.SpotLight) if n != "position"]
    assert all(getattr(moved, n) is getattr(light, n) for n in same)
    brick = rm.Material(albedo=rm.checker((0.1, 0.2, 0.3), (1, 1, 1)), transmission=0.5)
    assert brick.replace(ior=1.3).color is brick.color and brick.replace(ior=1.3).transmits
    assert brick.replace(color=(1, 0, 0)).physical is True
    assert rm.Material(shininess=3).replace(ambient=0.4).shininess.data == 3


@pytest.mark.parametrize("kind", [rm.SpotLight, rm.RectLight])
def test_a_light_shines_at_its_target(kind: Any) -> None:
    """Where it moves, it still does; a direction that is set later wins."""
    light = kind((1, 4, 0), target=(1, 0, 3))
    assert np.allclose(light.direction.data, (0.0, -0.8, 0.6))
    assert np.allclose(light.replace(position=(1, 3, 3)).direction.data, (0.0, -1.0, 0.0))
    assert np.allclose(light.replace(target=(4, 0, 0)).direction.data, (0.6, -0.8, 0.0))
    turned = light.replace(direction=(1, 0, 0))
    assert turned.target is None and np.allclose(turned.direction.data, (1, 0, 0))
    for same in (light.replace(), pickle.loads(pickle.dumps(light)), dataclasses.replace(light)):
        assert same == light and same.target is not None
    follows = kind((0, 3, 0), target=(sin(rm.time), 0, 0))
    assert rm.Scene(rm.sphere(), lights=[follows]).lights[0].direction.op == "normalize"
    for direction in ((1, 0, 0), rm.vec3(1, 0, 0), rm.vec3(sin(rm.time), -1, 0)):
        refused(lambda d=direction: kind((0, 3, 0), direction=d, target=(1, 0, 0)), "one of them")
    moved = dataclasses.replace(follows, position=(0, 5, 0))
    assert moved.direction is kind((0, 5, 0), target=follows.target).direction
    refused(lambda: kind((0, 3, 0), target=(0, 3, 0)), "not all zero")


def test_assigning_a_quality_is_refused_and_so_no_loop_is_without_end() -> None:
    scene = rm.Scene(rm.sphere())
    with pytest.raises(SceneError, match=r"Scene: quality cannot be assigned"):
        scene.quality = rm.Quality()  # type: ignore[misc]
    with pytest.raises(SceneError, match=r"max_steps = 131071 .*60000"):
        scene.replace(quality=scene.quality.replace(max_steps=131071))


def test_equal_scenes_have_one_plan() -> None:
    def make(radius: float) -> rm.Scene:
        return rm.Scene(rm.sphere(radius) - rm.box(0.5), lights=[rm.Sun(shadow=True)])

    assert make(1.0) == make(1.0) and make(1.0).planned == make(1.0).planned
    assert make(1.0).planned != make(1.1).planned
    assert (
        make(1.0).planned == make(1.0).replace(tone=rm.ToneMapping("agx")).planned
    )  # asked for after a frame is drawn
    for change in ({"fog": rm.Fog()}, {"camera": rm.Camera(fov=30)}, {"quality": rm.Quality(samples=2)}):
        assert make(1.0).planned != make(1.0).replace(**change).planned


# Nodes


def test_every_definition_is_found_by_its_name() -> None:
    for definition in REGISTRY.values():
        if str(definition.source.__module__).startswith("raymarch."):  # nodes of other tests may have no module
            assert name_of(definition)[0] == definition.source.__module__


def test_nodes_are_compared_by_what_they_say() -> None:
    def tree(radius: float) -> rm.Node:
        return rm.union(rm.sphere(radius).material(rm.Material((1, 0, 0))), rm.box(1), k=0.2).displace_by_noise()

    assert tree(0.5) == tree(0.5) and hash(tree(0.5)) == hash(tree(0.5)) and tree(0.5) != tree(0.6)
    assert rm.sphere().material(rm.Material()) != rm.sphere()


def test_a_deep_tree_comes_back() -> None:
    deep = rm.sphere(0.1)
    for i in range(1500):
        deep = rm.union(deep, rm.sphere(0.1).translate((i, 0, 0)))
    assert pickle.loads(pickle.dumps(deep)) == deep


def test_the_same_shader_comes_out_of_another_process(tmp_path: Path) -> None:
    """Nothing of a scene is left behind: materials, patterns, cells, samples, parameters, skies."""
    solid = rm.repeat_varied(lambda cell: rm.sphere(0.3 + 0.02 * sin(cell.x)), 1.0, (5, 1, 5)) | rm.text("A").extrude(1)
    solid = solid.material(rm.Material(albedo=rm.noise((0, 0, 0), (1, 1, 1)), normal=rm.triplanar(PICTURE)))
    scene = rm.Scene(solid | rm.plane(offset=-1), sky=rm.Sky(lambda d: (d.y * d.y, 0.5, 0.5)), lights=[rm.Sun()])
    (tmp_path / "scene.pickle").write_bytes(pickle.dumps(scene))
    code = (
        "import pickle, sys; from raymarch.plan import plan; from raymarch.shader import assemble;"
        f"sys.stdout.write(assemble(plan(pickle.load(open({str(tmp_path / 'scene.pickle')!r}, 'rb')))).text())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == assemble(plan(scene)).text()
    assert pickle.loads(pickle.dumps(scene)) == scene


def test_a_definition_without_a_name_is_refused_when_it_is_pickled() -> None:
    @rm.shape(exactness="exact", bounds=lambda radius: ((-radius,) * 3, (radius,) * 3))  # type: ignore[misc]
    def local(p: Any, radius: float = 1.0) -> Any:
        return rm.Param("x", 1.0) * p.x + radius

    del REGISTRY["local"]  # other tests look at all that is there
    with pytest.raises(SceneError, match=r"'local' .*top level of a module"):
        pickle.dumps(local() | rm.box(1))
    with pytest.raises(SceneError, match=r"top level of a module"):
        pickle.dumps(rm.fold_fractal(lambda z, growth, p: (2.0 * z - p, 2.0 * growth)))
    code = "float half_space(vec3 p) { return p.y; }"
    with pytest.raises(SceneError, match=r"top level of a module"):
        pickle.dumps(rm.glsl_node(code, "half_space", "exact", twin=lambda points: points[:, 1]))
    assert pickle.loads(pickle.dumps(rm.glsl_node(code, "half_space", "exact"))).exactness == "exact"


def test_a_pickle_of_a_node_is_checked() -> None:
    from raymarch.sdf.pickling import pickled, remake

    (row,) = pickled(rm.sphere())
    assert remake([row]) == rm.sphere()
    for wrong in (
        [(("raymarch.sdf.solids", "spere", False), *row[1:])],
        [(row[0], (), {"radius": -1.0}, None, None)],
        [(row[0], (), {"size": 1.0}, None, None)],
        [(row[0], (7,), row[2], None, None)],
        [row[:3]],
        [],
        5,
    ):
        with pytest.raises(SceneError):
            remake(wrong)


def test_a_parameter_of_three_numbers_takes_a_color() -> None:
    tint = rm.Param("tint", "tomato", 0, 1)
    assert tint.data.value == pytest.approx(rm.Param("other", (1.0, 0.124772, 0.063010)).data.value, abs=1e-6)
    specs = rm.Scene(rm.sphere().material(rm.Material(albedo=tint))).parameters
    assert set_values(specs, {"tint": "#00f"}).params["tint"] == (0.0, 0.0, 1.0)
    for wrong in ("toomato", "#00ff00ff"):
        with pytest.raises(SceneError, match="tint"):
            set_values(specs, {"tint": wrong})
    with pytest.raises(SceneError, match="a number"):
        set_values(rm.Scene(rm.sphere(rm.Param("r", 1.0, 0.5, 2.0))).parameters, {"r": "red"})
