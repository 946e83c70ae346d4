"""The hash of a lattice cell, bit-identical in all readings.

Cell indices are hashed as integers: a hash made of sines would be chaotic in the last bit of its input. The hash is the
output permutation of a PCG generator (O'Neill 2014; as a hash Jarzynski and Olano 2020), once for each coordinate. Its
upper 24 bits form a fraction that float32 holds exactly. Indices are rounded to even: a half added to an odd number
above 2^23 would be a tie in float32, and none in float64.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.node import Expr, Operand, expr, simplify
from raymarch.expr.types import FLOAT, VEC3

Array = NDArray[Any]

FARTHEST = 1.0e9
"""Cell indices are clamped to this; float32 and 32-bit integers both hold it."""


@checked
def hash(cell: Operand) -> Expr:
    """A pseudorandom number in [0, 1) for each cell of the integer lattice.

    cell : vec3 of integers; other values are rounded, a half to the even integer.
    """
    value = expr(cell)
    if value.type is not VEC3:
        raise SceneError(f"hash({value.type})", legal="the index of a cell, a vec3")
    return simplify("hash", FLOAT, (value,))


def pcg(v: Array) -> Array:
    """The output permutation of a PCG generator, of an array of uint32. `PCG_GLSL` is the same function in GLSL."""
    v = v * np.uint32(747796405) + np.uint32(2891336453)
    v = ((v >> ((v >> np.uint32(28)) + np.uint32(4))) ^ v) * np.uint32(277803737)
    return (v >> np.uint32(22)) ^ v


def evaluate(_node: Expr, cell: Array) -> Array:
    """NumPy row of "hash"."""
    number = np.where(np.isnan(cell), cell.dtype.type(0), cell)  # np.nan_to_num and np.clip take three times as long
    rounded = np.rint(np.minimum(np.maximum(number, -FARTHEST), FARTHEST))
    n = rounded.reshape(-1, 3).astype(np.int64).astype(np.uint32)
    bits = pcg(n[..., 0] + pcg(n[..., 1] + pcg(n[..., 2])))
    fraction = (bits >> np.uint32(8)).astype(cell.dtype) * cell.dtype.type(2.0**-24)
    return fraction.reshape(cell.shape[:-1])


PCG_GLSL = """uint pcg(uint v) {
    v = v * 747796405u + 2891336453u;
    v = ((v >> ((v >> 28) + 4u)) ^ v) * 277803737u;
    return (v >> 22) ^ v;
}"""

GLSL_HELPERS = {
    "pcg": PCG_GLSL,
    "cell_hash": """float cell_hash(vec3 cell) {
    // one number in [0, 1) for each cell
    uvec3 n = uvec3(ivec3(roundEven(clamp(cell, -1.0e9, 1.0e9))));
    return float(pcg(n.x + pcg(n.y + pcg(n.z))) >> 8) * 5.9604645e-8;
}""",
}
