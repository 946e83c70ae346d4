"""What only a device can tell: its contexts, timer, compiler, float32, shader clock, and the accuracy of the examples.

    python -m tests.gpu.device              # a table
    python -m tests.gpu.device --json FILE  # and all of it as JSON

Ends with code 1 if a hit is missed or made up away from silhouettes. Nothing in the tests depends on its numbers.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.gpu.clock import gl_timer, try_timer
from raymarch.gpu.context import Context
from raymarch.gpu.doctor import examine
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from raymarch.scene import load
from raymarch.truth import truth
from tests.support.compared import compare

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = (160, 90)
COUNT = 4096

# Operands are made of whole numbers, so that NumPy knows them bit for bit.
NUMBERS = """#version 330 core
layout(location = 0) out vec4 a;
layout(location = 1) out vec4 b;
uniform float one;
uniform float tiny;
void main() {
    float n = floor(gl_FragCoord.x);
    float x = (2.0 * n + 1.0) / 8192.0 * one;
    float y = (4096.0 - n) / 4096.0 * one;
    a = vec4(x / (y + one), sqrt(x), sin(6.0 * x), exp2(x));
    b = vec4(x * y - floor(x * y * 4096.0) / 4096.0, tiny * 0.5, inversesqrt(x), length(vec3(x, y, one)));
}
"""


def float32(context: Context) -> dict[str, Any]:
    """The largest error of some operations in units of the last place of the true value, and what becomes of the
    smallest numbers. OpenGL promises 2.5 for a division, and nothing for sin."""
    with Target(context, (COUNT, 1), 2) as target, Program(context, FULL_SCREEN, NUMBERS, _nowhere, "numbers") as made:
        made.draw(target, {"one": 1.0, "tiny": float(np.finfo(np.float32).tiny)})
        a, b = target.read(0)[0].astype(np.float64), target.read(1)[0].astype(np.float64)
    n = np.arange(COUNT, dtype=np.float64)
    x, y = (2 * n + 1) / 8192, (4096 - n) / 4096
    known = {
        "division": (a[:, 0], x / (y + 1)),
        "sqrt": (a[:, 1], np.sqrt(x)),
        "exp2": (a[:, 3], np.exp2(x)),
        "inversesqrt": (b[:, 2], 1 / np.sqrt(x)),
        "length": (b[:, 3], np.sqrt(x * x + y * y + 1)),
    }
    found = {name: float(np.max(np.abs(v - w) / np.spacing(w.astype(np.float32)))) for name, (v, w) in known.items()}
    found["sin_absolute"] = float(np.max(np.abs(a[:, 2] - np.sin(6 * x))))
    product = (x * y).astype(np.float32)
    apart = product - np.floor(product * np.float32(4096)) / np.float32(4096)  # exact, once the product is rounded
    return {
        "ulp": found,
        "denormals_kept": bool(np.all(b[:, 1] > 0)),
        "fused_multiply_add": not np.array_equal(b[:, 0], apart.astype(np.float64)),
    }


# What the specification of GLSL leaves open. `bad` is NaN, `huge` infinite, `zero` 0, `two` 2.
OPEN = (
    "min(bad, two)", "min(two, bad)", "max(bad, two)", "max(two, bad)", "clamp(bad, zero, two)", "sign(bad)",
    "step(zero, bad)", "float(bad < zero)", "float(bad == bad)", "float(isnan(bad))", "pow(zero, zero)",
    "pow(-two, two)", "pow(zero, two)", "atan(zero, zero)", "sqrt(-two)", "inversesqrt(zero)", "two / zero",
    "zero / zero", "huge - huge", "huge * zero", "log(zero)", "acos(two)", "mod(two, zero)", "fract(huge)",
    "normalize(vec3(zero)).x", "length(vec2(2e19, zero) * 5.0)", "smoothstep(zero, zero, zero)", "exp(-200.0 * two)",
    "texelFetch(picture, ivec2(-1, 0), 0).x", "float(int(bad))", "float(int(huge))", "roundEven(two + 0.5)",
    "round(two + 0.5)", "mix(huge, two, 1.0)", "tanh(two * 100.0)", "sinh(two * 100.0)", "dot(vec3(bad), vec3(zero))",
)  # fmt: skip


def left_open(context: Context) -> dict[str, float]:
    """What this driver answers where the specification of GLSL gives no answer."""
    lines = "\n".join(f"    if (n == {i}) a = vec4({text});" for i, text in enumerate(OPEN))
    text = f"""#version 330 core
layout(location = 0) out vec4 a;
uniform float bad; uniform float huge; uniform float zero; uniform float two;
uniform sampler2D picture;
void main() {{
    int n = int(gl_FragCoord.x);
    a = vec4(-7.0);
{lines}
}}
"""
    with (
        Target(context, (len(OPEN), 1)) as target,
        Target(context, (1, 1)) as picture,
        Program(context, FULL_SCREEN, text, _nowhere, "open") as made,
    ):
        picture.write(np.full((1, 1, 4), 5.0, np.float32))
        made.draw(target, {"bad": np.nan, "huge": np.inf, "zero": 0.0, "two": 2.0, "picture": picture})
        return dict(zip(OPEN, map(float, target.read()[0, :, 0]), strict=True))


def accuracy(renderer: rm.Renderer, name: str) -> dict[str, Any]:
    """An example against the truth, what its first shader took to compile, and its clock cycles a pixel."""
    scene = load(EXAMPLES / f"{name}.py")
    known = truth(scene, SIZE, outputs=("normal",))
    frame = renderer.render(scene, outputs=("color", "depth"))
    found = compare(frame.depth, frame.normal, known)
    has_clock = "GL_ARB_shader_clock" in renderer.context.gl.extensions
    return {
        "certified": scene.node.exactness != "estimate",
        "missed": found.missed_hits,
        "false": found.false_hits,
        "depth_p99": found.depth_p99,
        "normal_p95": found.normal_p95,
        "evaluations": float(frame.evaluations.mean()),
        "compile_ms": {t.name: t.compile for t in frame.timings if t.compile},
        "draw_ms": renderer.render(scene).milliseconds,
        "cycles": float(np.median(frame.cycles)) if has_clock else None,
    }


def measure(names: list[str], backend: str, jobs: int = 1) -> dict[str, Any]:
    """Everything, as numbers, texts, lists and dicts."""
    found: dict[str, Any] = {"contexts": [report.to_dict() for report in examine()]}
    with rm.Renderer(SIZE, backend) as renderer:
        context = renderer.context
        trial = try_timer(context, gl_timer(context))
        driver = context.driver
        found |= {
            "backend": context.backend,
            "driver": {"renderer": driver.renderer, "version": driver.version, "software": driver.is_software},
            "timer": {"agrees": trial.agrees, "words": trial.words, "wall_ms": trial.wall, "timer_ms": trial.timer},
            "shader_clock": "GL_ARB_shader_clock" in context.gl.extensions,
            "float32": float32(context),
            "open": left_open(context),
        }
    if jobs == 1:
        return found | {"examples": {name: _one(name, backend) for name in names}}
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        rows = pool.map(_one, names, [backend] * len(names))
        return found | {"examples": dict(zip(names, rows, strict=True))}


def _one(name: str, backend: str) -> dict[str, Any]:
    with rm.Renderer(SIZE, backend) as renderer:
        return accuracy(renderer, name)


def show(found: dict[str, Any]) -> None:
    """The table."""
    print(f"{found['backend']}: {found['driver']['renderer']}, {found['driver']['version']}")
    for context in found["contexts"]:
        print(f"  {context['backend']:<8}{'works' if context['works'] else context['error']}")
    print(f"  timer   {found['timer']['words']}")
    print(f"  clock   {'GL_ARB_shader_clock' if found['shader_clock'] else 'no GL_ARB_shader_clock'}")
    errors = ", ".join(f"{name} {value:.3g}" for name, value in found["float32"]["ulp"].items())
    print(f"  float32 errors in ulp: {errors}")
    print(
        f"  denormals {'kept' if found['float32']['denormals_kept'] else 'flushed'}, products and sums "
        f"{'fused' if found['float32']['fused_multiply_add'] else 'rounded one by one'}"
    )
    print("  left open: " + ", ".join(f"{text} = {value:.4g}" for text, value in found["open"].items()))
    heads = ("missed", "false", "depth_p99", "normal_p95", "evaluations", "compile", "draw_ms", "cycles")
    print(f"{'':<22}" + "".join(f"{head:>13}" for head in heads))
    for name, row in found["examples"].items():
        cells = {**row, "compile": sum(row["compile_ms"].values())}
        print(f"{name:<22}" + "".join(f"{'-' if cells[h] is None else format(cells[h], '.4g'):>13}" for h in heads))


def sound(found: dict[str, Any]) -> bool:
    """True if every certified example has the hits of the truth and no other."""
    rows = [row for row in found["examples"].values() if row["certified"]]
    return all(row["missed"] == row["false"] == 0 for row in rows)


def _nowhere(line: int) -> tuple[str, None]:
    return f"line {line} of the test of numbers", None


def main(args: list[str] | None = None) -> int:
    names = sorted(str(file.relative_to(EXAMPLES).with_suffix("")) for file in EXAMPLES.rglob("*.py"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="where to write the JSON")
    parser.add_argument("--backend", default="auto")
    parser.add_argument("--jobs", type=int, default=1, help="processes that compute truths")
    parser.add_argument("--examples", nargs="*", choices=names, default=names)
    asked = parser.parse_args(args)
    found = measure(asked.examples, asked.backend, asked.jobs)
    if asked.json is not None:
        asked.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    show(found)
    return 0 if sound(found) else 1


if __name__ == "__main__":
    raise SystemExit(main())
