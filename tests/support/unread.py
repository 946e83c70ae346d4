"""What of a GLSL text is never read: functions, parameters, fields of structs, and variables of all kinds.

It reads the preprocessed text by itself, and shares nothing with the linker. Names count, not their scopes: a field is
read if any field of that name is, so what is found is unread for certain.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

WORD = re.compile(r"[A-Za-z_]\w*|\d[\w.]*(?:e[+-]?\d+)?|\.\d\w*|[-+*/]=|[=!<>]=|&&|\|\||\+\+|--|<<|>>|\S")
QUALIFIERS = {"const", "in", "out", "inout", "uniform", "highp", "precise"}
PLAIN = set(
    "void bool int uint float vec2 vec3 vec4 bvec2 bvec3 bvec4 ivec2 ivec3 ivec4 uvec2 uvec3 uvec4 mat2 mat3 mat4 "
    "sampler2D sampler3D".split()
)


@dataclass(frozen=True)
class _Function:
    name: str
    parameters: dict[str, str]  # by name, the qualifier
    body: list[str]


def preprocessed(text: str) -> str:
    """The text without comments and conditions, by glslang."""
    command = ["glslangValidator", "--stdin", "-S", "frag", "-E"]
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    return "\n".join(line for line in done.stdout.split("\n") if not line.startswith("#"))


def unread(text: str) -> list[str]:
    """A line for each part of a shader that nothing reads."""
    tokens = WORD.findall(preprocessed(text))
    structs, functions, names = _parts(tokens)
    types = PLAIN | set(structs)
    return [*_uncalled(functions), *_unused_types(tokens, structs), *_unread_names(tokens, functions, names, types)]


def _parts(tokens: list[str]) -> tuple[dict[str, list[str]], list[_Function], list[str]]:
    """The structs with their fields, the functions with a body, and the variables outside of functions."""
    structs: dict[str, list[str]] = {}
    functions: list[_Function] = []
    names: list[str] = []
    at = 0
    while at < len(tokens):
        end = _statement(tokens, at)
        part = tokens[at:end]
        at = end
        if part[0] == "struct":
            structs[part[1]] = [word for word, after in pairwise(part[3:-2]) if after == ";"]
        elif part[-1] == "}" and "(" in part and "=" not in part[: part.index("{")]:
            opened, begin = part.index("("), part.index("{")
            groups = " ".join(part[opened + 1 : begin - 1]).split(",")
            given = [group.split() for group in groups if group.strip() not in ("", "void")]
            owned = {re.sub(r" .*", "", _name(group)): group[0] for group in given}
            functions.append(_Function(part[opened - 1], owned, part[begin + 1 : -1]))
        elif (
            part[0] not in ("precision", "layout", ";")
            and "(" not in part[: part.index("=") if "=" in part else None][2:]
        ):
            names += [_name(part[: part.index("=")] if "=" in part else part[:-1])]
    return structs, functions, names


def _name(declaration: list[str]) -> str:
    """The name that a declaration without its value ends in, before the size of an array."""
    cut = declaration.index("[") if "[" in declaration else len(declaration)
    return declaration[cut - 1]


def _statement(tokens: list[str], at: int) -> int:
    """Where a declaration at the top ends."""
    depth = 0
    for i in range(at, len(tokens)):
        depth += (tokens[i] in "({") - (tokens[i] in ")}")
        function = tokens[i] == "}" and tokens[at] != "struct" and (i + 1 == len(tokens) or tokens[i + 1] != ";")
        if depth == 0 and (tokens[i] == ";" or function):
            return i + 1
    raise AssertionError(f"no end of {' '.join(tokens[at : at + 8])}")


def _uncalled(functions: list[_Function]) -> Iterator[str]:
    reached, pending = set[str](), ["main"]
    while pending:
        name = pending.pop()
        if name not in reached:
            reached.add(name)
            pending += [word for of in functions if of.name == name for word in of.body]
    yield from (f"function {of.name} is never called" for of in functions if of.name not in reached)


def _unused_types(tokens: list[str], structs: dict[str, list[str]]) -> Iterator[str]:
    read = {
        after for dot, after, then in zip(tokens, tokens[1:], tokens[2:], strict=False) if dot == "." and then != "="
    }
    for name, fields in structs.items():
        if tokens.count(name) < 2:
            yield f"struct {name} is never used"
        for field in fields:
            if field not in read:
                yield f"field {name}.{field} is never read"


def _unread_names(tokens: list[str], functions: list[_Function], names: list[str], types: set[str]) -> Iterator[str]:
    for name in names:
        if tokens.count(name) < 2:
            yield f"{name} is never read"
    for of in functions:
        for name, qualifier in of.parameters.items():
            if qualifier != "out" and name not in of.body:
                yield f"parameter {name} of {of.name} is never read"
        for before, name, after in zip(["", *of.body], of.body, of.body[1:], strict=False):
            if before in types and after in ("=", ";", "[") and not _is_read(name, of.body):
                yield f"variable {name} in {of.name} is never read"


def _is_read(name: str, body: list[str]) -> bool:
    """Whether a name stands anywhere but where it is declared or set."""
    for i, word in enumerate(body):
        declared = i > 0 and (body[i - 1] in PLAIN or body[i - 1][0].isupper())
        follows = body[i + 1] if i + 1 < len(body) else ""
        starts = i == 0 or body[i - 1] in (";", "{", "}", ")", "else")
        if word == name and not declared and not (starts and follows == "="):
            return True
    return False
