"""Pixels at which the driver ended a shader's loops: llvmpipe does after 65,535 turns of all loops of a pixel together.

It says nothing, and the colour of the pixel is that of a ray that found nothing, or of a solid that is not there.
"""

from __future__ import annotations

import warnings
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import SceneWarning
from raymarch.gpu import Renderer, resource_cache
from raymarch.gpu.context import Context

_MAIN = "void main() {"
_WATCH = """
void main() {
    draw();
    int turns = 0;
    for (int i = 0; i < 256; i++) {  // no turn may follow the first where the driver ends loops
        if (float(i) >= 2.0 + 0.0 * gl_FragCoord.x) break;
        turns++;
    }
    if (turns < 2) out_color = vec4(-1.0);
}
"""


def watched(fragment: str) -> str:
    """The shader of a picture; it draws a negative colour where its loops were ended."""
    return fragment.replace(_MAIN, "void draw() {") + _WATCH


def ended_loops(context: Context, size: tuple[int, int], scene: rm.Scene, time: float) -> NDArray[np.bool_]:
    """The pixels (H, W) at which the driver ended loops of the pass of colours; the scene is drawn once more."""
    plain = resource_cache.Program

    def program(context: Context, vertex: str, fragment: str, locate: Any, name: str) -> Any:
        return plain(context, vertex, watched(fragment) if name == "color" else fragment, locate, name)

    with (
        mock.patch.object(resource_cache, "Program", program),
        warnings.catch_warnings(),
        Renderer(size, context=context) as renderer,
    ):
        warnings.simplefilter("ignore", SceneWarning)
        color = renderer.render(scene, outputs=("color",), time=time).color
    return np.asarray((color < 0.0).all(axis=-1))
