"""Assemble the fragment shader of a plan: generated code, and only the GLSL modules that it uses.

Each part is a chunk with the names that it needs and gives, which are read from its text. `link` pulls in and orders
the chunks by these names.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from types import MappingProxyType

from raymarch import glsl
from raymarch.errors import Location, PlanError, is_users
from raymarch.expr.atlas import EDGE, Atlas, Place, packed
from raymarch.expr.branches import UNSEEN
from raymarch.expr.faults import COLOR
from raymarch.expr.faults import code as fault_code
from raymarch.expr.function import Function
from raymarch.expr.glsl import TIME, Text, print_functions
from raymarch.expr.hashing import PCG_GLSL
from raymarch.expr.node import Expr
from raymarch.expr.pieces import Line, literal
from raymarch.expr.samples import Samples
from raymarch.expr.tables import Table
from raymarch.expr.texels import Texels
from raymarch.expr.types import Type
from raymarch.expr.walk import direct_calls, find
from raymarch.plan import Pass, Plan
from raymarch.scene.quality import RELAXATION
from raymarch.scene.relief import footprint_axis, shading_normal
from raymarch.scene.scene import all_nodes
from raymarch.sdf.advance import STRETCH
from raymarch.sdf.labels import rows_of
from raymarch.shader import kinds, tally
from raymarch.shader.bounds import marched_range, scene_box, scene_cone
from raymarch.shader.chunk import Chunk, Mapped, Values
from raymarch.shader.fog import sky_light
from raymarch.shader.light_rows import light_rows
from raymarch.shader.link import link, module
from raymarch.shader.shade import shading
from raymarch.shader.standalone import Setup
from raymarch.shader.surface import with_footprint
from raymarch.shader.trim import trimmed

HEADERS = {
    "330 core": ["#version 330 core"],
    "300 es": [
        "#version 300 es",
        "precision highp float;",
        "precision highp int;",
        "precision highp sampler2D;",
        "precision highp sampler3D;",
    ],
    "": [],  # for a host that adds a header
}

_PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))) + os.sep


@dataclass(frozen=True, slots=True)
class Shader:
    """The fragment shader of a scene.

    body : lines of the text, without version and defines.
    passes : names of its passes; if there are several, the define `PASS` selects one.
    heads : lines that precede the body, for each pass.
    parameters : GLSL name of the uniform of each parameter, by the parameter's name.
    uses_time : True if it has a uniform u_time.
    samples : sampled data and pictures, by the name of their texture.
    modules : the linked GLSL modules with their reasons.
    constants : the names of textures whose data the caller declares as constants.
    """

    body: tuple[Mapped, ...]
    passes: tuple[str, ...]
    heads: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, str]
    uses_time: bool
    samples: Mapping[str, Samples | Texels | Table]
    modules: Mapping[str, str]
    constants: frozenset[str] = frozenset()

    def text(
        self,
        chosen: str | None = None,
        version: str = "330 core",
        declarations: Mapping[str, str] = MappingProxyType({}),
    ) -> str:
        """The whole text of one pass, the first by default, ready to compile.

        version : "330 core", or "300 es" for WebGL 2. declarations : lines that replace those of uniforms, by name.
        """
        lines = [declarations.get(line.uniform.name, line.text) if line.uniform else line.text for line in self.body]
        return "\n".join([*self._head(chosen or self.passes[0], version), *lines]) + "\n"

    @property
    def uniforms(self) -> dict[str, str]:
        """The GLSL type of each uniform, by name."""
        return {line.uniform.name: line.uniform.type for line in self.body if line.uniform}

    def _head(self, chosen: str, version: str) -> list[str]:
        index = self.passes.index(chosen)
        own = list(self.heads[index])
        if len(self.passes) == 1:
            return [*HEADERS[version], *own]
        # Pad to equally many lines, so that line numbers agree between passes.
        own += [""] * (max(1, *(len(head) for head in self.heads)) - len(own))
        return [*HEADERS[version], f"#define PASS {index}", *own]

    def locate(self, line: int, version: str = "330 core") -> tuple[str, Location | None]:
        """Describe the origin of a line of the text, counted from 1, and give the user's line if there is one."""
        index = line - 1 - len(self._head(self.passes[0], version))
        if not 0 <= index < len(self.body):
            return "the shader's header", None
        return self.body[index].made_by, self.body[index].where


def assemble(
    plan: Plan,
    inputs: Mapping[str, str] = MappingProxyType({}),
    constants: frozenset[str] = frozenset(),
    places: Mapping[str, Place] = MappingProxyType({}),
    variant: str = "",
) -> Shader:
    """The shader of a plan.

    inputs : for a standalone plan, GLSL expressions that replace uniforms, by the name of the uniform.
    constants : names of sampled data, tables and `u_lights` that the caller declares as constants, not as textures.
    places : pictures that are parts of an atlas. {} makes atlases if there are more textures than texture units.
    variant : "PART" for a shader that draws parts of a picture, "GRID" for one that draws some pixels of it, with the
        coordinates of the whole picture.
    """
    passes = [p for p in plan.passes if p.effect is None]
    variants = plan.variants | ({variant} if variant else set())
    mains = [module(p.module, variants) for p in passes]
    values = Values()
    shade = shading(plan, values) if any(p.shades for p in passes) else None
    values.variables |= {"ray_kind"} if plan.tells_kinds else set()
    values.variables |= {tally.COUNT} if plan.tallies else set()
    values.variables |= {STRETCH.data} if plan.stretched else set()
    setup = Setup(plan, values, inputs) if plan.standalone else None
    roots = _roots(plan, values)
    structs = _structs(roots)
    names = frozenset([root.name for root in roots])
    fixed = _constants(plan)
    generated: dict[str, Callable[[], Chunk]] = {
        **{name: partial(Chunk.of, name, [line]) for name, line in fixed.items()},
        **dict.fromkeys(names, partial(Chunk, "field", _names(structs) | values.variables, names, ())),
        **({name: lambda: shade for name in shade.gives} if shade is not None else {}),
        **{name: cache(make) for name, make in _of_scene(plan, "u_lights" in constants).items()},
        **{type.name: partial(_declared, type) for type in structs if type.name not in glsl.givers()},
        **(setup.promised() if setup is not None else {}),
    }
    # The names of generated functions must differ from all others, so what is linked is found before they are printed.
    promised = link(mains, plan.choices, generated, variants)
    taken = promised.names.union({"PASS"}, *[chunk.gives for chunk in mains]) - names
    if plan.analytic.used or plan.advance is not None:
        called = frozenset[str]().union(*[part.needs for parts in (mains, *promised.parts.values()) for part in parts])
        if setup is not None:  # `set_frame` calls functions of the camera and of the values of the frame
            called |= {function.name for function in values.functions}
        asked = [root for root in roots if root.name in called]
        inner = {node.data for node in direct_calls([root.body for root in asked])}  # these keep their names too
        roots = [root for root in roots if root in inner or root.name in called]
    fields, parameters, text = _fields(plan, roots, taken, constants, places)
    declared = Chunk.of("constants", [line for name, line in fixed.items() if name in taken])
    generated |= {name: lambda: declared for name in declared.gives} | {root.name: lambda: fields for root in roots}
    if setup is not None:
        generated |= setup.chunks(parameters, text.uses_time, promised.names)
    linked = link(mains, plan.choices, generated, variants)
    body = linked.lines
    too_many = _samplers(body) + max([_samplers(chunk.lines) for chunk in mains]) - TEXTURE_UNITS
    if too_many > 0:
        pictures = [d for d in text.samples.values() if isinstance(d, Texels) and not isinstance(d, Atlas)]
        found = {} if places else packed(pictures, too_many)
        if not found:
            raise _too_many_textures(plan, too_many + TEXTURE_UNITS)
        return assemble(plan, inputs, constants, found, variant)
    body = trimmed([*body, *_main(mains)], frozenset({tally.COUNT}).union(*[chunk.gives for chunk in mains]))
    body = tally.tallied(body) if plan.tallies else body
    unread = {name for name in text.samples if sum(name in line.text for line in body) == 1} - constants
    body = [line for line in body if line.uniform is None or line.uniform.name not in unread]
    samples = {name: of for name, of in text.samples.items() if name not in unread}
    named, heads = tuple([p.name for p in passes]), tuple([p.head for p in passes])
    modules = {p.module: p.reason for p in plan.passes} | linked.reasons
    return Shader(tuple(body), named, heads, parameters, text.uses_time, samples, modules, constants)


def _of_scene(plan: Plan, constant_lights: bool) -> dict[str, Callable[[], Chunk]]:
    """What makes the chunks that the scene's values fill in, by the names that they give."""
    return {
        "scene_box": partial(scene_box, plan),
        "scene_cone": partial(scene_cone, plan),
        "marched_range": partial(marched_range, plan),
        **dict.fromkeys(("u_lights", "light_texel"), partial(light_rows, plan, constant_lights)),
        "u_sky_light": sky_light,
        "pcg": _pcg,
        UNSEEN.data: partial(_unseen, plan),
        **kinds.chunks(),
    }


def assemble_effect(chosen: Pass) -> Shader:
    """The shader of a post effect, which contains nothing of the scene."""
    main = module(chosen.module)
    linked = link([main], {}, {})
    body = tuple(trimmed([*linked.lines, *main.lines]))
    return Shader(body, (chosen.name,), (chosen.head,), {}, False, {}, linked.reasons)


def _main(mains: Sequence[Chunk]) -> list[Mapped]:
    if len(mains) == 1:
        return list(mains[0].lines)
    body: list[Mapped] = []
    for i, chunk in enumerate(mains):
        body += [Mapped(f"#{'el' if i else ''}if PASS == {i}", chunk.name), *chunk.lines]
    return [*body, Mapped("#endif", "passes")]


TEXTURE_UNITS = 16
"""Texture units that every OpenGL 3.3 and WebGL 2 driver has in a fragment shader."""


def _too_many_textures(plan: Plan, read: int) -> PlanError:
    """The error for a pass that reads more textures than every driver supports, also with pictures in atlases."""
    others = [data.label for data in plan.textures if not isinstance(data, Texels)]
    pictures = len(plan.textures) - len(others)
    return PlanError(
        f"the shader reads {read} textures, {len(plan.textures)} of them from the scene: {pictures} pictures"
        + (f", and {', '.join(others)}" if others else ""),
        legal=f"up to {TEXTURE_UNITS} in all, where pictures share atlases of {EDGE} x {EDGE} texels; sampled data and "
        "tables have a texture each",
        where=next((m.where for m in plan.scene.materials if m.textured), plan.scene.where),
    )


def _samplers(lines: Sequence[Mapped]) -> int:
    return sum([line.uniform is not None and line.uniform.type.startswith("sampler") for line in lines])


# Generated chunks


CONE_SHARE = 0.25
"""A cone ends where its safe step is less than this fraction of its radius."""


UNPROVEN = 0.875
"""The part of a step that no sphere proves empty, in epsilons or tenths of a pixel, whichever is longer. No ray passes
a solid on a longer way, so `rm.prove` contradicts no hit within an epsilon."""

LEAP = 0.8, 0.5
"""The same of an estimate, in pixels, for an epsilon of up to 0.1 and a wider one: its spheres prove nothing."""


def _leap(plan: Plan) -> float:
    if plan.certified:
        return UNPROVEN * max(plan.epsilon, 0.1)
    return LEAP[plan.epsilon > 0.1]


def _constants(plan: Plan) -> dict[str, Mapped]:
    """The declarations of the constants of Quality that modules may read, by name."""
    quality = plan.scene.quality
    steps = str(quality.max_steps)
    varied = quality.temporal != "off" and any(p.often == "sample" for p in plan.passes)
    by, values = (
        "Quality(...)",
        {
            "max_steps": ("int", steps),
            "shadow_steps": ("int", str(quality.shadow_steps or quality.secondary_steps)),
            "secondary_steps": ("int", str(quality.secondary_steps)),
            "march_steps": ("int", "" if plan.marching.cones or plan.marching.resumed else str(quality.camera_steps)),
            "rising_steps": ("int", str(quality.rising_steps)),
            "epsilon_pixels": ("float", literal(plan.epsilon)),
            "contact_share": ("float", literal(plan.contact_share)),
            "leap_pixels": ("float", literal(_leap(plan))),
            "path_extent": ("float", literal(plan.scene.path_extent)),
            "cone_share": ("float", literal(CONE_SHARE)),
            "step_scale": ("float", literal(quality.step_scale)),
            "step_variation": ("float", literal(quality.step_variation)),
            "relaxation": ("float", literal(quality.omega or RELAXATION.get(plan.marching.tracer, 1.0))),
            "relax_again": ("bool", "true" if plan.marching.tracer == "relaxed_again" else "false"),
            "picture_samples": ("int", str(quality.samples)),
            "smoothing": ("float", literal(quality.beta)),
            "footprint_pixels": ("float", "" if varied else literal(quality.footprint)),
            "color_fault": ("float", literal(fault_code(COLOR, 0))),
            "surface_texels": ("int", str(max(p.textures for p in plan.passes))),
        },
    )
    return {
        name: Mapped(f"const {kind} {name} = {value};", by) if value else Mapped.declare(kind, name, by)
        for name, (kind, value) in values.items()
    }


def _unseen(plan: Plan) -> Chunk:
    """The number that is 0, of which compilers must not know it. A standalone shader has no uniform for it."""
    by, name = "a choice between parts", str(UNSEEN.data)
    if not plan.standalone:
        return Chunk.of(name, [Mapped.declare("float", name, by)])
    line = Mapped(f"#define {name} min(u_resolution.x, 0.0)", by)
    return Chunk(name, frozenset({"u_resolution"}), frozenset({name}), (line,))


def _pcg() -> Chunk:
    """The hash of the expression language, for its own helpers and for modules."""
    lines = tuple(Mapped(line, "a helper function of the expression language") for line in PCG_GLSL.split("\n"))
    return Chunk.of("pcg", lines)


def expression_functions(plan: Plan) -> list[Function]:
    """The functions of expressions of a plan: field, gradient, materials, lights, BSDFs, sky, fog and tone curve."""
    values = Values()
    if any(p.shades for p in plan.passes):
        shading(plan, values)
    if plan.standalone:
        Setup(plan, values, {})
    return _roots(plan, values)


def _roots(plan: Plan, values: Values) -> list[Function]:
    """The functions of expressions that modules and generated code call. A standalone shader computes all values."""
    optional = (
        *(
            plan.advance,
            plan.shadow_advance,
            plan.own_step,
            plan.gradient,
            plan.material,
            plan.relief,
            plan.emission,
            plan.glass,
            plan.material_index,
        ),
        *(plan.analytic.hit, plan.analytic.rest, plan.analytic.solved_distance),
    )
    bent = plan.relief is not None
    mapped = (footprint_axis,) * (bent or with_footprint(plan)) + (shading_normal,) * bent
    found = [plan.field, *mapped, *(f for f in optional if f is not None), *values.functions, *plan.further]
    return found if plan.standalone else [plan.hoist(function) for function in found]


def _structs(roots: Sequence[Function]) -> frozenset[Type]:
    """The structs that functions take or return, with those of their fields, and those that such functions call for."""
    functions = [root for root in roots if root.body.type.fields]
    for function in functions:  # grows
        calls = dict.fromkeys(node.data for node in direct_calls([function.body]) if node.type.fields)
        functions += [called for called in calls if called not in functions]
    pending = [value.type for function in (*roots, *functions) for value in (function.body, *function.params)]
    found: set[Type] = set()
    while pending:
        type = pending.pop()
        if type.fields and type not in found:
            found.add(type)
            pending += [inner for _, inner in type.fields]
    return frozenset(found)


def _names(structs: Iterable[Type]) -> frozenset[str]:
    return frozenset([type.name for type in structs])


@lru_cache(64)
def _declared(type: Type) -> Chunk:
    lines = [f"struct {type.name} {{", *[f"    {inner.name} {name};" for name, inner in type.fields], "};"]
    return Chunk.of(f"struct {type.name}", [Mapped(line, f"struct {type.name}") for line in lines])


def _fields(
    plan: Plan, roots: Sequence[Function], taken: frozenset[str], constants: frozenset[str], places: Mapping[str, Place]
) -> tuple[Chunk, dict[str, str], Text]:
    """All functions generated from expressions, printed together so that each definition appears once."""
    branches = plan.device.branches
    text = print_functions(
        roots, taken, plan.standalone, constants, places=places, branches=branches, rolls=plan.device.rolls
    )
    if text.helpers.pop(("pcg", ""), None):  # a chunk of its own, because modules may need it too
        text.needs.add("pcg")
    parameters = {leaf.data.name: name for name, leaf in text.uniforms.items()}
    uniforms = text.uniforms.items()
    lines = [Mapped.declare(leaf.type.name, name, "a Param", leaf.data.where) for name, leaf in uniforms]
    lines += [Mapped.declare("float", TIME, "time")] * text.uses_time
    lines += [Mapped.declare(f"sampler{of.dimension}D", name, "sampled data") for name, of in text.samples.items()]
    if lines:
        lines.append(Mapped("", "parameters"))
    lines += _mapped(text, _Places(plan))
    gives = frozenset([root.name for root in roots])
    needs = _names(_structs(roots)) | text.needs | ({tally.COUNT} if plan.tallies else set())
    return Chunk("field", needs, gives, tuple(lines)), parameters, text


class _Places:
    """The user's line of each part of the field.

    An expression belongs to the line of the node that it was lowered from. A definition's function is shared by all
    nodes that use it, and belongs to the line of the first.
    """

    def __init__(self, plan: Plan) -> None:
        self.origins: Mapping[Expr, Location] = plan.origins
        self._scene = plan.scene.where
        self._gradients = {  # a gradient calls the companions of the field's functions, with the same arguments
            (e.data.known_gradient(), e.args): where for e, where in plan.origins.items() if e.op == "call"
        }
        self._first_use: dict[Location | None, Location | None] = {}
        placed = [node for node in all_nodes(plan.scene.node) if node.where is not None]
        for node in sorted(placed, key=lambda node: (node.where.file, node.where.line)):  # type: ignore[union-attr]
            definition = node.definition
            if definition.where not in self._first_use:
                self._first_use[definition.where] = node.where
                if rows_of(node) is not None:  # the shader asks rows through cells
                    continue
                operands = min(len(node.children), 2)  # further ones call the same functions
                for call in find([definition.template(operands, node.params).body], "call"):
                    self._first_use.setdefault(call.data.where, node.where)

    def of(self, source: Expr) -> Location | None:
        """The user's line of an expression in the field or its gradient."""
        found = self.origins.get(source)
        return self._gradients.get((source.data, source.args)) if found is None and source.op == "call" else found

    def around(self, owner: Function) -> Location | None:
        """The user's line of a whole function."""
        where = owner.where if isinstance(owner, Function) else None
        if where in self._first_use:
            return self._first_use[where]
        return where if where is not None and is_users(where.file) else self._scene


def _mapped(text: Text, places: _Places) -> list[Mapped]:
    """The printed functions, each line with its origin."""
    lines: list[Mapped] = []
    owners = {name: owner for owner, name in text.names.items()}
    given = {f.name: f.where for f in (node.data for node in find([owner.body for owner in owners.values()], "raw"))}
    for (helper, kind), code in text.helpers.items():
        if kind == "raw":
            by, where = f"of the GLSL of {helper}", given.get(helper)
            rows = enumerate(code.split("\n"), 1)
            lines += [Mapped(line, f"line {i} {by}", where, given=True) for i, line in rows]
            lines.append(Mapped("", helper))
        else:
            lines += [Mapped(line, "a helper function of the expression language") for line in [*code.split("\n"), ""]]
    for printed in text.functions:
        name = printed[0].text.partition("(")[0].split()[-1]
        around = places.around(owners[name])
        head, *rest = [_mapped_line(line, name, around, places) for line in printed]
        lines += [replace(head, tallied=name in tally.EVALUATIONS), *rest]
        lines.append(Mapped("", name, around))
    return lines[:-1]


def _mapped_line(line: Line, name: str, around: Location | None, places: _Places) -> Mapped:
    source = line.source
    if source is None or source.where is None or source.op == "const":
        return Mapped(line.text, name, around)
    place = places.of(source)
    if place is not None:
        return Mapped(line.text, f"{source.data.name if source.op == 'call' else source.op} in {name}", place)
    # Equal expressions are shared, so this one may have been written first in another scene.
    written = source.where
    if is_users(written.file):
        return Mapped(line.text, f"{name}, {written}", around or written)
    short = written.file.removeprefix(_PACKAGE).replace(os.sep, "/")
    return Mapped(line.text, f"{name}, {short}:{written.line}", around)
