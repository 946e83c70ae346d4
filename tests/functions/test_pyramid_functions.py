"""Places beyond the border of a picture, as the pyramid of a bloom reads them."""

from __future__ import annotations

import numpy as np

from raymarch.expr.types import FLOAT
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run


def test_a_picture_is_mirrored_beyond_its_border(egl: Context) -> None:
    """Its border is doubled there, as by numpy.pad; two texels beyond a picture of one there is that one."""
    text = modules("temporal/finite", "post/bloom").replace("void main()", "void drawn()")
    text = text.replace("layout(location = 0) out vec4 out_color;", "vec4 out_color;")
    for size in (1, 2, 3, 7):
        at = np.arange(-2, size + 2)
        known = np.clip(np.where(at < 0, -1 - at, np.where(at >= size, 2 * size - 1 - at, at)), 0, size - 1)
        padded = np.pad(np.arange(size), 2, mode="symmetric") if size > 1 else known
        np.testing.assert_array_equal(known, padded)
        for part, call in (("x", "ivec2(int({0}), 0)"), ("y", "ivec2(0, int({0}))")):
            whole = f"ivec2({size}, 1)" if part == "x" else f"ivec2(1, {size})"
            found = run(egl, text, f"float(mirrored({call}, {whole}).{part})", [(FLOAT, at)])
            np.testing.assert_array_equal(found, known)
