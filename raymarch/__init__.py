"""raymarch: signed-distance scenes in Python, compiled to one GLSL fragment shader.

import raymarch as rm

rm.render(rm.Scene(rm.box() - rm.sphere(0.65))).save("hello.png")
"""

from raymarch.errors import DeviceError, PlanError, RaymarchError, SceneError, ShaderError
from raymarch.gpu import Frame, Renderer, render
from raymarch.scene import Camera, Fog, Material, Param, PointLight, Quality, Scene, Sky, Sun, time
from raymarch.sdf import (
    Node,
    box,
    capsule,
    cylinder,
    difference,
    intersection,
    operator,
    plane,
    shape,
    sphere,
    torus,
    union,
)
from raymarch.truth import Truth, truth

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "DeviceError",
    "Fog",
    "Frame",
    "Material",
    "Node",
    "Param",
    "PlanError",
    "PointLight",
    "Quality",
    "RaymarchError",
    "Renderer",
    "Scene",
    "SceneError",
    "ShaderError",
    "Sky",
    "Sun",
    "Truth",
    "__version__",
    "box",
    "capsule",
    "cylinder",
    "difference",
    "intersection",
    "operator",
    "plane",
    "render",
    "shape",
    "sphere",
    "time",
    "torus",
    "truth",
    "union",
]
