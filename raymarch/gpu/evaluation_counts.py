"""What shading costs: evaluations of the field after the ray has hit, counted by the shader itself.

The text of the picture's shader is compiled once more with a counter around the field. Its picture is the same;
pictures that nobody asks this of do not have the counter.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import DeviceError
from raymarch.gpu.prepare import prepare
from raymarch.gpu.program import Program
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.targets import Target
from raymarch.scene.scene import Scene


@dataclass(frozen=True)
class EvaluationCounts:
    """Evaluations of the field a pixel, each (H, W): to find the hit, and to shade it (shadows, occlusion, bounces).

    Gradients for normals are not among them: they are functions of their own.
    """

    marching: NDArray[np.float32]
    shading: NDArray[np.float32]


def count_evaluations(renderer: Renderer, scene: Scene, time: float = 0.0, params: Mapping[str, Any] | None = None) -> EvaluationCounts:
    """Count the evaluations of one sample of a picture, marched without cones; errors are those of
    `Renderer.render`."""
    scene = scene.replace(quality=scene.quality.replace(samples=1, temporal="off", schedule="single"))
    ready = prepare(scene)
    call = renderer.draw_calls(scene, time, params)[-1]
    with Target(renderer.context, renderer.size) as target:
        program = Program(renderer.context, ready.vertex, counting(ready.texts["color"]), ready.shader.locate, "evaluation counts")
        try:
            program.draw(target, call.uniforms)
            counts = target.read()
        finally:
            program.release()
    return EvaluationCounts(counts[..., 0].copy(), counts[..., 1].copy())


def counting(text: str) -> str:
    """The text of a picture's shader that shows counts in place of colours."""
    head = re.search(r"^float field\((vec3 \w+)\) \{$", text, re.MULTILINE)
    found, shown = "    Hit hit = trace(ray);\n", "\n}\n"
    if head is None or found not in text or not text.endswith(shown):
        raise DeviceError("this shader's evaluations cannot be counted", legal="a picture without samples and history")
    wrapped = f"float asked = 0.0;\nfloat field_itself({head[1]});\n\nfloat field({head[1]}) {{\n    asked += 1.0;\n"
    wrapped += f"    return field_itself({head[1].split()[1]});\n}}\n\n"
    text = text.replace(head[0], wrapped + head[0].replace("float field(", "float field_itself("), 1)
    text = text.replace(found, f"{found}    float before = asked;\n", 1)
    return text[: -len(shown)] + "\n    out_color = vec4(before, asked - before, 0.0, 1.0);" + shown
