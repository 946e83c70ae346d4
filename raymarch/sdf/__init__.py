"""Nodes: shapes, booleans, transforms, repetition and deformations. Each is a short function with its facts.

Public are the names that the modules list. What is a method of nodes can be called as a function of this package, too.
"""

import sys
from typing import TYPE_CHECKING

from raymarch.sdf import evaluation as _evaluation  # these register how a node is evaluated, printed and pickled
from raymarch.sdf import pickling as _pickling
from raymarch.sdf.affine import transform
from raymarch.sdf.ball_parts import *
from raymarch.sdf.booleans import *
from raymarch.sdf.cells import *
from raymarch.sdf.copies import polar, repeat_interval, repeat_mirrored
from raymarch.sdf.curves import *
from raymarch.sdf.definition import *
from raymarch.sdf.deform import bend, displace, shear, taper, twist, wrap_around
from raymarch.sdf.flat import *
from raymarch.sdf.flat_curves import *
from raymarch.sdf.folds import *
from raymarch.sdf.fractals import *
from raymarch.sdf.heights import *
from raymarch.sdf.heights import displace_by_image
from raymarch.sdf.hulls import *
from raymarch.sdf.implicit import *
from raymarch.sdf.instancing import *
from raymarch.sdf.joints import *
from raymarch.sdf.joints import complement
from raymarch.sdf.lettering import *
from raymarch.sdf.meshes import *
from raymarch.sdf.node import *
from raymarch.sdf.noise import *
from raymarch.sdf.noise import displace_by, displace_by_noise
from raymarch.sdf.offsets import elongate, offset, round, shell
from raymarch.sdf.periodic import *
from raymarch.sdf.placing import material, mirror, orient, rotate, scale, translate
from raymarch.sdf.polyhedra import *
from raymarch.sdf.profiles import extrude, extrude_to, revolve, slice
from raymarch.sdf.raw import *
from raymarch.sdf.repetition import repeat
from raymarch.sdf.rounded_hulls import *
from raymarch.sdf.rounds import *
from raymarch.sdf.sampled import *
from raymarch.sdf.sketches import *
from raymarch.sdf.solids import *
from raymarch.sdf.visibility import visible
from raymarch.sdf.warps import warp

if not TYPE_CHECKING:  # type checkers know the public names by the imports of all names
    _modules = [module for path, module in sys.modules.items() if path.startswith("raymarch.sdf.")]
    __all__ = sorted(name for module in _modules for name in getattr(module, "__all__", ()))
