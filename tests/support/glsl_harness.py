"""Evaluates GLSL functions of points on the GPU, and checks GLSL text against the ES grammar.

Points go in as texels of float textures and values come back as texels of another, so that a function
is run by the same compiler and the same float32 units that draw pictures.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch import glsl
from raymarch.expr.function import Function
from raymarch.expr.glsl import Text, print_functions
from raymarch.expr.samples import Samples
from raymarch.expr.texels import Texels
from raymarch.expr.types import Type
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target, upload, upload_pyramid
from tests.support.required import glslang

DESKTOP = "#version 330 core\n"
ES = "#version 300 es\n" + "".join(f"precision highp {t};\n" for t in ("float", "int", "sampler2D", "sampler3D"))

_COMPONENTS = ("x", "xy", "xyz", "xyzw")


def text_of(printed: Text) -> str:
    """Uniforms, samplers and functions, without a version line and without main."""
    uniforms = [f"uniform {leaf.type} {name};\n" for name, leaf in printed.uniforms.items()]
    if printed.uses_time:
        uniforms.append("uniform float u_time;\n")
    uniforms += [f"uniform sampler{data.dimension}D {name};\n" for name, data in printed.samples.items()]
    return "".join(uniforms) + "\n".join(line.text for line in printed.lines()) + "\n"


def modules(*names: str, before: str = "", after: str = "", variants: frozenset[str] = frozenset()) -> str:
    """Hand-written modules, each after what it needs; `before` stands in for what they need of a scene."""
    parts = ["\n".join(glsl.load(name, variants).lines) for name in names]
    return "\n".join([before, *parts, after]) + "\n"


def _shader(text: str, calls: Sequence[tuple[str, int]], types: Sequence[Type], version: str) -> str:
    """A fragment shader that stores each call and its components in an output of its own."""
    samplers = "".join(f"uniform sampler2D harness_input_{i};\n" for i in range(len(types)))
    outputs = "".join(f"layout(location = {k}) out vec4 harness_output_{k};\n" for k in range(len(calls)))
    inputs = [f"texelFetch(harness_input_{i}, texel, 0).{_COMPONENTS[t.size - 1]}" for i, t in enumerate(types)]
    stored = "".join(
        f"    harness_output_{k} = vec4({call.format(*inputs)}{', 0.0' * (4 - size)});\n"
        for k, (call, size) in enumerate(calls)
    )
    main = f"void main() {{\n    ivec2 texel = ivec2(gl_FragCoord.xy);\n{stored}}}\n"
    return f"{version}{samplers}{outputs}{text}{main}"


def shader(text: str, call: str, types: Sequence[Type], size: int, version: str = DESKTOP) -> str:
    """A fragment shader that stores `call`, in which {0}, {1}, ... stand for the inputs, for each texel."""
    return _shader(text, [(call, size)], types, version)


def run(
    context: Context,
    text: str,
    call: str,
    inputs: Sequence[tuple[Type, ArrayLike]],
    size: int = 1,
    uniforms: Mapping[str, Any] | None = None,
    samples: Mapping[str, Samples | Texels] | None = None,
) -> NDArray[np.float32]:
    """Values of a GLSL expression for many points.

    Parameters
    ----------
    text : functions and uniform declarations.
    call : the expression, such as "field({0})"; {i} is input i.
    inputs : a float, vec2, vec3 or vec4 and its values, shape (N,) or (N, n), for each input.
    size : components of the expression's value.
    uniforms, samples : values of uniforms, and data of samplers, by their names.

    Returns
    -------
    float32, shape (N,) for size 1, else (N, size).
    """
    return run_all(context, text, [(call, size)], inputs, uniforms, samples)[0]


def run_all(
    context: Context,
    text: str,
    calls: Sequence[tuple[str, int]],
    inputs: Sequence[tuple[Type, ArrayLike]],
    uniforms: Mapping[str, Any] | None = None,
    samples: Mapping[str, Samples | Texels] | None = None,
) -> list[NDArray[np.float32]]:
    """Values of up to eight expressions, each with its components, by one program: see `run`.

    Most of the time that a short program costs is the driver's own, whatever it computes.
    """
    count = len(np.asarray(inputs[0][1]))
    width = min(count, 1024)
    height = -(-count // width)
    made: list[Any] = []
    try:
        values: dict[str, Any] = dict(uniforms or {})
        for name, data in (samples or {}).items():
            made.append(upload_pyramid(context, data) if isinstance(data, Texels) else upload(context, data))
            values[name] = made[-1]
        for i, (type, given) in enumerate(inputs):
            texels = np.zeros((width * height, 4), np.float32)
            texels[:count, : type.size] = np.asarray(given, np.float32).reshape(count, type.size)
            made.append(Target(context, (width, height)))
            made[-1].write(texels.reshape(height, width, 4))
            values[f"harness_input_{i}"] = made[-1]
        made.append(Target(context, (width, height), len(calls)))
        source = _shader(text, calls, [type for type, _ in inputs], DESKTOP)
        name = ", ".join(call for call, _ in calls)
        with Program(context, FULL_SCREEN, source, lambda line: (source.splitlines()[line - 1], None), name) as program:
            program.draw(made[-1], values)
            read = [made[-1].read(k).reshape(-1, 4)[:count, :size] for k, (_, size) in enumerate(calls)]
    finally:
        for texture in made:
            texture.release()
    return [values[:, 0] if values.shape[1] == 1 else values for values in read]


def draw(
    context: Context, text: str, size: tuple[int, int], values: Mapping[str, Any] | None = None, attachments: int = 1
) -> list[NDArray[np.float32]]:
    """What a whole pass, with its own main, draws into each attachment; row 0 is the BOTTOM, as gl_FragCoord counts.

    `values` are those of the uniforms by name; an array (height, width, 4) becomes the texture of a sampler, and its
    row 0 is the bottom too. `text` lacks the version line alone.
    """
    made: list[Target] = []
    try:
        given: dict[str, Any] = {}
        for name, value in (values or {}).items():
            given[name] = value
            if np.ndim(value) == 3:
                given[name] = Target(context, np.shape(value)[1::-1])
                made.append(given[name])
                made[-1].write(np.asarray(value, np.float32)[::-1])
        made.append(Target(context, size, attachments))
        source = DESKTOP + text
        with Program(
            context, FULL_SCREEN, source, lambda line: (source.splitlines()[line - 1], None), "pass"
        ) as program:
            program.draw(made[-1], given)
            return [made[-1].read(i)[::-1] for i in range(attachments)]
    finally:
        for target in made:
            target.release()


def evaluate(
    context: Context, function: Function, inputs: Sequence[ArrayLike], uniforms: Mapping[str, Any] | None = None
) -> NDArray[np.float32]:
    """Values of a function of the expression language, as the GPU computes them from its printed text."""
    arguments = ", ".join(f"{{{i}}}" for i in range(len(inputs)))
    printed = print_functions([function])
    types = {t for f in printed.names for t in (f.type, *(p.type for p in f.params)) if t.fields}
    structs = [f"struct {t} {{ {' '.join(f'{kind} {name};' for name, kind in t.fields)} }};\n" for t in types]
    return run(
        context,
        "".join(structs) + text_of(printed),
        f"{printed.names[function]}({arguments})",
        [(p.type, values) for p, values in zip(function.params, inputs, strict=True)],
        function.type.size,
        uniforms,
        printed.samples,
    )


def assert_es(text: str, call: str, types: Sequence[Type], size: int = 1) -> None:
    """The same text must be valid in `#version 300 es`, by the reference compiler."""
    assert_valid({call: shader(text, call, types, size, ES)})


def assert_valid(texts: Mapping[str, str]) -> None:
    """The reference compiler takes fragment shaders, by their names. One process reads all of them."""
    with tempfile.TemporaryDirectory() as folder:
        files = {str(Path(folder, f"{k}.frag")): name for k, name in enumerate(texts)}
        for file, name in files.items():
            Path(file).write_text(texts[name], encoding="utf-8")
        done = subprocess.run([glslang(), *files], capture_output=True, text=True, check=False)
    wrong = [name for file, name in files.items() if f"{file}\nERROR" in done.stdout] or list(texts)
    assert done.returncode == 0, f"{', '.join(wrong)}:\n{done.stdout}\n{texts[wrong[0]]}"
