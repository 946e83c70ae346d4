"""What hand-written modules define and use."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from raymarch import glsl

FOLDER = Path(glsl.__file__).parent
MODULES = sorted(str(file.relative_to(FOLDER))[: -len(".glsl")] for file in FOLDER.rglob("*.glsl"))


def test_there_are_modules() -> None:
    assert len(MODULES) >= 15


NONE = frozenset[str]()

TEXT = """\
// Used in words only: nothing, float of(float x).
struct Ball { vec3 centre; float size; };  /* hidden(1.0)
hidden(2.0) */
uniform float u_time;
layout(location = 0) out vec4 out_color;
const float LARGE = 1.0e6;
Ball last = Ball(vec3(0.0), 1.0);

float inside(Ball ball, vec3 p) {
    float d = distance(ball.centre, p);
    for (int i = 0; i < turns; i++) d = min(d, ball.size - helper(d, LARGE).y);
    return d;
}
"""


def test_names_are_read_from_the_code() -> None:
    assert glsl.defined(TEXT) == {"Ball", "u_time", "out_color", "LARGE", "last", "inside"}
    assert glsl.used(TEXT) == {"turns", "helper"}


def test_declarations_have_kinds_and_types() -> None:
    found = {each.name: (each.kind, each.type) for each in glsl.declarations(TEXT + "uniform vec3 many[9];")}
    assert found == {
        "Ball": ("struct", ""),
        "u_time": ("uniform", "float"),
        "out_color": ("out", "vec4"),
        "LARGE": ("const", "float"),
        "last": ("variable", "Ball"),
        "inside": ("function", "float"),
        "many": ("uniform", "vec3[9]"),
    }


@pytest.mark.parametrize("name", MODULES)
def test_numbers_are_those_with_a_point(name: str) -> None:
    text = "\n".join(glsl.load(name).lines) + " a1.0 1.0f x.5 2.5e7 -3.25e-7*1.0e+3;v4.0 1. 7 .5 1.5.xx (4.125)"
    expected = [found.span() for found in re.finditer(r"(?<![\w.])\d+\.\d+(?:e[-+]?\d+)?(?![\w.])", text)]
    assert glsl.numbers(text) == expected and len(expected) >= 4


def test_no_regular_expression_reads_or_edits_generated_text() -> None:
    """Whatever a consumer of a shader asks, it asks the lines, the declarations or the words."""
    root = FOLDER.parent
    files = [*(root / "glsl").glob("*.py"), *(root / "shader").rglob("*.py"), *(root / "export").rglob("*.py")]
    files += [root / "window" / "constants.py", *(root / "gpu" / f"{name}.py" for name in ("part", "prepare", "views"))]
    reading = [file for file in files for node in ast.walk(ast.parse(file.read_text())) if _imports(node, "re")]
    assert len(files) > 20 and reading == []


def _imports(node: ast.AST, name: str) -> bool:
    listed = isinstance(node, ast.Import) and any(each.name == name for each in node.names)
    return listed or (isinstance(node, ast.ImportFrom) and node.module == name)


@pytest.mark.parametrize("name", MODULES)
def test_a_module_says_what_it_is_for(name: str) -> None:
    module = glsl.load(name)
    assert module.lines[0].startswith("// ") and module.summary[0].isupper() and len(module.summary) > 10


@pytest.mark.parametrize("name", MODULES)
def test_no_line_is_longer_than_120_columns(name: str) -> None:
    assert max(map(len, (FOLDER / f"{name}.glsl").read_text().split("\n"))) <= 120


def test_what_a_module_uses_is_given_by_modules_or_generated() -> None:
    """The names that no module gives. A misspelt name would be one more."""
    sets = (NONE, glsl.VARIANTS, glsl.VARIANTS - {"PUBLISHED", "UNDIVIDED", "JOINT"})  # in place of others
    loaded = [glsl.load(name, variants) for name in MODULES for variants in sets]
    used = frozenset[str]().union(*(module.needs for module in loaded))
    given = frozenset[str]().union(*(module.gives for module in loaded))
    assert used - given == set(GENERATED.split())


GENERATED = """
    Light Material Part Relief add_light begin_sample color_fault cone_share contact_share leap_pixels epsilon_pixels
    field_advance field_faults field_gradient field_value footprint_axis footprint_pixels keep_surface kept_hit
    linear_to_srgb
    march_steps marched_field own_step ray_kind
    marched_range material_at material_index part_at path_extent pcg picture_samples previous_position relax_again
    relaxation relief_at rising_steps scene_box scene_cone secondary_steps set_frame shade shading_normal shadow_steps
    smoothing divided solved_advance solved_field solved_hit step_scale surface_texels step_variation surface_faults
    toned undivided_advance undivided_field
    iChannel0 iFrame iMouse iResolution
"""


def test_a_module_without_its_sentence_or_of_no_such_name_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(KeyError, match="no GLSL module 'light/laser'"):
        glsl.load("light/laser")

    class Source:
        text = ""

        def joinpath(self, *_: str) -> Source:
            return self

        def is_file(self) -> bool:
            return True

        def read_text(self, **_: str) -> str:
            return self.text

    monkeypatch.setattr(glsl, "_folder", Source)
    for text in ("float f() { return 1.0; }\n", "// F.\n"):
        Source.text = text
        with pytest.raises(ValueError, match="lacks a comment in its first line, or defines nothing"):
            glsl.load.__wrapped__("light/f")


def test_names_that_are_given_twice_are_alternatives() -> None:
    """Two modules that give one name never stand in one shader: tracers, normals, passes, the two clippings,
    structs of materials, ways of masking, the two probes, and pictures in which something moves or not."""
    several = [names for names in glsl.givers().values() if len(names) > 1]
    packages = {frozenset(name.split("/")[0] for name in names) for names in several}
    alone = {frozenset({package}) for package in ("march", "normal", "view", "material", "light", "probe", "temporal")}
    main = {frozenset({"view", "temporal"}), frozenset({"view", "temporal", "post"})}
    assert packages <= alone | main
