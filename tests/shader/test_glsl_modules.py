"""The header of each hand-written module says what it gives and what it needs, no more and no less."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from raymarch import glsl

FOLDER = Path(glsl.__file__).parent
MODULES = sorted(str(file.relative_to(FOLDER))[: -len(".glsl")] for file in FOLDER.rglob("*.glsl"))

TYPE = r"(?:void|bool|int|uint|float|[biu]?vec[234]|mat[234]|sampler[23]D|[A-Z]\w*)"
WORDS = frozenset(
    """
    void bool int uint float vec2 vec3 vec4 ivec2 ivec3 ivec4 uvec2 uvec3 uvec4 bvec2 bvec3 bvec4 mat2 mat3 mat4
    sampler2D sampler3D struct uniform const in out inout layout location if else for while do return break continue
    discard true false highp mediump lowp precision
    radians degrees sin cos tan asin acos atan sinh cosh tanh pow exp log exp2 log2 sqrt inversesqrt abs sign floor ceil
    trunc round fract mod min max clamp mix step smoothstep isnan isinf length distance dot cross normalize reflect
    refract transpose inverse determinant texelFetch textureSize texture any all not lessThan greaterThan equal
    floatBitsToUint uintBitsToFloat gl_FragCoord greaterThanEqual ifdef else endif CONE clock2x32ARB
    """.split()
)


def code_of(name: str) -> str:
    text = "\n".join(glsl.load(name).lines)
    text = re.sub(r"//.*", "", text)
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


def outermost(code: str) -> str:
    """What stands outside of all braces and parentheses."""
    found, depth = [], 0
    for c in code:
        depth -= c in ")}"
        if depth == 0:
            found.append(c)
        depth += c in "({"
    return "".join(found)


def declared(code: str) -> set[str]:
    """Functions, structs, uniforms, outputs, constants and variables of the file."""
    top = outermost(code)
    functions = re.findall(rf"\b{TYPE}\s+(\w+)\s*\(", top)
    structs = re.findall(r"\bstruct\s+(\w+)", top)
    variables = re.findall(rf"(?m)^(?:layout\(.*?\) )?(?:(?:uniform|const|out|in)\s+)?{TYPE}\s+(\w+) *[;=\[]", top)
    return {*functions, *structs, *variables}


def used(code: str) -> set[str]:
    """Names that the file neither has from the language nor declares, be it at the top or in a function."""
    names = set(re.findall(r"(?<![\w.])[A-Za-z_]\w*", code))
    local = set(re.findall(rf"\b{TYPE}\s+(\w+)", code))
    return names - WORDS - local - declared(code)


def test_there_are_modules() -> None:
    assert len(MODULES) >= 15


@pytest.mark.parametrize("name", MODULES)
def test_a_module_gives_what_its_header_says(name: str) -> None:
    assert glsl.load(name).gives == declared(code_of(name))


@pytest.mark.parametrize("name", MODULES)
def test_a_module_needs_what_its_header_says(name: str) -> None:
    assert glsl.load(name).needs == used(code_of(name))


@pytest.mark.parametrize("name", MODULES)
def test_a_module_says_what_it_is_for(name: str) -> None:
    module = glsl.load(name)
    assert module.lines[0].startswith("// ") and module.summary[0].isupper() and len(module.summary) > 10
    headers = [line for line in module.lines if line.startswith(("// needs:", "// gives:"))]
    assert len(headers) == 2


def test_a_module_without_its_header_or_of_no_such_name_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
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

    monkeypatch.setattr(glsl, "files", lambda _: Source())
    for text in (
        "float f() { return 1.0; }\n",
        "// F.\n// needs:\nfloat f() { return 1.0; }\n",
        "// F.\n// gives: f\n",
    ):
        Source.text = text
        with pytest.raises(ValueError, match="'needs:' or 'gives:'"):
            glsl.load.__wrapped__("light/f")


def test_names_that_are_given_twice_are_alternatives() -> None:
    """Two modules that give one name never stand in one shader: tracers, normals, passes, the two clippings,
    structs of materials, ways of masking, the two probes, and pictures in which something moves or not."""
    givers: dict[str, list[str]] = {}
    for name in MODULES:
        for given in glsl.load(name).gives:
            givers.setdefault(given, []).append(name)
    packages = {frozenset(name.split("/")[0] for name in names) for names in givers.values() if len(names) > 1}
    alone = {frozenset({package}) for package in ("march", "normal", "view", "material", "light", "probe", "temporal")}
    assert packages <= alone | {frozenset({"view", "temporal"})}
