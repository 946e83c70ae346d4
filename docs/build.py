"""Build the pages generated from the code: docs/nodes.md, parts.md, api.md, proofs.md and the pictures of all nodes.

python docs/build.py            # everything
python docs/build.py --text     # the text only, without rendering
python docs/build.py torus      # the text, the sheet of all pictures, and the pictures of some nodes
"""

from __future__ import annotations

import inspect
import re
import runpy
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import raymarch as rm
import raymarch.sdf
from raymarch.errors import RaymarchError
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import sin, vec3
from raymarch.scene.light import Light
from raymarch.sdf.definition import REGISTRY, Definition
from raymarch.sdf.node import Node

HERE = Path(__file__).parent
SIZE = (200, 150)
SAMPLES = 16
COLUMNS = 7
HEADING, CAPTION = 34, 22
"""Heights of a heading and of a caption of the sheet, in pixels."""
PAINT = rm.Material(color=(0.8, 0.36, 0.13), specular=0.12, shininess=40, ambient=0.3)
SECOND = rm.Material(color=(0.13, 0.35, 0.6), specular=0.12, shininess=40, ambient=0.3)
"""Material of the second operand."""
SKY = (0.93, 0.94, 0.96)
LIGHTS = [
    rm.Sun((0.5, 1.3, 0.8), intensity=0.95, shadow=True),
    rm.Sun((-1.2, 0.3, 0.5), (0.65, 0.75, 1.0), 0.22),
    rm.Sun((0.2, -1.0, -0.3), (1.0, 0.9, 0.8), 0.08),
]
VIEW = np.array([0.55, 0.5, 1.0])
"""Direction from a node to the camera."""

SECTIONS = {
    "Solids": ("solids", "boxes", "rounds", "ball_parts", "polyhedra", "rounded_hulls"),
    "Flat shapes": ("flat", "flat_curves", "outlines", "lettering"),
    "Solids from flat shapes": ("profiles",),
    "Curves": ("curves",),
    "Fractals and periodic surfaces": ("fractals", "folds", "periodic"),
    "Functions, data and GLSL": ("implicit", "sampled", "heights", "meshes", "raw"),
    "Unions, intersections, differences": ("booleans", "joints"),
    "Place, size and material": ("placing", "affine", "visibility"),
    "Copies": ("repetition", "copies", "cells", "instancing"),
    "Deformations": ("offsets", "deform", "noise", "warps"),
}
"""The sections of the page, and the modules of `raymarch.sdf` whose nodes they show."""


def brick() -> Node:
    return rm.box((1.4, 0.9, 1.1))


def pair() -> tuple[Node, Node]:
    ball = rm.sphere(0.6).translate((0.4, 0.3, 0.1)).material(SECOND)
    return rm.box((1.2, 0.8, 1.0)).translate((-0.3, -0.2, 0)).material(PAINT), ball


def tile(index: Expr) -> Node:
    """A cell with its own height and colour."""
    height = 0.2 + 0.9 * rm.hash(index)
    color = vec3(0.2 + 0.7 * rm.hash(index + vec3(7.0, 0.0, 0.0)), 0.5, 0.8 - 0.6 * rm.hash(index))
    return rm.box((0.4, height, 0.4)).round(0.03).material(rm.Material(color=color, shininess=60))


def tangle(p: Expr) -> Expr:
    """The tangle cube."""
    return p.x**4 + p.y**4 + p.z**4 - 5 * rm.dot(p, p) + 11.8


SPECIMENS: dict[str, Callable[[], Node]] = {
    "hard_union": lambda: rm.union(*pair()),
    "hard_intersection": lambda: rm.intersection(*pair()),
    "hard_difference": lambda: rm.difference(*pair()),
    "smooth_union": lambda: rm.union(*pair(), k=0.5),
    "smooth_intersection": lambda: rm.intersection(*pair(), k=0.3),
    "smooth_difference": lambda: rm.difference(*pair(), k=0.3),
    "translate": lambda: brick().translate((1.3, 0.8, 0)).material(PAINT) | brick().material(SECOND),
    "rotate_about": lambda: brick().rotate(0.6, (0, 0, 1)),
    "scale_evenly": lambda: brick().scale(0.5).material(PAINT) | brick().translate((1.6, 0, -0.6)).material(SECOND),
    "scale_axes": lambda: rm.sphere().scale((1.3, 0.5, 0.8)),
    "linear_map": lambda: brick().transform(
        [[1, 0.7 * sin(rm.time + 1), 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    ),
    "affine": lambda: brick().transform([[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
    "mirror_across": lambda: rm.capsule((0.2, -0.5, 0), (1, 0.6, 0.2), 0.25).mirror("x"),
    "labelled": lambda: brick().material(rm.Material(color=(0.2, 0.5, 0.8))),
    "repeat_cells": lambda: rm.box(0.5).round(0.05).repeat(0.8, 3),
    "smooth_union stairs": lambda: rm.union(*pair(), k=0.5, blend="stairs"),
    "smooth_intersection chamfer": lambda: rm.intersection(*pair(), k=0.3, blend="chamfer"),
    "smooth_difference columns": lambda: rm.difference(*pair(), k=0.3, blend="columns"),
    "pipe_along": lambda: rm.pipe(*pair(), 0.1) | pair()[0],
    "engraved": lambda: rm.engrave(*pair(), 0.1),
    "grooved": lambda: rm.groove(*pair(), 0.15, 0.12),
    "tongued": lambda: rm.tongue(*pair(), 0.1, 0.12),
    "exclusive": lambda: (pair()[0] ^ pair()[1]) - rm.box((2, 2, 1)).translate((0, 0, 0.8)),
    "between": lambda: rm.morph(rm.box((1.2, 1.2, 1.2)), rm.sphere(0.9), 0.5),
    "complement": lambda: rm.sphere(1.3).complement() & rm.box(2),
    "twist_about_y": lambda: rm.box((0.8, 2, 0.8)).twist(1.2),
    "bend_about_z": lambda: rm.box((2.4, 0.3, 0.5)).bend(0.7),
    "taper_along_y": lambda: rm.box((0.9, 1.6, 0.9)).taper(-0.6),
    "polar_sectors": lambda: rm.capsule((0.5, 0, 0), (1.1, 0.3, 0), 0.14).polar(7),
    "varied_cells": lambda: rm.repeat_varied(tile, (0.6, None, 0.6), (4, 1, 4)),
    "oriented": lambda: rm.box((0.4, 1.6, 0.4)).orient((1, 1, 0.5)),
    "sheared": lambda: brick().shear(0.6),
    "warped": lambda: rm.box((2.2, 0.7, 0.9)).warp(lambda p: rm.vec3(0.0, 0.35 * rm.sin(3.0 * p.x), 0.0)),
    "wrapped": lambda: rm.box((0.3, 0.6, 0.2)).repeat((0.5, None, None), 12).wrap_around(-3, 3),
    "transition_between": lambda: rm.box((1.0, 2.2, 1.0)).transition(rm.cylinder(0.35, 2.2), (0, -0.8, 0), (0, 0.8, 0)),
    "noisy": lambda: rm.sphere().displace_by_noise(0.15, 3.0, 4),
    "displaced": lambda: rm.sphere().displace_by(lambda p: 0.06 * sin(14.0 * p.y + 3.0 * p.x)),
    "turn": lambda: rm.cross().rotate(0.5),
    "loft": lambda: rm.star().extrude_to(rm.circle(0.5), 1.4),
    "slice": lambda: rm.torus(0.7, 0.35).rotate(1.2, "x").slice(0.1),
    "death_star": lambda: rm.death_star().rotate(0.7, "x"),
    "implicit_solid": lambda: rm.implicit(tangle, 2.6),
    "round": lambda: brick().round(0.25),
    "polygon": lambda: rm.polygon(((-0.9, -0.7), (0.8, -0.5), (0.9, 0.6), (0.1, 0.0), (-0.6, 0.8))),
    "closed_outline": lambda: (
        rm.sketch((-0.8, -0.7))
        .line_to((0.5, -0.7))
        .arc_through((0.9, -0.2), (0.5, 0.3))
        .spline_to([(0.1, 0.5), (-0.2, 0.8), (-0.8, 0.6)])
        .fillet(0.15)
        .hole(rm.sketch((0.2, -0.2)).arc_to((0.7, -0.2), 0.25).arc_to((0.2, -0.2), 0.25))
        .close()
    ),
    "polyline": lambda: rm.polyline(((-0.9, -0.5), (-0.3, 0.6), (0.2, -0.3), (0.9, 0.4))),
    "polyline_tube": lambda: rm.polyline_tube(
        ((-0.8, -0.6, 0.3), (-0.3, 0.5, -0.3), (0.2, -0.3, -0.2), (0.8, 0.5, 0.4))
    ),
    "flat_triangle": lambda: rm.flat_triangle((-0.8, -0.6), (0.9, -0.4), (0.1, 0.8)),
    "triangle": lambda: rm.triangle((-0.9, -0.7, 0.2), (0.9, -0.6, -0.1), (0.0, 0.8, 0.1)),
    "quad": lambda: rm.quad((-0.8, -0.6, 0.1), (0.8, -0.6, 0.1), (0.6, 0.7, -0.1), (-0.6, 0.7, -0.1)),
    "stroke": lambda: rm.stroke((-0.7, -0.4), (0.7, 0.5)),
    "line": lambda: rm.line((-0.6, -0.5, -0.2), (0.6, 0.6, 0.3)),
    "bezier": lambda: rm.bezier((-0.8, -0.5), (0.0, 1.2), (0.8, -0.3)),
    "bezier_tube": lambda: rm.bezier_tube((-0.8, -0.5, 0.2), (0.1, 1.1, -0.6), (0.8, -0.4, 0.3)),
    "shell": lambda: brick().shell(0.15) - rm.box(2).translate((0.7, 0.8, 1)),
}
"""A specimen of each operator, by the name of its definition, and further ones, by that name and a word; shapes are
shown with their default parameters."""


def definitions() -> list[Definition]:
    """The definitions of the package, in the order of the page."""
    twins = {d.flat for d in REGISTRY.values()}
    folder = Path(raymarch.sdf.__file__).parent
    own = [d for d in REGISTRY.values() if Path(d.where.file).parent == folder and d.doc and d not in twins]
    order = [module for modules in SECTIONS.values() for module in modules]
    return sorted(own, key=lambda d: (order.index(Path(d.where.file).stem), d.where.line))


def specimens(definition: Definition) -> list[str]:
    """The names of the specimens of a definition."""
    return [definition.name, *(name for name in SPECIMENS if name.startswith(f"{definition.name} "))]


def specimen(definition: Definition, name: str) -> Node | None:
    """An example node of a definition; None if it cannot be made without arguments."""
    try:
        if name in SPECIMENS:
            return SPECIMENS[name]()
        if definition.arity == "none":
            return definition.make((), (), {})
        if definition.arity == "one":
            child = brick() if definition.child_dimension == 3 else REGISTRY["star"].make((), (), {})
            return definition.make((child,), (), {})
        return definition.make(pair(), (), {})
    except RaymarchError:
        return None


def solid(node: Node) -> Node:
    """The node as a bounded solid: flat shapes are extruded, unbounded ones clipped by a box."""
    if node.dimension == 2:
        node = REGISTRY["straight_extrusion"].make((node,), (0.3,), {})
    if not node.facts.bounded:
        node = node & rm.box(2.4)
    return node


def draw(node: Node, renderer: rm.Renderer) -> Image.Image:
    shown = solid(node)
    scene = rm.Scene(
        shown if shown.labelled else shown.material(PAINT),
        camera=rm.Camera.framing(shown, view_from=tuple(VIEW), fov=26, aspect=SIZE[0] / SIZE[1]),
        lights=LIGHTS,
        sky=SKY,
        occlusion=rm.AmbientOcclusion(reach=0.3),
        quality=rm.Quality(samples=SAMPLES),
    )
    return renderer.render(scene).image()


PUBLIC = {
    "sampled_grid": ("grid", "isosurface", "mesh"),
    "raw_field": ("glsl_node",),
    "implicit_solid": ("implicit",),
    "closed_outline": ("sketch",),
}
"""The public functions that make a node, where no function has the name by which the definition is called."""


CAPTIONS = {
    "smooth_union": "union k=0.5",
    "smooth_intersection": "intersection k=0.3",
    "smooth_difference": "difference k=0.3",
    "smooth_union stairs": 'union "stairs"',
    "smooth_intersection chamfer": 'intersection "chamfer"',
    "smooth_difference columns": 'difference "columns"',
    "folded_solid": "fold_fractal of a solid",
    "scale_axes": "scale by axis",
    "turn": "rotate (flat)",
}
"""The captions of nodes that share a name with another."""


def label(definition: Definition, name: str) -> str:
    """The caption of a specimen's picture: the name that a user calls."""
    called = PUBLIC[definition.name][0] if definition.name in PUBLIC else definition.called
    return CAPTIONS.get(name, called)


def calls(definition: Definition) -> list[str]:
    """How a user calls a definition: the signatures of public functions, or of a method of nodes."""
    if definition.name in PUBLIC:
        return [_call(f"rm.{name}", getattr(rm, name)) for name in PUBLIC[definition.name]]
    if not hasattr(rm, definition.called):
        return [_call(f".{definition.called}", getattr(Node, definition.called), skip=1)]
    return [_call(f"rm.{definition.called}", getattr(rm, definition.called))]


def _call(name: str, function: Callable[..., object], skip: int = 0) -> str:
    """The signature of a function without annotations, and without its first parameters."""
    signature = inspect.signature(function)
    shown = [p.replace(annotation=p.empty) for p in list(signature.parameters.values())[skip:]]
    return f"{name}{signature.replace(parameters=shown, return_annotation=signature.empty)}"


def row(definition: Definition, name: str) -> str:
    """One row of the table."""
    node = specimen(definition, name)
    first = definition.doc.splitlines()[0].rstrip(".").replace("|", "\\|")
    facts = "—"
    if node is not None:
        lower, upper = node.bounds
        extent = " × ".join("∞" if not np.isfinite(s) else f"{s:.3g}" for s in upper - lower)
        facts = f"{node.exactness} | {node.facts.divisor:.3g} | {extent}"
    else:
        facts = "— | — | —"
    picture = f"![{label(definition, name)}](pictures/nodes/{file_of(name)})" if node is not None else ""
    call = ", ".join(f"`{text}`" for text in calls(definition))
    return f"| {picture} | {call} | {first} | {facts} |"


def file_of(name: str) -> str:
    """The name of the file of a specimen's picture."""
    return f"{name.replace(' ', '_')}.png"


def page() -> str:
    """The text of docs/nodes.md."""
    text = [
        "# All nodes",
        "",
        "After this page you can choose a shape or an operator by its picture, call and facts. `help(rm.NAME)`",
        "documents one. To find one by its name in other tools, see [names](names.md). A call that starts with a",
        "point is a method of any node: `rm.box(1).twist(rate=1.0)`.",
        "",
        "The facts are those of the node in the picture: its exactness, its divisor, and the extents of its bounding",
        "box, with ∞ where it is unbounded. A field that is steeper than 1 is divided by its Lipschitz constant, the",
        "divisor. [Facts](how-it-is-built.md#facts) defines them. `python docs/build.py` generates this page from",
        "the code.",
        "",
        "![all nodes](pictures/nodes.png)",
    ]
    for title, group in grouped(definitions()):
        text += ["", f"## {title}", ""]
        text += ["| | call | | exactness | divisor | extents |", "|---|---|---|---|---|---|"]
        text += [row(definition, name) for definition in group for name in specimens(definition)]
    return "\n".join(text) + "\n"


def grouped(found: Sequence[Definition]) -> list[tuple[str, list[Definition]]]:
    """Definitions by section of the page."""
    groups = {title: [d for d in found if Path(d.where.file).stem in modules] for title, modules in SECTIONS.items()}
    return list(groups.items())


PARTS = {
    "Camera and quality": (rm.Camera, rm.Quality),
    "Scene": (rm.Scene, rm.Fog, rm.Medium, rm.AmbientOcclusion, rm.ToneMapping, rm.Bloom),
    "Lights": (Light, rm.Sun, rm.PointLight, rm.SpotLight, rm.SphereLight, rm.RectLight),
    "Materials": (rm.Material, rm.planar, rm.triplanar),
    "Skies": (rm.Sky, rm.GradientSky, rm.SunSky, rm.ImageSky),
    "Parameters": (rm.Param,),
}
"""The sections of docs/parts.md, and the classes and functions whose parameters they list."""


def parts_page() -> str:
    """The text of docs/parts.md."""
    text = [
        "# Camera, quality and the other parts of a scene",
        "",
        "After this page you know every parameter of the camera, the quality and the other parts of a scene, with its",
        "default. `help(rm.Camera)` prints the same. [marching](marching.md) and [light](light.md) show examples.",
        "",
        "Lengths are in scene units, colours in linear RGB. Angles are in radians, except `Camera(fov=...)`, which",
        "is in degrees. Numbers and vectors of the camera, lights and materials may be expressions of `rm.Param` and",
        "`rm.time`. Those of `Quality` are constants. `python docs/build.py` generates this page from the code.",
    ]
    for title, parts in PARTS.items():
        text += ["", f"## {title}"]
        for part in parts:
            summary, rows = _parameters(part)
            text += ["", f"### {part.__name__}", "", summary, ""]
            text += ["| parameter | default | meaning |", "|---|---|---|"]
            text += [f"| `{name}` | {default} | {meaning} |" for name, default, meaning in rows]
    return "\n".join(text) + "\n"


def _parameters(part: Callable[..., object]) -> tuple[str, list[tuple[str, str, str]]]:
    """The summary of a docstring, and name, default and meaning of each of its parameters."""
    summary, _, rest = (inspect.getdoc(part) or "").partition("\n\n")
    section = rest.partition("Parameters\n----------\n")[2]
    lines = re.split(r"\n\n?(?=\w+\n-+\n)", section)[0].splitlines()
    entries: list[tuple[str, list[str]]] = []
    for line in lines:
        if line and not line.startswith(" "):
            names, _, first = line.partition(" : ")
            entries.append((names, [first]))
        elif line.strip():
            entries[-1][1].append(line.strip())
    defaults = inspect.signature(part).parameters
    rows = []
    for names, texts in entries:
        meaning = " ".join(f"<br>{line[2:]}" if line.startswith("- ") else line for line in texts).replace("|", "\\|")
        for name in names.split(", "):
            given = defaults[name].default
            shown = "" if given is inspect.Parameter.empty else f"`{given!r}`"
            rows.append((name, shown, meaning[:1].upper() + meaning[1:] if not meaning.startswith("(") else meaning))
    return " ".join(summary.split()), rows


def pictures(names: Collection[str] = ()) -> None:
    """Render a picture of each node, or of some, and a sheet of all of them."""
    folder = HERE / "pictures" / "nodes"
    folder.mkdir(parents=True, exist_ok=True)
    drawn: dict[str, Image.Image] = {}
    with rm.Renderer(SIZE) as renderer:
        for definition, name in ((d, name) for d in definitions() for name in specimens(d)):
            node = specimen(definition, name)
            file = folder / file_of(name)
            if node is None:
                continue
            if not names or definition.name in names or not file.exists():
                paletted(draw(node, renderer)).save(file, optimize=True)
            drawn[name] = Image.open(file).convert("RGB")
    sheet([d for d in definitions() if d.name in drawn], drawn).save(HERE / "pictures" / "nodes.png", optimize=True)


def sheet(shown: Sequence[Definition], drawn: Mapping[str, Image.Image]) -> Image.Image:
    """All pictures with their captions, by section."""
    width, height = SIZE[0], SIZE[1] + CAPTION
    groups = [(title, [(d, name) for d in group for name in specimens(d)]) for title, group in grouped(shown)]
    rows = sum(-(-len(group) // COLUMNS) for _, group in groups)
    made = Image.new("RGB", (COLUMNS * width, rows * height + len(groups) * HEADING), "white")
    pen = ImageDraw.Draw(made)
    heading, caption = ImageFont.load_default(21), ImageFont.load_default(15)
    top = 0
    for title, group in groups:
        pen.text((8, top + 6), title, fill=(30, 36, 48), font=heading)
        top += HEADING
        for i, (definition, name) in enumerate(group):
            x, y = i % COLUMNS * width, top + i // COLUMNS * height
            made.paste(drawn[name], (x, y))
            pen.text((x + 8, y + SIZE[1]), label(definition, name), fill=(30, 36, 48), font=caption)
        top += -(-len(group) // COLUMNS) * height
    return paletted(made)


def paletted(image: Image.Image) -> Image.Image:
    """The picture in 256 colours, without bands."""
    whole = image.convert("RGB")
    return whole.quantize(palette=whole.quantize(256), dither=Image.Dither.FLOYDSTEINBERG)


def main() -> None:
    (HERE / "nodes.md").write_text(page(), encoding="utf-8")
    (HERE / "parts.md").write_text(parts_page(), encoding="utf-8")
    runpy.run_path(str(HERE / "api.py"), run_name="__main__")
    runpy.run_path(str(HERE / "proofs.py"))["main"]()
    if "--text" not in sys.argv:
        pictures(sys.argv[1:])


if __name__ == "__main__":
    main()
