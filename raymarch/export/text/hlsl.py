"""A scene as HLSL for Direct3D, Unity and Unreal: a pixel shader for a full screen, and its vertex shader.

Types, built-in functions and constructors have other names than in GLSL. Matrices have the columns of GLSL as rows, so
products exchange their operands.
"""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.errors import PlanError
from raymarch.export.inputs import Text
from raymarch.export.translated import PIXEL, Declared, Input, closing, translated
from raymarch.expr.walk import find
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene

TYPES = {
    **{
        f"{kind}vec{n}": f"{own}{n}"
        for kind, own in (("", "float"), ("i", "int"), ("u", "uint"), ("b", "bool"))
        for n in (2, 3, 4)
    },
    **{f"mat{n}": f"float{n}x{n}" for n in (2, 3, 4)},
}
"""Names of types."""

COMPARED = {"lessThan": "<", "lessThanEqual": "<=", "greaterThan": ">", "greaterThanEqual": ">=", "equal": "=="}

PRODUCT = "matrix product"
"""The word of a product with a matrix."""

FUNCTIONS = {
    "fract": "frac",
    "roundEven": "round",
    "inversesqrt": "rsqrt",
    "dFdx": "ddx",
    "dFdy": "ddy",
    "mod": "modulo",
    "atan": "arc_tangent",
    "floatBitsToUint": "asuint",
    "floatBitsToInt": "asint",
    "uintBitsToFloat": "asfloat",
    "not": "negated",
    PRODUCT: "mul",
    "intBitsToFloat": "asfloat",
    "mix": "mixed",
    **{name: f"compared_{name.lower()}" for name in COMPARED},
}
"""Names of built-in functions."""

WORDS = frozenset(
    """
    half point line lineadj triangle triangleadj sample texture pass technique matrix vector string linear precise
    interface class namespace export shared compile nointerpolation centroid noperspective packoffset register noise
    dst lit rcp saturate sincos lerp mad clip frac fmod ldexp frexp abort unsigned char short long double static
    extern volatile snorm unorm row_major column_major cbuffer tbuffer groupshared inline typedef template this
    sampler stateblock discard log10 rsqrt asfloat asint asuint mul ddx ddy tex2D fixed auto catch new delete using
    """.split()
)
"""Words of HLSL that may be names in GLSL."""

HEAD = """// A scene of raymarch in HLSL, shader model 5: a pixel shader `main` for a full screen, and the vertex shader
// `full_screen`, to be drawn with 3 vertices and no buffer. It writes sRGB, for a target that does not encode.

cbuffer Inputs : register(b0) {
INPUTS
};
"""

MAIN = """
float4 main(float4 position : SV_Position) : SV_Target {
    float2 pixel = float2(position.x, u_resolution.y - position.y);
SET    return float4(picture(pixel), 1.0);
}

float4 full_screen(uint vertex : SV_VertexID) : SV_Position {
    return float4(vertex == 1 ? 3.0 : -1.0, vertex == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""


def text_of(scene: Scene, values: Values) -> Text:
    """The shader. Comments state the initial values of its inputs, which the program sets.

    Raises PlanError for textures, and for lights and a sky light that change.
    """
    if find(scene.expressions(), "raw", "raw_slope"):
        raise PlanError("a .hlsl file holds no GLSL nodes", legal="a .gdshader, or a .glsl", where=scene.node.where)
    made = translated(scene, values, ".hlsl")
    structs = {part.name for part in made.parts if part.kind == "struct"}
    lines = []
    for part in made.parts:
        lines.append("".join(_written(part, structs)).strip("\n") + "\n")
        if part.kind == "struct":
            lines.append(_maker(part))
    inputs = "\n".join(map(_input, made.inputs))
    sets = f"    {PIXEL} = pixel;\n" if any(part.name == PIXEL for part in made.parts) else ""
    parts = [HEAD.replace("INPUTS", inputs), _helpers("\n".join(lines)), *lines]
    return Text("\n".join(parts) + MAIN.replace("SET", sets))


def _input(given: Input) -> str:
    value = given.value if "(" not in given.value else given.value[given.value.index("(") :]
    return f"    {TYPES.get(given.type, given.type)} {_own(given.name)};  // {value}: {given.note}"


MATRICES = frozenset(f"mat{n}" for n in (2, 3, 4))
VECTORS = frozenset(f"{kind}vec{n}" for kind in ("", "i", "u", "b") for n in (2, 3, 4))


def _own(name: str) -> str:
    """A name of the shader, which no word of HLSL is."""
    return f"{name}_" if name in WORDS else name


def _fields(struct: Declared) -> list[tuple[str, str]]:
    """The types and names of the fields of a struct, in HLSL."""
    code = [w for w in struct.words if not w.isspace() and not w.startswith("//")]
    found, field = [], list[str]()
    for word in code[code.index("{") + 1 : code.index("}")]:
        field.append(word)
        if word == ";":
            at = field.index("[") if "[" in field else len(field) - 1
            found.append((TYPES.get(field[at - 2], field[at - 2]), _own(field[at - 1])))
            field = []
    return found


def _maker(struct: Declared) -> str:
    """A function that makes a struct of its fields, for the constructors of GLSL."""
    fields = _fields(struct)
    given = ", ".join(f"{kind} {name}" for kind, name in fields)
    sets = "\n".join(f"    made.{name} = {name};" for _, name in fields)
    return f"{struct.name} make_{struct.name}({given}) {{\n    {struct.name} made;\n{sets}\n    return made;\n}}\n"


def _written(part: Declared, structs: set[str]) -> list[str]:
    """The words of a part in HLSL."""
    words = _products(list(part.words))
    words = _equalities(words)
    made: list[str] = []
    for i, word in enumerate(words):
        before, after = (words[i - 1] if i else ""), (words[i + 1] if i + 1 < len(words) else "")
        if before == "." or not (word.isidentifier() or word == PRODUCT):
            made.append(word)
        elif after == "(" and word in structs:
            made.append(f"make_{word}")
        elif after == "(" and word in TYPES and not word.startswith("mat"):
            count = _arguments(words, i + 1)
            own = TYPES[word]
            if count == 1 and part.kind == "variable":  # a constant takes no function
                given = slice(i + 2, closing(words, i + 1))
                count = int(own[-1])
                words[given] = [*words[given], *([",", " ", *words[given]] * (count - 1))]
            made.append(own if count == int(own[-1]) else f"make_{own}")
        elif after == "(" and word in FUNCTIONS:
            made.append(FUNCTIONS[word])
        else:
            made.append(TYPES.get(word, _own(word)))
    if part.kind == "variable":
        first = next(i for i, word in enumerate(made) if word.isidentifier())
        made[first] = f"static {made[first]}"
        _initializer(made)
    return made


def _arguments(words: Sequence[str], bracket: int) -> int:
    """The number of arguments of a call, from the place of its bracket."""
    depth, commas = 0, 0
    for word in words[bracket : closing(words, bracket)]:
        depth += (word in ("(", "[")) - (word in (")", "]"))
        commas += depth == 1 and word == ","
    return commas + 1


def _initializer(words: list[str]) -> None:
    """The array constructor of GLSL in a declaration, `float4[3](a, b)`, as a list in braces."""
    if "=" not in words or "[" not in words[words.index("=") :]:
        return
    at = words.index("=")
    bracket = words.index("(", at)
    if words[bracket - 1] != "]":
        return
    end = closing(words, bracket)
    words[end] = "}"
    words[at + 1 : bracket + 1] = [" ", "{"]


def _operand(words: Sequence[str], start: int) -> int:
    """The end of an operand that starts at a place: a sign, a name, a call or brackets, with fields and elements."""
    i = start
    while words[i].isspace() or words[i] == "-":
        i += 1
    i = closing(words, i) + 1 if words[i] == "(" else i + 1
    while i < len(words) and words[i] in ("(", "[", "."):
        i = i + 2 if words[i] == "." else closing(words, i) + 1
    return i


def _products(words: list[str]) -> list[str]:
    """Words in which the product of a matrix and an operand is a call of `mul`."""
    matrices = {words[i + 2] for i, w in enumerate(words[:-2]) if w in MATRICES and words[i + 1].isspace()}
    matrices |= {"u_camera_frame"}
    i = 0
    while i < len(words):
        named = words[i] in matrices and (i == 0 or words[i - 1] != ".")
        made = words[i] in MATRICES and words[i + 1] == "("
        if named or made:
            end = closing(words, i + 1) + 1 if made else _operand(words, i)
            times = next((k for k in range(end, len(words)) if not words[k].isspace()), len(words) - 1)
            before = next((w for w in reversed(words[:i]) if not w.isspace()), "")
            if before in ("*", "/"):
                raise PlanError("a product with a matrix on the right, which a .hlsl file does not hold")
            if words[times] == "*":
                right = _operand(words, times + 1)
                left = words[i:end]
                inner = _products(words[times + 1 : right])
                words[i:right] = [PRODUCT, "(", *_trimmed(inner), ",", " ", *_products_inside(left), ")"]
                i += 1
                continue
        i += 1
    return words


def _products_inside(words: Sequence[str]) -> list[str]:
    """The arguments of a matrix may hold products too."""
    bracket = words.index("(") if "(" in words else len(words)
    return [*words[: bracket + 1], *_products(list(words[bracket + 1 :]))]


def _trimmed(words: Sequence[str]) -> list[str]:
    return list(words[1:]) if words and words[0].isspace() else list(words)


def _equalities(words: Sequence[str]) -> list[str]:
    """Words in which the comparison with a vector is one truth value, as in GLSL."""
    made = list(words)
    for i in range(len(made) - 3, 0, -1):
        if made[i] in ("==", "!=") and made[i + 2] in VECTORS:
            end, start = _operand(made, i + 2), i - 2
            while made[start - 1] == ".":
                start -= 2
            made[start:end] = ["any" if made[i] == "!=" else "all", "(", *made[start:end], ")"]
    return made


def _helpers(text: str) -> str:
    """The functions that GLSL has and HLSL lacks, those that a text calls."""
    made: list[str] = []
    for kind in ("float", "int", "uint", "bool"):
        made += [_constructors(kind, n) for n in (2, 3, 4) if f"make_{kind}{n}(" in text]
    for n in ("", "2", "3", "4"):
        kind = f"float{n}"
        if "modulo(" in text:
            made.append(f"{kind} modulo({kind} x, {kind} y) {{ return x - y * floor(x / y); }}")
            made += [f"{kind} modulo({kind} x, float y) {{ return x - y * floor(x / y); }}"] if n else []
        if "arc_tangent(" in text:
            made.append(f"{kind} arc_tangent({kind} x) {{ return atan(x); }}")
            made.append(f"{kind} arc_tangent({kind} y, {kind} x) {{ return atan2(y, x); }}")
        if "mixed(" in text:
            made.append(f"{kind} mixed({kind} x, {kind} y, {kind} a) {{ return lerp(x, y, a); }}")
            made += [f"{kind} mixed({kind} x, {kind} y, float a) {{ return lerp(x, y, a); }}"] if n else []
            made.append(f"{kind} mixed({kind} x, {kind} y, bool{n} a) {{ return a ? y : x; }}")
        if n and "negated(" in text:
            made.append(f"bool{n} negated(bool{n} x) {{ return !x; }}")
        for name, symbol in COMPARED.items():
            own = FUNCTIONS[name]
            if n and f"{own}(" in text:
                made += [
                    f"bool{n} {own}({k}{n} x, {k}{n} y) {{ return x {symbol} y; }}" for k in ("float", "int", "uint")
                ]
    return "\n".join(made) + "\n"


def _constructors(kind: str, n: int) -> str:
    """Functions that make a vector as GLSL does: of one number, of another vector, of numbers and vectors."""
    own = f"{kind}{n}"
    others = [k for k in ("float", "int", "uint", "bool") if k != kind]
    made = [f"{own} make_{own}({kind} x) {{ return {own}({', '.join('x' * n)}); }}"]
    made += [f"{own} make_{own}({k}{n} x) {{ return ({own})x; }}" for k in (kind, *others)]
    for split in _splits(n):
        if 1 < len(split) < n:
            names = "xyzw"[: len(split)]
            given = ", ".join(
                f"{kind}{size if size > 1 else ''} {name}" for size, name in zip(split, names, strict=True)
            )
            made.append(f"{own} make_{own}({given}) {{ return {own}({', '.join(names)}); }}")
    return "\n".join(made)


def _splits(n: int) -> list[tuple[int, ...]]:
    """The ways to write n as an ordered sum."""
    return [()] if n == 0 else [(first, *rest) for first in range(1, n + 1) for rest in _splits(n - first)]
