"""The text of a shader: only what is called for, the same in every process, and valid for desktop and web."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import raymarch as rm
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.shader import Shader, assemble
from tests.support.required import glslang
from tests.support.shader_samples import PASSES, assembled, line, passes_of, scenes

ROOT = Path(rm.__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SCENES = scenes()


def shader(scene: rm.Scene, passes: tuple[str, ...] = ("color",)) -> Shader:
    return assemble(plan(scene, passes))


def text(scene: rm.Scene, passes: tuple[str, ...] = ("color",)) -> str:
    return shader(scene, passes).text()


# What is not called for is not in the text.


def test_no_light_with_a_shadow_means_no_shadow_code() -> None:
    lights = [rm.Sun(), rm.PointLight((0, 3, 0)), rm.PointLight((3, 0, 0), intensity=2)]
    plain = text(rm.Scene(rm.sphere(), lights=lights))
    assert "shadow" not in plain.lower()
    flagged = [rm.Sun(shadow=False), rm.PointLight((0, 3, 0), shadow=False), lights[2]]
    assert text(rm.Scene(rm.sphere(), lights=flagged)) == plain
    assert "hard_shadow" in text(rm.Scene(rm.sphere(), lights=[rm.Sun(shadow=True)]))


ABSENT = {
    "unlit": ("light", "normal ", "surface_normal", "Material", "gradient", "shadow", "fog", "u_time", "PASS"),
    "plain": ("sample_point_light", "shadow", "fog", "u_time", "PASS", "material_index", "uniform vec3 u_t"),
    "no end": ("scene_box", "slab", "shadow", "fog"),
    "central normals": ("gradient", "shadow"),
    "forward normals": ("gradient",),
    "tetrahedron normals": ("gradient",),
}


@pytest.mark.parametrize("name", ABSENT)
def test_what_is_not_called_for_is_not_in_the_text(name: str) -> None:
    made = re.sub(r"//.*", "", assembled(name).text())
    for word in ABSENT[name]:
        assert word not in made


def test_the_gradient_is_there_for_analytic_normals() -> None:
    plain = text(SCENES["plain"])
    assert "Part part_at(vec3 p)" in plain and "field_gradient" not in plain
    assert "vec4 field_gradient(vec3 p)" in text(SCENES["unlit"], ("geometry",))
    assert "field_gradient" not in text(rm.Scene(rm.sphere(), quality=rm.Quality(normals="central")), ("geometry",))


def test_two_passes_are_one_text_with_a_define() -> None:
    made = shader(SCENES["materials"], ("color", "geometry"))
    color, geometry = made.text("color"), made.text("geometry")
    assert color.splitlines()[1] == "#define PASS 0" and geometry.splitlines()[1] == "#define PASS 1"
    assert color.splitlines()[2:] == geometry.splitlines()[2:]
    assert made.text() == color
    for single in PASSES[:2]:
        assert "PASS" not in text(SCENES["materials"], single)


# What is not used changes nothing.


def test_an_effect_given_and_taken_away_leaves_nothing() -> None:
    assert text(rm.Scene(rm.sphere(), fog=None)) == text(rm.Scene(rm.sphere()))
    assert text(rm.Scene(rm.sphere(), quality=rm.Quality())) == text(rm.Scene(rm.sphere()))
    assert text(rm.Scene(rm.sphere(), lights=None)) == text(rm.Scene(rm.sphere(), lights=[rm.Sun()]))
    default = rm.Scene(rm.sphere().material(rm.Material()))
    assert text(default) == text(rm.Scene(rm.sphere()))


def test_moving_the_camera_changes_nothing() -> None:
    still = text(rm.Scene(rm.sphere()))
    assert text(rm.Scene(rm.sphere(), camera=rm.Camera((9, 8, 7), (1, 2, 3), (0, 1, 1), 17))) == still


PRINT = """
from pathlib import Path
import raymarch as rm
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.shader import assemble
from tests.support.shader_samples import line, scenes

{before}
assert Path(rm.__file__).is_relative_to({package!r})
found = scenes() | {{file.stem: load(file) for file in sorted(Path({examples!r}).glob("*.py"))}}
for name, scene in sorted(found.items()):
    print(line(name, scene))
"""

BEFORE = """
rm.Param("unused", 1.0, 0.5, 2.0)
rm.Param("gap", 7.0)
rm.Material((0.3, 0.3, 0.3))
rm.Fog()

class Spot(rm.PointLight):
    pass

@rm.shape(exactness="exact", bounds=lambda: ((-1.0,) * 3, (1.0,) * 3))
def sphere_field(p):
    return p.x * 0.5

@rm.shape(exactness="exact", bounds=lambda radius: ((-radius,) * 3, (radius,) * 3))
def ball(p, radius=1.0):
    return rm.sphere(1).definition.template(0, {}).inline(p, radius)

Spot((0, 1, 0), shadow=True)
crowd = rm.union(*[ball(0.1 * i).translate((i, rm.time, 0)) for i in range(1, 40)], k=0.1)
for field in (sphere_field() | rm.box(1), crowd):
    assemble(plan(rm.Scene(field, lights=[rm.SpotLight((0, 1, 0), shadow=True)], fog=rm.Fog()), ("color", "geometry")))
"""


EXTRA = """\
// A light that no scene has.
uniform float u_pixel;
vec3 moon_light(Material material) { return phong(material); }
"""


def printing(package: Path, seed: int, before: str = "") -> subprocess.Popen[str]:
    code = PRINT.format(package=str(package), examples=str(ROOT / "examples"), before=before)
    path = os.pathsep.join([str(package), str(ROOT)])
    environment = os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": str(seed)}
    command = [sys.executable, "-P", "-c", code]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_the_text_is_the_same_in_every_process_and_beside_unused_modules(tmp_path: Path) -> None:
    """Other hash seeds; other parameters, materials, lights and shapes written, planned and assembled before; and a
    package with another light in it, which gives a name that is chosen from several modules."""
    being_written = shutil.ignore_patterns("*.pyc.*")
    shutil.copytree(ROOT / "raymarch", tmp_path / "raymarch", ignore=being_written)
    module = tmp_path / "raymarch" / "glsl" / "light" / "aaa.glsl"
    module.write_text(EXTRA)
    process = printing(tmp_path, 4, BEFORE)
    found = SCENES | {file.stem: load(file) for file in EXAMPLES}
    here = [line(name, scene) for name, scene in sorted(found.items())]
    plain, faults = process.communicate()
    assert process.returncode == 0, faults
    assert plain.splitlines() == here
    assert len(plain.splitlines()) == len(SCENES) + len(EXAMPLES) and len(EXAMPLES) >= 3


# It is valid.


@pytest.mark.parametrize("name", SCENES)
def test_one_text_is_valid_on_the_desktop_and_on_the_web(name: str, tmp_path: Path) -> None:
    files = []
    for passes in passes_of(name):
        made = assembled(name, passes)
        for chosen in passes:
            for version in ("330 core", "300 es"):
                files.append(tmp_path / f"{'_'.join(passes)}.{chosen}.{version[:3]}.frag")
                files[-1].write_text(made.text(chosen, version))
    done = subprocess.run([glslang(), *map(str, files)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert len(files) == 6 and "WARNING" not in done.stdout, done.stdout


@pytest.mark.parametrize("name", SCENES)
def test_every_number_is_written_for_both_languages(name: str) -> None:
    """A float literal carries a decimal point; a whole number stands in a counting loop, an int
    a texel's place or an index alone."""
    made = assembled(name, PASSES[2]).text()
    code = re.sub(r"//.*|#.*|layout\(location = \d\)|const int .*|for \(int .*\{", "", made)
    hashes = (r"uint pcg\(.*?\n}", ">> 8", r"random_of_pixel\(\d+\)")
    dimensions = (r"dimension \+ \d", r"16 \+ 8 \* bounce", r"\b10\d\d\b(?: \+ 2 \* i(?: \+ 1)?)?")
    bounces = (r"bounce (?:==|<|>) \d+", r"count ==? 0", r"1\.0, 0\)")
    for whole in hashes + dimensions + bounces:
        code = re.sub(whole, "", code, flags=re.DOTALL)
    code = re.sub(
        r"\b[ik] (?:==|>|<) [067]\b|int k = 0|texelFetch\(\w+, ivec2\(\d+, [i0]\), 0\)|textureSize\(\w+, 0\)|\[\d\]",
        "",
        code,
    )
    numbers = re.findall(r"(?<![\w.])\d+\.?\d*(?:[eE][+-]?\d+)?", code)
    assert numbers and all("." in number for number in numbers), [n for n in numbers if "." not in n]


def test_an_unknown_version_or_pass_is_a_fault() -> None:
    made = shader(SCENES["plain"])
    with pytest.raises(KeyError):
        made.text(version="120")
    with pytest.raises(ValueError):
        shader(SCENES["plain"], PASSES[2]).text("geometri")


# Names of the user's own, whatever they are.

NAMES = """
    march shade field sphere epsilon sample u_time material_at field_gradient main vec3 mat4 float Ray Hit Material
    trace
    max_steps scene_box surface_normal sky sky_color phong box_gradient sphere_gradient out_color out_march hit p ray
    normal unit atan2 steep below u_far u_pixel u_side texture gl_foo a__b PASS GL_ES camera_ray light_0_radiance
    u_resolution active result i color length min highp patch defined __LINE__ isnan pass_color row_major interpolated
    smooth_min hard_union sampler2D time u_camera_frame material_index field_field radius q
""".split()


def ball_named(name: str) -> Any:
    # A definition as a user writes it, with the name for its function, a parameter and a variable.
    variable = name if name != "length" else "length_"
    namespace: dict[str, Any] = {}
    code = (
        "from raymarch.expr import vocabulary as v\n"
        f"def {name}(p, radius_=0.7):\n"
        f"    {variable} = p * 1.25\n"
        f"    return v.length({variable}) * 0.8 + 0.0 * {variable}.x * {variable}.y - radius_\n"
    )
    exec(compile(code, __file__, "exec"), namespace)
    decorate = rm.shape(exactness="exact", bounds=lambda radius_: ((-radius_,) * 3, (radius_,) * 3))
    return decorate(namespace[name])


def crowd(names: list[str]) -> rm.Scene:
    shapes = [ball_named(name)(0.3 + 0.001 * i) for i, name in enumerate(names)]
    placed = [shape.translate((i % 8, i // 8, 0)) for i, shape in enumerate(shapes)]
    lights = [rm.Sun((rm.time, 1, 1), shadow=True), rm.PointLight((3, 3, rm.time + 9))]
    return rm.Scene(rm.union(*placed), lights=lights, fog=rm.Fog())


def test_a_shape_may_have_any_name(renderer: rm.Renderer, tmp_path: Path) -> None:
    pictures = []
    for names in (NAMES, [f"lump_{chr(97 + i // 26)}{chr(97 + i % 26)}" for i in range(len(NAMES))]):
        scene = crowd(names)
        frame = renderer.render(scene, time=1.0, outputs=("color", "depth"))
        pictures.append((frame.color, frame.depth))
        file = tmp_path / "web.frag"
        file.write_text(shader(scene, PASSES[2]).text(version="300 es"))
        done = subprocess.run([glslang(), str(file)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
    assert (pictures[0][0] == pictures[1][0]).all() and (pictures[0][1] == pictures[1][1]).all()
    assert pictures[0][1].min() < float("inf")


PARAMS = [name for name in NAMES if re.match(r"[a-zA-Z]", name)]
PARAMS += ["far", "pixel", "resolution", "camera_position", "camera slope", "side", "1", "höhe"]


def bumps(params: list[rm.Param], p: Any) -> Any:
    """Reads each parameter in the shader; two that are swapped make another shape."""
    return sum(r * (0.002 * (p.x - 37 * i % 89 / 89) * p.y) for i, r in enumerate(params))


def test_a_parameter_may_have_any_name(renderer: rm.Renderer, tmp_path: Path) -> None:
    pictures = []
    for names in (PARAMS, [f"value {i}" for i in range(len(PARAMS))]):
        params = [rm.Param(name, 0.1 + 0.009 * i, 0.1, 0.9) for i, name in enumerate(names)]
        node = rm.sphere().displace_by(partial(bumps, params), 0.3, 0.5).translate((0, 0, 0.1 * rm.time))
        camera = rm.Camera((0, 0, 5), (0, 0, 0))  # what moves with time has no box to be framed
        scene = rm.Scene(node, camera, lights=[rm.Sun(intensity=params[0] + params[1])])
        frame = renderer.render(scene, time=1.0, outputs=("color", "depth"))
        other = renderer.render(scene, time=1.0, params={names[7]: 0.8})
        assert (other.color != frame.color).any(), "the parameter did not reach the shader"
        pictures.append((frame.color, frame.depth))
        file = tmp_path / "web.frag"
        file.write_text(shader(scene, PASSES[2]).text(version="300 es"))
        done = subprocess.run([glslang(), str(file)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
    assert (pictures[0][0] == pictures[1][0]).all() and (pictures[0][1] == pictures[1][1]).all()


def test_two_parameters_never_share_a_uniform() -> None:
    node = rm.sphere(rm.Param("a b", 0.7, 0.5, 0.9)) | rm.sphere(rm.Param("a-b", 0.2, 0.1, 0.9)).translate((3, 0, 0))
    try:
        made = shader(rm.Scene(node))
    except rm.SceneError as refusal:
        assert "'a b'" in str(refusal) and "'a-b'" in str(refusal) and refusal.where is not None
    else:
        assert len(set(made.parameters.values())) == 2


# Examples.


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_the_text_of_an_example_reads_as_written_by_hand(file: Path) -> None:
    made = text(load(file))
    assert "\t" not in made and not re.search(r" +\n|\n{3,}", made)
    declared = re.findall(r"^\w+ (\w+)\((?!.*;)", made, re.MULTILINE)
    code = re.sub(r"//.*", "", made)
    for name in set(declared) - {"main"}:
        assert len(re.findall(rf"\b{name}\b", code)) > 1, f"{name} is there but nothing calls it"


@pytest.mark.parametrize("name", SCENES)
def test_no_function_stands_twice(name: str) -> None:
    """The field and its materials ask the same parts by the same functions."""
    code = re.sub(r"//.*", "", assembled(name, PASSES[2]).text())
    # Functions of nothing are values; two of them may well be equal.
    bodies = re.findall(r"^(\w+) \w+(\([^)]+\) \{\n.*?^\})", code, re.MULTILINE | re.DOTALL)
    assert len(bodies) > 5 and len(set(bodies)) == len(bodies)
