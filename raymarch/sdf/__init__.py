"""What a user combines: shapes, booleans, placing, repetition; each a short function with its facts."""

from raymarch.sdf import lower as _lower  # noqa: F401  registers how a node is evaluated and printed
from raymarch.sdf.booleans import difference, intersection, union
from raymarch.sdf.definition import operator, shape
from raymarch.sdf.node import Node
from raymarch.sdf.placing import material, mirror, rotate, scale, transform, translate
from raymarch.sdf.repetition import repeat
from raymarch.sdf.solids import box, capsule, cylinder, plane, sphere, torus
from raymarch.sdf.thickness import round, shell

__all__ = [
    "Node",
    "box",
    "capsule",
    "cylinder",
    "difference",
    "intersection",
    "material",
    "mirror",
    "operator",
    "plane",
    "repeat",
    "rotate",
    "round",
    "scale",
    "shape",
    "shell",
    "sphere",
    "torus",
    "transform",
    "translate",
    "union",
]
