"""The functions of a scene in WGSL, the language of WebGPU: field, gradient, materials, lights, BSDFs, sky, tone curve.

A program in WGSL calls them; the march and the passes are its own. A parameter is a private variable `u_NAME`, which
the program sets, as it sets those of `STATE`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from raymarch.errors import PlanError
from raymarch.export.inputs import Text, harmonics, planned
from raymarch.expr.glsl import TIME, Dialect, FunctionPrinter, print_functions
from raymarch.expr.node import Expr, const, make
from raymarch.expr.pieces import ATOM, ORDER, Piece, call_text, constant, wrap
from raymarch.expr.templates import TEMPLATES, Template
from raymarch.expr.types import BOOL, FLOAT, Type
from raymarch.expr.walk import find, free_variables
from raymarch.plan.hoisting import with_hoisted
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.visibility import KINDS
from raymarch.shader.assemble import expression_functions

WORDS = """
fn let var loop continuing array ptr select override ref self set shared target trait type use where with as auto await
become class concept const_cast crate debugger delete enum explicit export extends final finally friend from get goto
impl implements import interface macro match mod module move mut mutable namespace new nil null of operator package
pass private protected pub public register regardless require resource restrict static super then this throw try typeof
union unless unsafe using virtual wgsl yield fallthrough bitcast saturate ldexp frexp f32 i32 u32 f16 read write
"""
"""Words of WGSL that may be names in GLSL."""

REFUSED = ("raw", "raw_slope", "sample", "sample_slope", "sample_bend", "texture", "texture_in_atlas", "fetch")
"""Operations that need textures, or text of another language."""

STATE = {
    "u_side": ("-1 if the camera is inside of the solid, else 1", "1.0"),
    "stretch_ahead": ("the stretch of the ray that `field_advance` looks at: see raymarch/sdf/advance.py", "1.0"),
    "ray_kind": (", ".join(f"{i} for {kind} rays" for i, kind in enumerate(KINDS)), "0.0"),
}
"""Variables that a shader sets while it draws: their meaning, and the initial value."""


def type_text(type: Type) -> str:
    """A type by its name in WGSL: vec3f, mat3x3f."""
    if type is FLOAT or type is BOOL:
        return "f32" if type is FLOAT else "bool"
    if type.is_matrix:
        return f"mat{type.size}x{type.size}f"
    return type.name if type.fields else f"{type.name}f"


def _splat(arg: Expr, piece: Piece, wanted: Type) -> Piece:
    """A number beside vectors as a vector: WGSL has no functions of both."""
    if arg.type is not FLOAT or not wanted.is_vector:
        return piece
    return call_text(type_text(wanted), [piece], [arg])


def _call(name: str, guard: str = "") -> Template:
    """A built-in function of arguments of one type. guard : clamps the first one to the domain."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        wide = max((arg.type for arg in node.args), key=lambda type: type.size)
        args = [_splat(arg, piece, wide) for arg, piece in zip(node.args, pieces, strict=True)]
        if guard:
            least = f"{type_text(wide)}({guard})" if wide.is_vector else guard
            args[0] = Piece(f"max({args[0].text}, {least})", ATOM, args[0].depth + 1)
        return call_text(name, args, node.args)

    return template


def _helper(name: str, text: str) -> Template:
    """A function of WGSL text, for each type: functions have no overloads. TYPE is the type, NAME the name."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        type = type_text(node.args[0].type if node.type is BOOL else node.type)
        own = name if "TYPE" not in text else f"{name}_{type.lower()}"
        printer.helpers[own, ""] = text.replace("TYPE", type).replace("NAME", own)
        wide = node.type if node.op == "mod" else BOOL
        return call_text(own, [_splat(a, p, wide) for a, p in zip(node.args, pieces, strict=True)], node.args)

    return template


_CHOSEN = """fn NAME(condition: bool, yes: TYPE, no: TYPE) -> TYPE {
    if (condition) { return yes; }
    return no;
}"""
_ARC = """fn NAME(x: TYPE) -> TYPE {
    let a = min(abs(x), TYPE(1.0));
    let wide = a > TYPE(0.5);
    let z = select(a * a, 0.5 - 0.5 * a, wide);
    let s = select(a, sqrt(z), wide);
    let high = 0.0454771 + z * (0.02414759 + z * 0.04221859);
    let r = s + s * z * (0.16666754 + z * (0.07495242 + z * high));
    ACUTE
}"""
_ARC_SINE = """let acute = select(r, 1.5707964 - 2.0 * r, wide);
    return select(acute, -acute, x < TYPE(0.0));"""
_ARC_COSINE = """let acute = select(1.5707964 - r, 2.0 * r, wide);
    return select(acute, 3.1415927 - acute, x < TYPE(0.0));"""
_ATAN2 = """fn NAME(y: TYPE, x: TYPE) -> TYPE {
    let u = abs(x);
    let v = abs(y);
    let t = min(u, v) / max(max(u, v), TYPE(1.1754944e-38));
    let z = t * t;
    let high = -0.07580577 + z * (0.04355352 + z * (-0.01658117 + z * 0.00297459));
    let low = t + t * z * (-0.33333167 + z * (0.19994137 + z * (-0.14214209 + z * (0.1067894 + z * high))));
    let steep = select(low, 1.5707964 - low, v > u);
    let wide = select(steep, 3.1415927 - steep, x < TYPE(0.0));
    return select(wide, -wide, y < TYPE(0.0));
}"""
"""The polynomials of `raymarch.expr.glsl`: built-in functions have errors up to 4e-4."""
_HASH = """fn pcg(value: u32) -> u32 {
    var v = value * 747796405u + 2891336453u;
    v = ((v >> ((v >> 28u) + 4u)) ^ v) * 277803737u;
    return (v >> 22u) ^ v;
}

fn cell_hash(cell: vec3f) -> f32 {
    let n = vec3u(vec3i(round(clamp(cell, vec3f(-1.0e9), vec3f(1.0e9)))));
    return f32(pcg(n.x + pcg(n.y + pcg(n.z))) >> 8u) * 5.9604645e-8;
}"""


def _angle(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    """The angle of (x, y); x is 1 for "atan"."""
    args = (*node.args, const(1.0))[:2]
    both = make("atan2", node.type, args)
    pieces = [_splat(a, p, node.type) for a, p in zip(args, pieces, strict=True)]
    return _helper("angle", _ATAN2)(printer, both, pieces)


def _where(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    if node.type.fields or node.type.is_matrix:
        return _helper("chosen", _CHOSEN)(printer, node, pieces)
    return call_text("select", [pieces[2], pieces[1], pieces[0]], [node.args[2], node.args[1], node.args[0]])


def _logic(symbol: str) -> Template:
    """WGSL wants parentheses where && and || meet."""

    def template(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
        left, right = (wrap(piece, ORDER) for piece in pieces)
        return Piece(f"({left.text} {symbol} {right.text})", ATOM, 1 + max(left.depth, right.depth))

    return template


def _construct(printer: FunctionPrinter, node: Expr, pieces: Sequence[Piece]) -> Piece:
    same = all(arg is node.args[0] for arg in node.args) and node.args[0].type is FLOAT
    count = 1 if same and node.type.is_vector else len(pieces)
    return call_text(type_text(node.type), pieces[:count], node.args[:count])


class Wgsl(Dialect):
    """WGSL."""

    templates: Mapping[str, Template] = {
        **TEMPLATES,
        **{name: _call(name) for name in ("min", "max", "clamp", "mix", "smoothstep", "step")},
        **{name: _call(name, "1.1754944e-38") for name in ("log", "log2", "pow")},
        "asin": _helper("arc_sine", _ARC.replace("ACUTE", _ARC_SINE)),
        "acos": _helper("arc_cosine", _ARC.replace("ACUTE", _ARC_COSINE)),
        "atan": lambda printer, node, pieces: _angle(printer, node, [*pieces, Piece("1.0", ATOM, 0)]),
        "atan2": lambda printer, node, pieces: _angle(printer, node, pieces),
        "sqrt": _call("sqrt", "0.0"),
        "mod": _helper("modulo", "fn NAME(x: TYPE, y: TYPE) -> TYPE {\n    return x - y * floor(x / y);\n}"),
        "normalize": _helper("unit", "fn NAME(v: TYPE) -> TYPE {\n    return v / max(length(v), 1.0842022e-19);\n}"),
        "hash": _helper("cell_hash", _HASH),
        "where": _where,
        "and": _logic("&&"),
        "or": _logic("||"),
        "construct": _construct,
        "columns": _construct,
    }
    leave = ("if (", ") { break; }")

    def constant(self, node: Expr) -> str:
        text = constant(node)
        return text if node.type in (BOOL, FLOAT) else f"{type_text(node.type)}{text[len(node.type.name) :]}"

    def head(self, name: str, type: Type, params: Sequence[tuple[Type, str]]) -> str:
        listed = ", ".join(f"{param}: {type_text(of)}" for of, param in params)
        return f"fn {name}({listed}) -> {type_text(type)} {{"

    def declare(self, type: Type, name: str, changes: bool = False) -> str:
        return f"{'var' if changes else 'let'} {name}: {type_text(type)} = "

    def loop(self, counter: str, count: int) -> str:
        return f"for (var {counter} = 0; {counter} < {count}; {counter}++) {{"

    def number(self, counter: str) -> str:
        return f"f32({counter})"


def text_of(scene: Scene, values: Values) -> Text:
    """The functions of the scene. Raises PlanError for textures, data and GLSL nodes."""
    made = planned(scene, "standalone")
    functions = expression_functions(made)
    text = print_functions(functions, WORDS.split(), dialect=Wgsl())
    if find([e for f in text.names for e in f.inner], *REFUSED):
        raise PlanError(
            "a .wgsl file holds no textures, sampled data and GLSL nodes", legal="a .html page", where=scene.node.where
        )
    lines = ["// The functions of a scene of raymarch. Set the variables; they have the values of the scene initially."]
    given = with_hoisted(made.hoisted, values).params
    inputs = {name: (leaf.type, given[leaf.data.name]) for name, leaf in text.uniforms.items()}
    inputs |= {TIME: (FLOAT, values.time)} if text.uses_time else {}
    for name, (type, value) in inputs.items():
        lines.append(f"var<private> {name}: {type_text(type)} = {Wgsl().constant(const(value))};")
    states = {v.data for f in text.names for v in free_variables([f.body]) if v not in f.params}
    for name in sorted(name for name in states if not name.startswith("u_sky_light")):
        meaning, first = STATE[name]
        lines.append(f"var<private> {name}: f32 = {first};  // {meaning}")
    if made.sky_light:
        colors = ", ".join(Wgsl().constant(const(row)) for row in harmonics(made))
        lines.append(f"const u_sky_light = array<vec3<f32>, 9>({colors});")
    for type in _structs([e.type for f in text.names for e in (*f.params, f.body)]):
        lines += [f"struct {type.name} {{", *(f"    {name}: {type_text(of)}," for name, of in type.fields), "}"]
    lines += ["", *(line.text for line in text.lines())]
    hoisted = {name: leaf.data.name for name, leaf in text.uniforms.items() if leaf.data.name in made.hoisted}
    if hoisted:
        lines += ["", "// Call this when a variable has changed, before other functions.", "fn set_frame() {"]
        lines += [*(f"    {name} = {of.replace(' ', '_')}();" for name, of in hoisted.items()), "}"]
    return Text("\n".join(lines) + "\n")


def _structs(types: list[Type]) -> list[Type]:
    """The structs among some types and their fields, each after those of its fields."""
    found: dict[Type, None] = {}
    for type in types:
        found |= dict.fromkeys(_structs([of for _, of in type.fields]))
        found |= {type: None} if type.fields else {}
    return list(found)
