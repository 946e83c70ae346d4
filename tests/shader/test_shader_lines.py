"""Each line of a shader knows what made it; what the driver refuses is traced to the user's own line."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

import raymarch as rm
from raymarch import glsl
from raymarch.errors import Location, ShaderError
from raymarch.expr import glsl as printer
from raymarch.expr import vocabulary as v
from raymarch.plan import plan
from raymarch.shader import assemble
from tests.support.shader_samples import PASSES, assembled, passes_of, scenes

SCENES = scenes()


@pytest.mark.parametrize(("name", "passes"), [(name, passes) for name in SCENES for passes in passes_of(name)])
def test_every_line_says_what_made_it(name: str, passes: tuple[str, ...]) -> None:
    shader = assembled(name, passes)
    for version in ("330 core", "300 es"):
        lines = shader.text(version=version).splitlines()
        head = len(lines) - len(shader.body)
        for number, line in enumerate(lines, 1):
            made_by, where = shader.locate(number, version)
            assert made_by
            if number > head:
                assert (line, made_by, where) == (shader.body[number - head - 1].text, made_by, where)
            else:
                assert (made_by, where) == ("the shader's header", None)
        assert shader.locate(len(lines) + 1, version)[1] is None and shader.locate(0, version)[1] is None


def test_a_line_of_a_module_is_the_line_of_its_file() -> None:
    shader = assemble(plan(SCENES["shadows"]))
    for number, line in enumerate(shader.text().splitlines(), 1):
        made_by, _ = shader.locate(number)
        if made_by.startswith("line "):
            _, count, _, file = made_by.split()
            module = printer.__file__.removesuffix("expr/glsl.py") + file.removeprefix("raymarch/")
            with open(module, encoding="utf-8") as source:
                written = source.read().splitlines()[int(count) - 1].replace("PIXEL", glsl.PIXEL)
            words = iter(glsl.placed_words(written)[0])  # what is never read is left out, and nothing is put in
            assert line == written or all(word in words for word in glsl.placed_words(line)[0])


def test_every_line_of_the_field_has_a_place_of_the_users() -> None:
    shader = assemble(plan(SCENES["everything"], PASSES[2]))
    lines = shader.text().splitlines()
    first = next(i for i, line in enumerate(lines, 1) if line.startswith("float field(vec3 p)"))
    last = next(i for i, line in enumerate(lines[first:], first + 1) if line == "}")
    for number in range(first, last + 1):
        where = shader.locate(number)[1]
        assert where is not None and where.file.endswith("shader_samples.py"), lines[number - 1]


def test_each_call_in_the_gradient_has_the_line_of_its_node() -> None:
    nodes = [
        rm.sphere(0.125),
        rm.sphere(0.25).translate((1, 0, 0)),
        rm.sphere(0.5).rotate(0.5, "z"),
    ]
    shader = assemble(plan(rm.Scene(rm.union(*nodes, k=0.0625)), ("geometry",)))
    calls = [i for i, line in enumerate(shader.text().splitlines(), 1) if "= sphere_gradient(" in line]
    assert [shader.locate(i)[1] for i in calls] == [node.where for node in nodes]


def test_the_sky_has_the_line_of_its_own_scene_not_of_an_equal_one() -> None:
    first = rm.Scene(rm.sphere())
    shaders = [assemble(plan(first))]
    second = rm.Scene(rm.sphere(0.5))
    shaders.append(assemble(plan(second)))
    for scene, shader in zip((first, second), shaders, strict=True):
        assert {line.where for line in shader.body if line.text.startswith("vec3 sky(")} == {scene.where}


# Planted errors: the text of one function is spoilt, and the driver must complain about the node that made it.


@rm.shape(exactness="exact", bounds=lambda radius: ((-radius,) * 3, (radius,) * 3))
def lump(p: Any, radius: float = 0.5) -> Any:
    corner = v.vec2(v.length(p.xz), p.y)
    return v.length(corner) - radius


@rm.operator(bounds=lambda child: (child.lower - 0.2, child.upper + 0.2))
def wobbled(p: Any, child: Any) -> Any:
    return child(p + 0.1 * v.sin(v.vec3(p.y, p.z, p.x))) * 0.5


def spoil(monkeypatch: pytest.MonkeyPatch, function: str, op: str | None = None) -> None:
    """Let every operation (or one) that is printed in a function call something that does not exist."""

    def broken(template: Callable[..., Any]) -> Callable[..., Any]:
        def run(made: Any, node: Any, pieces: Any) -> Any:
            piece = template(made, node, pieces)
            if made.text.names[made.definition] != function:
                return piece
            return printer.Piece(f"no_such_function({piece.text})", printer.ATOM, piece.depth)

        return run

    for name in printer.TEMPLATES if op is None else [op]:
        monkeypatch.setitem(printer.TEMPLATES, name, broken(printer.TEMPLATES[name]))  # type: ignore[arg-type]


def parts() -> dict[str, rm.Node]:
    """One node of each kind, each on a line of its own."""
    return {
        "sphere": rm.sphere(0.4),
        "box": rm.box((0.5, 0.6, 0.7)),
        "torus": rm.torus(0.5, 0.1),
        "cylinder": rm.cylinder(0.3, 0.6),
        "capsule": rm.capsule((0, 0, 0), (0, 0.5, 0), 0.2),
        "plane": rm.plane((0, 1, 0), -1),
        "lump": lump(0.3),
    }


def refusal(renderer: rm.Renderer, scene: rm.Scene, output: str = "color") -> ShaderError:
    renderer._prepared.clear()  # a scene is planned once, but here its text was spoilt anew
    with pytest.raises(ShaderError) as caught:
        renderer.render(scene, outputs=(output,))
    assert "no_such_function" in str(caught.value) and "line " in str(caught.value)
    return caught.value


@pytest.mark.parametrize("suffix", ["", "_gradient"])
@pytest.mark.parametrize("name", parts())
def test_an_error_in_a_shape_names_the_node(
    name: str, suffix: str, renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoil(monkeypatch, name + suffix)
    nodes = parts()
    scene = rm.Scene(rm.union(*nodes.values()))
    fault = refusal(renderer, scene)
    assert fault.where == nodes[name].where, fault
    start = inspect.getsourcelines(parts)[1]
    assert fault.where == Location(__file__, start + 3 + list(nodes).index(name))
    assert f"made by {name}{suffix}" in str(fault) and "pass color" in str(fault)


def test_an_error_names_the_node_wherever_it_stands(renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two equal kinds in the field itself, the one that made the line; of a function for both, the first."""
    first = rm.sphere(0.4).translate((1, 0, 0))
    second = rm.sphere(0.5).rotate(0.5, "x").scale((1, 2, 3))
    third = wobbled(rm.box((0.5, 0.6, 0.7)))
    whole = rm.Scene(first | second | third, quality=rm.Quality(analytic=False))
    for op, node in (("sin", third), ("matmul", second.children[0])):
        with monkeypatch.context() as patch:
            spoil(patch, "field", op)
            fault = refusal(renderer, whole.replace())  # a new scene: a renderer keeps the text of a known one
            assert fault.where == node.where, (op, str(fault))
    with monkeypatch.context() as patch:
        spoil(patch, "sphere")
        assert refusal(renderer, whole.replace()).where == first.where


@pytest.mark.parametrize(("function", "tracer"), [("lump", "bracketing"), ("lump_along", "advance")])
def test_an_error_in_a_users_definition_names_the_expression_too(
    function: str, tracer: str, renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoil(monkeypatch, function)
    node = lump(0.3)
    fault = refusal(renderer, rm.Scene(rm.sphere(0.2) | node, quality=rm.Quality(tracer=tracer)))
    # What is derived for the advance is shared with equal expressions, whose line is that of the first.
    line = f"{__file__}:" if tracer == "bracketing" else ""
    assert fault.where == node.where and f"made by {function}, {line}" in str(fault)


@pytest.mark.parametrize("helper", ["smooth_min", "rotate_field"])
def test_an_error_in_a_helper_names_a_node_that_uses_it(
    helper: str, renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoil(monkeypatch, helper)
    turned = (rm.box((0.5, 0.6, 0.7)) | rm.sphere(0.4)).rotate(0.3, "z")
    copies = turned.repeat((2, None, None), 3)
    blend = rm.union(rm.sphere(0.4), copies, k=0.2)
    fault = refusal(renderer, rm.Scene(rm.plane() | blend))
    assert fault.where == (blend if helper == "smooth_min" else turned).where, fault


def test_an_error_beyond_the_field_names_the_scene_or_the_light(
    renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    red = rm.sphere(rm.Param("r", 0.5, 0.1, 1)).material(rm.Material((1, 0, 0)))
    lamp = rm.PointLight((0, 2 * rm.Param("y", 1.0, 0, 2), 0))
    for function, output, where in (
        ("part_at", "color", None),
        ("material_index", "depth", None),
        ("light_1_position", "color", lamp.where),
    ):
        scene = rm.Scene(red | rm.plane(), lights=[rm.Sun(), lamp])
        with monkeypatch.context() as patch:
            spoil(patch, function)
            assert refusal(renderer, scene, output).where == (where or scene.where), function


def test_a_refused_shader_leaves_the_renderer_usable(renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = rm.Scene(rm.sphere())
    before = renderer.render(scene).color
    with monkeypatch.context() as patch:
        spoil(patch, "torus")
        refusal(renderer, rm.Scene(rm.torus()))
    assert (renderer.render(scene).color == before).all()
    renderer.render(rm.Scene(rm.torus()))
