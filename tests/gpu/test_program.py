"""Programs draw what they are told, and what a driver refuses leads back to the line that made it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from raymarch.errors import Location, ShaderError
from raymarch.gpu import program as program_module
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.program import FULL_SCREEN, Message, Program, parse_messages
from raymarch.gpu.targets import PingPong, Target

SCENE_LINE = Location("scene.py", 7)


def locate(line: int) -> tuple[str, Location | None]:
    return f"node {line}", SCENE_LINE


@contextmanager
def drawn(context: Context, body: str, uniforms: dict[str, Any], declarations: str = "") -> Iterator[np.ndarray]:
    source = f"#version 330 core\n{declarations}\nout vec4 color;\nvoid main() {{ {body} }}\n"
    with Program(context, FULL_SCREEN, source, locate, "test") as program, Target(context, (2, 2)) as target:
        program.draw(target, uniforms)
        yield target.read()


@pytest.mark.parametrize(
    ("log", "messages"),
    [
        pytest.param(
            "0:12(5): error: `foo' undeclared\n0:13(1): warning: `x' used uninitialized\n",
            [Message(12, 5, "`foo' undeclared"), Message(13, 1, "`x' used uninitialized", "warning")],
            id="mesa",
        ),
        pytest.param(
            "0:3(2): preprocessor error: #if with no expression",
            [Message(3, 2, "#if with no expression")],
            id="mesa preprocessor",
        ),
        pytest.param(
            '0(12) : error C1008: undefined variable "foo"\n0(14) : warning C7050: "z" might be used before set\n',
            [
                Message(12, None, 'C1008: undefined variable "foo"'),
                Message(14, None, 'C7050: "z" might be used before set', "warning"),
            ],
            id="nvidia",
        ),
        pytest.param(
            "ERROR: 0:12: 'foo' : undeclared identifier\nWARNING: 0:9: '/' : division by zero\n",
            [
                Message(12, None, "'foo' : undeclared identifier"),
                Message(9, None, "'/' : division by zero", "warning"),
            ],
            id="angle",
        ),
        pytest.param(
            "ERROR: 0:12: Use of undeclared identifier 'foo'\r\n",
            [Message(12, None, "Use of undeclared identifier 'foo'")],
            id="apple",
        ),
        pytest.param(
            "Fragment shader failed to compile with the following errors:\n"
            "ERROR: 0:12: error(#143) Undeclared identifier: foo\n"
            "ERROR: error(#273) 1 compilation errors.  No code generated\n",
            [Message(12, None, "error(#143) Undeclared identifier: foo")],
            id="amd",
        ),
        pytest.param("error: vertex shader output `a' declared as type `vec3'", [], id="a linker names no line"),
        pytest.param("", [], id="empty"),
    ],
)
def test_the_log_of_every_driver_is_read(log: str, messages: list[Message]) -> None:
    assert parse_messages(log) == messages


@pytest.mark.parametrize("blank_lines", [0, 2])
def test_a_refused_shader_names_pass_line_node_and_place(context: Context, blank_lines: int) -> None:
    head = "\n" * blank_lines
    source = head + "#version 330 core\nout vec4 color;\nvoid main() {\n    color = vec4(nothing);\n}\n"
    with pytest.raises(ShaderError) as caught:
        Program(context, FULL_SCREEN, source, locate, "shade")
    message = str(caught.value)
    line = 4 + blank_lines  # of the text as given, though moderngl compiles it without its blank head
    assert source.splitlines()[line - 1].strip() == "color = vec4(nothing);"
    assert re.search(rf"pass shade: .*line {line}\b.*node {line}: .*nothing", message)
    assert caught.value.where == SCENE_LINE and message.startswith("scene.py:7: ")


def test_the_first_error_counts_not_a_warning_before_it() -> None:
    from raymarch.gpu.program import _refusal

    log = "GLSL Compiler failed\n\nfragment_shader\n===============\n0(3) : warning C1: w\n0(5) : error C2: e\n"
    error = _refusal("shade", log, "#version 330 core\n", locate)
    assert "node 5" in str(error) and "C2: e" in str(error)


def test_a_refused_vertex_shader_does_not_blame_a_node(context: Context) -> None:
    with pytest.raises(ShaderError, match=r"pass shade: the driver refused the vertex shader: .*nothing") as caught:
        Program(
            context,
            "#version 330 core\nvoid main() { gl_Position = nothing; }",
            "#version 330 core\nvoid main() {}",
            locate,
            "shade",
        )
    assert "node" not in str(caught.value)


def test_a_refused_linking_gives_the_drivers_words(context: Context) -> None:
    fragment = "#version 330 core\nout vec4 color;\nvoid other() { color = vec4(1.0); }\n"
    with pytest.raises(ShaderError, match=r"pass shade: the driver refused linking: .*(main|no program)"):
        Program(context, FULL_SCREEN, fragment, locate, "shade")


def test_uniforms_of_every_type(context: Context) -> None:
    declarations = """
    uniform float f; uniform int i; uniform bool b; uniform vec2 v2; uniform vec3 v3; uniform vec4 v4;
    uniform ivec2 w2; uniform uint u;
    """
    values = {
        "f": 0.5, "i": 3, "b": True, "v2": (1, 2), "v3": np.array([1.0, 2.0, 3.0]), "v4": [1.0, 2.0, 3.0, 4.0],
        "w2": (5, 6), "u": np.uint32(2**31),
    }  # fmt: skip
    body = """color = vec4(f + float(i), b ? dot(v2, vec2(1, 10)) : 0.0,
        dot(v3, vec3(1, 10, 100)) + dot(v4, vec4(1, 1, 1, 1000)),
        float(w2.x * 10 + w2.y) + (u == 2147483648u ? 1000.0 : 0.0));"""
    with drawn(context, body, values, declarations) as picture:
        assert np.all(picture == (3.5, 21.0, 321.0 + 4006.0, 1056.0))


def test_a_matrix_multiplies_as_in_numpy(context: Context) -> None:
    matrix = np.arange(9.0).reshape(3, 3) ** 2
    vector = np.array([1.0, 2.0, 5.0])
    body, declarations = "color = vec4(m * v, n[0][1]);", "uniform mat3 m; uniform vec3 v; uniform mat2 n;"
    with drawn(context, body, {"m": matrix, "v": vector, "n": [[1, 2], [3, 4]]}, declarations) as picture:
        assert picture[0, 0, :3].tolist() == (matrix @ vector).tolist()
        assert picture[0, 0, 3] == 3.0  # GLSL's [column][row]


def test_an_array_of_uniforms(context: Context) -> None:
    values = np.arange(12.0).reshape(3, 4)
    with drawn(context, "color = a[0] + 10.0 * a[1] + 100.0 * a[2];", {"a": values}, "uniform vec4 a[3];") as picture:
        assert np.allclose(picture[0, 0], [1, 10, 100] @ values)


def test_uniforms_that_the_program_lacks_are_passed_over(context: Context) -> None:
    with drawn(
        context, "color = vec4(1.0);", {"dropped": 1.0, "never_declared": "?"}, "uniform float dropped;"
    ) as picture:
        assert np.all(picture == 1.0)


def test_a_program_lists_the_uniforms_the_driver_kept(egl: Context) -> None:
    source = "#version 330 core\nuniform float kept, dropped;\nout vec4 color;\nvoid main() { color = vec4(kept); }\n"
    with Program(egl, FULL_SCREEN, source, locate, "test") as program:
        assert program.uniforms == ("kept",)


@pytest.mark.parametrize(
    ("declaration", "value"),
    [
        ("vec3 u", (1.0, 2.0)),
        ("float u", (1.0, 2.0)),
        ("float u", "1.0"),
        ("int u", 1.5),
        ("mat3 u", np.arange(9.0)),
        ("mat3 u", np.eye(2)),
    ],
)
def test_a_value_that_does_not_fit_names_the_uniform(egl: Context, declaration: str, value: Any) -> None:
    use = "u[0]" if "mat" in declaration else "u"
    with (
        pytest.raises(ValueError, match="test: u "),
        drawn(egl, f"color = vec4({use} == {use} ? 1.0 : 0.0, vec3({use}.x));".replace("u.x", "u")
              if "mat" not in declaration else "color = vec4(u[0], 1.0);", {"u": value}, f"uniform {declaration};"),
    ):  # fmt: skip
        pass


def test_two_samplers_and_their_attachments(context: Context) -> None:
    source = """#version 330 core
    uniform sampler2D a; uniform sampler2D b; uniform sampler2D c;
    out vec4 color;
    float first(sampler2D s) { return texelFetch(s, ivec2(0), 0).x; }
    void main() { color = vec4(first(a), first(b), first(c), 1.0); }
    """
    program = Program(context, FULL_SCREEN, source, locate, "test")
    with (
        program,
        Target(context, (1, 1), attachments=2) as one,
        Target(context, (1, 1)) as two,
        Target(context, (1, 1)) as out,
    ):
        one.write(1.0, attachment=0)
        one.write(2.0, attachment=1)
        two.write(3.0)
        program.draw(out, {"a": one, "b": (one, 1), "c": two.textures[0]})
        assert out.read()[0, 0].tolist() == [1.0, 2.0, 3.0, 1.0]


def test_reading_what_is_drawn_is_refused(egl: Context) -> None:
    source = "#version 330 core\nuniform sampler2D s;\nout vec4 c;\nvoid main() { c = texelFetch(s, ivec2(0), 0); }\n"
    with Program(egl, FULL_SCREEN, source, locate, "test") as program, PingPong(egl, (2, 2)) as pair:
        with pytest.raises(ValueError, match="PingPong"):
            program.draw(pair.front, {"s": pair.front})
        program.draw(pair.back, {"s": pair.front})


POSITION = "#version 330 core\nout vec4 color;\nvoid main() { color = vec4(gl_FragCoord.xy, 1.0, 1.0); }\n"


def test_tiles_make_the_whole_picture(context: Context) -> None:
    vertex = FULL_SCREEN.replace("void main", "out vec2 place;\nvoid main").replace("}", "place = gl_Position.xy; }")
    fragment = POSITION.replace("void main", "in vec2 place;\nvoid main").replace("1.0, 1.0", "place")
    with Program(context, vertex, fragment, locate, "test") as program, Target(context, (7, 5)) as target:
        program.draw(target)
        whole = target.read()
        target.clear()
        for x in range(0, 7, 3):
            for y in range(0, 5, 2):
                program.draw(target, {}, tile=(x, y, min(3, 7 - x), min(2, 5 - y)))
        assert np.array_equal(target.read(), whole)


def test_a_tile_leaves_the_rest_and_the_next_draw_and_clear_alone(context: Context) -> None:
    with Program(context, FULL_SCREEN, POSITION, locate, "test") as program, Target(context, (4, 3)) as target:
        target.clear((9.0, 9.0, 9.0, 9.0))
        program.draw(target, tile=(1, 0, 2, 1))
        picture = target.read()
        assert picture[2, 1:3, 0].tolist() == [1.5, 2.5]  # the tile's y = 0 is the bottom row
        assert np.count_nonzero(picture[..., 0] == 9.0) == 10
        target.clear()
        assert np.all(target.read() == 0.0)
        program.draw(target, tile=(1, 0, 2, 1))
        program.draw(target)
        assert np.all(target.read()[..., 2] == 1.0)


def test_a_tile_of_one_target_does_not_confine_the_clearing_of_another(context: Context) -> None:
    program = Program(context, FULL_SCREEN, POSITION, locate, "test")
    with program, Target(context, (4, 3)) as tiled, Target(context, (4, 3)) as other:
        other.clear((1.0, 1.0, 1.0, 1.0))
        program.draw(tiled, tile=(1, 0, 2, 1))
        other.clear((2.0, 2.0, 2.0, 2.0))
        assert np.all(other.read() == 2.0)


@pytest.mark.parametrize("tile", [(-1, 0, 2, 2), (0, 0, 5, 1), (3, 0, 2, 1), (0, 0, 0, 1), (0, 2, 1, 2)])
def test_a_tile_outside_the_surface_is_refused(egl: Context, tile: tuple[int, int, int, int]) -> None:
    with (
        Program(egl, FULL_SCREEN, POSITION, locate, "test") as program,
        Target(egl, (4, 3)) as target,
        pytest.raises(ValueError, match="4 x 3"),
    ):
        program.draw(target, tile=tile)


def test_draws_go_to_the_programs_own_context(egl: Context, osmesa: Context) -> None:
    with (
        Program(egl, FULL_SCREEN, POSITION, locate, "test") as program,
        Target(egl, (2, 2)) as target,
        osmesa.bound(),
    ):
        program.draw(target)
        assert np.all(target.read()[..., 2] == 1.0)


def test_release_is_idempotent_and_may_come_after_the_contexts(egl: Context) -> None:
    passing = open_context("egl")
    program = Program(passing, FULL_SCREEN, POSITION, locate, "test")
    passing.release()
    program.release()
    program.release()
    assert program.released


def test_blending_after_a_draw_without_it(egl: Context) -> None:
    """A draw may enable logical operations, which disable blending; none is left enabled after it."""
    source = "#version 330 core\nuniform vec4 u_color;\nout vec4 color;\nvoid main() { color = u_color; }\n"
    with Program(egl, FULL_SCREEN, source, locate, "test") as program, Target(egl, (2, 2)) as target:
        program.draw(target, {"u_color": (1.0, 0.0, 0.25, 1.0)})
        program.draw(target, {"u_color": (0.0, 1.0, 0.25, 0.5)}, blend=True)
        np.testing.assert_allclose(target.read()[0, 0, :3], (0.5, 0.5, 0.25))


INTERRUPTED = """
import signal
import _moderngl
import raymarch as rm

class Stop(Exception):
    pass

def stop(*_):
    raise Stop

def interrupting(*args):
    while due:
        signal.raise_signal(due.pop())
    return made(*args)

made, _moderngl.make_uniform = _moderngl.make_uniform, interrupting
signal.signal(signal.SIGTERM, stop)
scene = rm.Scene(rm.sphere(rm.Param("radius", 1, 0.5, 2)))
with rm.Renderer((8, 8), "BACKEND") as renderer:
    for number in (signal.SIGINT, signal.SIGTERM):
        due = [number]
        try:
            renderer.render(scene)
        except (KeyboardInterrupt, Stop) as found:
            print(type(found).__name__)
    print(renderer.render(scene).color.any() and signal.getsignal(signal.SIGTERM) is stop)
"""


@pytest.mark.parametrize("backend", ["egl", "osmesa"])
def test_signals_wait_while_a_program_is_made(interpreter: Any, backend: str) -> None:
    """moderngl calls Python for each uniform, where handlers of signals run; it does not survive their exceptions."""
    assert interpreter(INTERRUPTED.replace("BACKEND", backend), None).split() == ["KeyboardInterrupt", "Stop", "True"]


VALUES = """#version 330 core
uniform float a;
uniform vec2 b;
out vec4 color;
void main() { color = vec4(1.0 / a, b, 1.0); }
"""


def test_a_uniform_is_sent_again_only_if_it_changes(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []
    with Program(context, FULL_SCREEN, VALUES, locate, "test") as program, Target(context, (2, 2)) as target:
        monkeypatch.setattr(program_module, "_uniform_bytes", counting(program_module._uniform_bytes, sent))
        both = (3.0, 4.0)
        for a, b, new in [
            (0.0, both, ["a", "b"]),
            (-0.0, both, ["a"]),  # which is equal to 0, and is another number
            (2.0, both, ["a"]),
            (2.0, both, []),
            (2.0, (3.0, 5.0), ["b"]),
            (2, np.array([3.0, 5.0]), ["b"]),
        ]:
            sent.clear()
            program.draw(target, {"a": a, "b": b, "unknown": 1.0})
            with np.errstate(divide="ignore"):
                assert np.array_equal(target.read()[0, 0], np.float32([np.divide(1.0, a), *b, 1.0]))
            assert sent == new


def counting(made: Any, sent: list[str]) -> Any:
    def counted(name: str, uniform: Any, value: Any) -> bytes:
        sent.append(uniform.name)
        return made(name, uniform, value)

    return counted
