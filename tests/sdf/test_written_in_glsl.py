"""Fields written in GLSL: the facts that they promise, their twin, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.sdf import glsl_node, sphere
from tests.support.glsl_harness import run
from tests.support.refusals import refused

BALL = """
const float R = 1.0;
float my_length(vec3 p) { return sqrt(dot(p, p)); }
float ball(vec3 p) {
    return my_length(p) - R;
}"""
POINTS = np.random.default_rng(8).uniform(-2, 2, (2000, 3))


def facts(**other: Any) -> dict[str, Any]:
    return {"exactness": "exact", "bounds": ((-1, -1, -1), (1, 1, 1)), **other}


def ball(**other: Any) -> rm.Node:
    return glsl_node(BALL, "ball", **facts(**other))


def twin(points: Any) -> Any:
    return np.linalg.norm(points, axis=1) - 1.0


def test_it_is_a_node_like_any_other(egl: Context) -> None:
    node = (ball(twin=twin).translate((0.3, 0, 0)) | sphere(0.4)).repeat(4.0, 2)
    same = (sphere(1.0).translate((0.3, 0, 0)) | sphere(0.4)).repeat(4.0, 2)
    np.testing.assert_allclose(node.distance(POINTS), same.distance(POINTS), atol=1e-12)
    np.testing.assert_allclose(run(egl, node.glsl(), "field({0})", [(VEC3, POINTS)]), same.distance(POINTS), atol=2e-6)
    assert node.exactness == same.exactness
    np.testing.assert_array_equal(node.bounds, same.bounds)


def test_without_a_twin_it_is_drawn_and_not_computed() -> None:
    node = ball()
    # Rays that pass within an epsilon of the surface may hit anywhere there: no start of the march is known without
    # the twin, and the steps differ. Two rays pass the ball by .05 to .1 pixels. Of GLSL nothing is known along a ray,
    # so both are marched by the tracer that needs the distance alone.
    quality = rm.Quality(epsilon=0.02, tracer="bracketing")
    with rm.Renderer((32, 24)) as renderer:
        camera = rm.Camera((1.4, 1.3, 2.8), (0, 0, 0))
        frame = renderer.render(rm.Scene(node, camera, quality=quality))
        plain = renderer.render(rm.Scene(sphere(), camera, quality=quality))
    np.testing.assert_allclose(frame.color, plain.color, atol=2e-5)
    with pytest.raises(SceneError, match="twin"):
        node.distance(POINTS)
    with pytest.raises(SceneError, match="twin"):
        rm.truth(rm.Scene(node), size=(4, 4))


def test_a_steep_field_is_divided() -> None:
    node = glsl_node("float steep(vec3 p) { return 3.0 * p.y; }", "steep", "bound", 3.0, twin=lambda p: 3.0 * p[:, 1])
    np.testing.assert_allclose(node.distance(POINTS), POINTS[:, 1], atol=1e-12)


def test_a_fault_in_the_code_leads_to_its_line(egl: Context) -> None:
    node = glsl_node("float f(vec3 p) {\n    return foo + p.x;\n}", "f", bounds=((-1, -1, -1), (1, 1, 1)))
    with pytest.raises(rm.ShaderError, match="made by line 2 of the GLSL of f") as caught:
        rm.render(rm.Scene(sphere(0.5) | node), (8, 6))
    assert caught.value.where is not None and caught.value.where.file == __file__
    assert caught.value.where.line == test_a_fault_in_the_code_leads_to_its_line.__code__.co_firstlineno + 1


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: glsl_node("float f(vec2 p) { return 1.0; }", "f"), "float f(vec3 p)"),
        (lambda: glsl_node("// float f(vec3 p) {}", "f"), "float f(vec3 p)"),
        (lambda: glsl_node(BALL + "void main() {}", "ball"), "functions only"),
        (lambda: glsl_node(BALL + "}", "ball"), "functions only"),
        (lambda: glsl_node(BALL, "float"), "a name that is free"),
        (lambda: glsl_node(BALL, "ball", **facts(exactness="good")), "'exact', 'bound' or 'estimate'"),
        (lambda: glsl_node(BALL, "ball", **facts(lipschitz=0.0)), "a number > 0"),
        (lambda: glsl_node(BALL, "ball", **facts(bounds=((1, 1, 1), (0, 0, 0)))), "lower < upper"),
        (lambda: glsl_node(BALL, "ball", **facts(twin=3)), "a function"),
        (lambda: ball(twin=lambda p: p).distance(POINTS), "gives shape (2000, 3)"),
        (lambda: (ball() | glsl_node("float ball(vec3 p) { return p.x; }", "ball")).glsl(), "another name"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, says: str) -> None:
    refused(make, says)


@pytest.mark.parametrize(
    "declared",
    [
        "float sky;",
        "float one, sky;",
        "const float ONE = 1.0, sky = 2.0;",
        "struct sky { float a; };",
        "float\n sky = 1.0;",
    ],
)
def test_a_name_of_the_shader_is_refused_however_it_is_declared(declared: str) -> None:
    made = glsl_node(f"{declared}\nfloat ball(vec3 p) {{ return length(p) - 1.0; }}", "ball", "exact")
    with pytest.raises(SceneError, match="the GLSL name sky is used by the shader"):
        rm.render(rm.Scene(made, sky=rm.GradientSky()), size=(2, 2))


def test_names_of_parameters_and_of_inner_variables_are_free() -> None:
    code = "float ball(\n  vec3 sky,\n  float trace\n) { float shade, march; return length(sky) - trace; }\n"
    code += "#define BALL(x) \\\n  ball(x, 1.0)\nfloat body(vec3 p) { return BALL(p); }"
    made = glsl_node(code, "body", "exact", bounds=((-1, -1, -1), (1, 1, 1)))
    rm.render(rm.Scene(made, sky=rm.GradientSky()), size=(16, 12))
