"""Evaluation counts: field evaluations of marching and of shading, counted by the shader.

The shader of the picture is compiled again with a counter in its field function. Other pictures do not have the
counter.
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
    """Field evaluations per pixel, each (H, W): `marching` finds the hit, `shading` is shadows, occlusion and bounces.

    Gradients for normals are not counted, since they are separate functions.
    """

    marching: NDArray[np.float32]
    shading: NDArray[np.float32]


def count_evaluations(
    renderer: Renderer, scene: Scene, time: float = 0.0, params: Mapping[str, Any] | None = None
) -> EvaluationCounts:
    """Count the evaluations of one sample per pixel, marched without cones and closed forms, by values alone.

    Errors are those of `Renderer.render`.
    """
    quality = scene.quality.replace(samples=1, temporal="off", schedule="single", analytic=False)
    if quality.tracer == "auto":  # which may ask how far a ray is free
        quality = quality.replace(tracer="bracketing")
    scene = scene.replace(quality=quality)
    ready = prepare(scene)
    call = renderer.draw_calls(scene, time, params)[-1]
    with Target(renderer.context, renderer.size) as target:
        text = counting(ready.texts["color"])
        program = Program(renderer.context, ready.vertex, text, ready.shader.locate, "evaluation counts")
        try:
            program.draw(target, call.uniforms)
            counts = target.read()
        finally:
            program.release()
    return EvaluationCounts(counts[..., 0].copy(), counts[..., 1].copy())


def counting(text: str) -> str:
    """The text of a picture's shader, changed to write counts instead of colours."""
    head = re.search(r"^float field\((vec3 \w+)\) \{$", text, re.MULTILINE)
    found, shown = "    Hit hit = trace(ray);\n", "\n}\n"
    if head is None or found not in text or not text.endswith(shown):
        raise DeviceError(
            "the evaluations of this shader cannot be counted", legal="a picture without samples and history"
        )
    wrapped = "float evaluated = 0.0;\nfloat before = 0.0;\n"
    wrapped += f"float field_itself({head[1]});\n\nfloat field({head[1]}) {{\n    evaluated += 1.0;\n"
    wrapped += f"    return field_itself({head[1].split()[1]});\n}}\n\n"
    text = text.replace(head[0], wrapped + head[0].replace("float field(", "float field_itself("), 1)
    text = text.replace(found, f"{found}    before = evaluated;\n", 1)
    return text[: -len(shown)] + "\n    out_color = vec4(before, evaluated - before, 0.0, 1.0);" + shown
