"""raymarch: signed-distance scenes in Python, compiled to one GLSL fragment shader.

import raymarch as rm

rm.render(rm.Scene(rm.box() - rm.sphere(0.65))).save("hello.png")
"""

from __future__ import annotations

import raymarch.startup  # noqa: F401 - first, because further imports take some tenths of a second

# isort: split
import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raymarch import cost
    from raymarch.cluster.frames import render_frames
    from raymarch.errors import (
        ClusterError,
        CostError,
        DeviceError,
        PlanError,
        RaymarchError,
        RenderError,
        RenderWarning,
        SceneError,
        ShaderError,
    )
    from raymarch.export import export
    from raymarch.export.notebook import show
    from raymarch.expr.maths import (
        abs as abs,
    )
    from raymarch.expr.maths import (
        acos,
        asin,
        atan,
        atan2,
        ceil,
        clamp,
        cos,
        cosh,
        cross_product,
        distance,
        dot,
        exp,
        exp2,
        floor,
        fract,
        length,
        log,
        log2,
        mix,
        mod,
        normalize,
        pi,
        sign,
        sin,
        sinh,
        smoothstep,
        sqrt,
        step,
        tan,
        tanh,
        tau,
        vec2,
        vec3,
        vec4,
        where,
    )
    from raymarch.expr.maths import (
        max as max,
    )
    from raymarch.expr.maths import (
        min as min,
    )
    from raymarch.expr.maths import (
        pow as pow,
    )
    from raymarch.gpu import Frame, Renderer, render
    from raymarch.gpu.probe import Probe, probe
    from raymarch.scene import (
        AmbientOcclusion,
        Camera,
        DirectionSample,
        Fog,
        GradientSky,
        ImageSky,
        Light,
        Material,
        Param,
        PointLight,
        Quality,
        RectLight,
        Scene,
        Sky,
        SphereLight,
        SpotLight,
        Sun,
        SunSky,
        Texture,
        ToneMapping,
        checker,
        grid_lines,
        marble,
        noise,
        planar,
        stripes,
        time,
        triplanar,
    )
    from raymarch.scene.post import Bloom
    from raymarch.sdf import (
        Node,
        apollonian,
        arc,
        ball_fold,
        bezier,
        bezier_tube,
        blob,
        box,
        box_fold,
        box_frame,
        capped_torus,
        capsule,
        circle,
        cone,
        cross,
        cuboctahedron,
        cut_hollow_sphere,
        cut_sphere,
        cylinder,
        death_star,
        difference,
        disc,
        dodecahedron,
        egg,
        ellipse,
        ellipsoid,
        engrave,
        flat_triangle,
        flat_vesica,
        fold_fractal,
        glsl_node,
        grid,
        groove,
        gyroid,
        hash,
        heart,
        heightmap,
        helix,
        hexagonal_prism,
        icosahedron,
        icosidodecahedron,
        image,
        infinite_cone,
        infinite_cylinder,
        instances,
        intersection,
        julia,
        lidinoid,
        line,
        link,
        mandelbox,
        mandelbulb,
        menger,
        mesh,
        moon,
        morph,
        neovius,
        octahedron,
        operator,
        pie,
        pipe,
        plane,
        plane_fold,
        polygon,
        polyline,
        polyline_tube,
        pyramid,
        quad,
        rectangle,
        regular_polygon,
        repeat_varied,
        rhombicuboctahedron,
        rhombus,
        ring,
        round_cone,
        rounded_box,
        rounded_cylinder,
        rounded_rectangle,
        schwarz_d,
        schwarz_p,
        shape,
        sierpinski,
        slab,
        solid_angle,
        sphere,
        star,
        stroke,
        superquadric,
        tetrahedron,
        text,
        tongue,
        torus,
        trapezoid,
        triangle,
        triangular_prism,
        truncated_cube,
        truncated_dodecahedron,
        truncated_icosahedron,
        truncated_octahedron,
        truncated_tetrahedron,
        union,
        value_noise,
        vesica,
        xor,
    )
    from raymarch.sdf.transition import transition
    from raymarch.truth import Truth, truth

__version__ = "0.1.0"

__all__ = [
    "AmbientOcclusion",
    "Bloom",
    "Camera",
    "ClusterError",
    "CostError",
    "DeviceError",
    "DirectionSample",
    "Fog",
    "Frame",
    "GradientSky",
    "ImageSky",
    "Light",
    "Material",
    "Node",
    "Param",
    "PlanError",
    "PointLight",
    "Probe",
    "Quality",
    "RaymarchError",
    "RectLight",
    "RenderError",
    "RenderWarning",
    "Renderer",
    "Scene",
    "SceneError",
    "ShaderError",
    "Sky",
    "SphereLight",
    "SpotLight",
    "Sun",
    "SunSky",
    "Texture",
    "ToneMapping",
    "Truth",
    "__version__",
    "acos",
    "apollonian",
    "arc",
    "asin",
    "atan",
    "atan2",
    "ball_fold",
    "bezier",
    "bezier_tube",
    "blob",
    "box",
    "box_fold",
    "box_frame",
    "capped_torus",
    "capsule",
    "ceil",
    "checker",
    "circle",
    "clamp",
    "cone",
    "cos",
    "cosh",
    "cost",
    "cross",
    "cross_product",
    "cuboctahedron",
    "cut_hollow_sphere",
    "cut_sphere",
    "cylinder",
    "death_star",
    "difference",
    "disc",
    "distance",
    "dodecahedron",
    "dot",
    "egg",
    "ellipse",
    "ellipsoid",
    "engrave",
    "exp",
    "exp2",
    "export",
    "flat_triangle",
    "flat_vesica",
    "floor",
    "fold_fractal",
    "fract",
    "glsl_node",
    "grid",
    "grid_lines",
    "groove",
    "gyroid",
    "hash",
    "heart",
    "heightmap",
    "helix",
    "hexagonal_prism",
    "icosahedron",
    "icosidodecahedron",
    "image",
    "infinite_cone",
    "infinite_cylinder",
    "instances",
    "intersection",
    "julia",
    "length",
    "lidinoid",
    "line",
    "link",
    "log",
    "log2",
    "mandelbox",
    "mandelbulb",
    "marble",
    "menger",
    "mesh",
    "mix",
    "mod",
    "moon",
    "morph",
    "neovius",
    "noise",
    "normalize",
    "octahedron",
    "operator",
    "pi",
    "pie",
    "pipe",
    "planar",
    "plane",
    "plane_fold",
    "polygon",
    "polyline",
    "polyline_tube",
    "probe",
    "pyramid",
    "quad",
    "rectangle",
    "regular_polygon",
    "render",
    "render_frames",
    "repeat_varied",
    "rhombicuboctahedron",
    "rhombus",
    "ring",
    "round_cone",
    "rounded_box",
    "rounded_cylinder",
    "rounded_rectangle",
    "schwarz_d",
    "schwarz_p",
    "shape",
    "show",
    "sierpinski",
    "sign",
    "sin",
    "sinh",
    "slab",
    "smoothstep",
    "solid_angle",
    "sphere",
    "sqrt",
    "star",
    "step",
    "stripes",
    "stroke",
    "superquadric",
    "tan",
    "tanh",
    "tau",
    "tetrahedron",
    "text",
    "time",
    "tongue",
    "torus",
    "transition",
    "trapezoid",
    "triangle",
    "triangular_prism",
    "triplanar",
    "truncated_cube",
    "truncated_dodecahedron",
    "truncated_icosahedron",
    "truncated_octahedron",
    "truncated_tetrahedron",
    "truth",
    "union",
    "value_noise",
    "vec2",
    "vec3",
    "vec4",
    "vesica",
    "where",
    "xor",
]

_BUILT_IN = ("abs", "max", "min", "pow")
"""Public names that `from raymarch import *` leaves out, because they would hide Python's own."""

_PACKAGES = frozenset("cost errors expr glsl gpu plan scene sdf shader".split())
"""The packages that are attributes of this one without an import of their own."""

_MODULES = {
    "raymarch.errors": (
        "ClusterError CostError DeviceError PlanError RaymarchError RenderError RenderWarning SceneError ShaderError"
    ),
    "raymarch.cluster.frames": "render_frames",
    "raymarch.export": "export",
    "raymarch.export.notebook": "show",
    "raymarch.expr.maths": (
        "abs acos asin atan atan2 ceil clamp cos cosh cross_product distance dot exp exp2 floor fract length log log2 "
        "max min mix mod normalize pi pow sign sin sinh smoothstep sqrt step tan tanh tau vec2 vec3 vec4 where"
    ),
    "raymarch.gpu": "Frame Renderer render",
    "raymarch.gpu.probe": "Probe probe",
    "raymarch.scene": (
        "AmbientOcclusion Camera DirectionSample Fog GradientSky ImageSky Light Material Param PointLight Quality "
        "RectLight Scene Sky SphereLight SpotLight Sun SunSky Texture ToneMapping checker grid_lines marble noise "
        "planar stripes time triplanar"
    ),
    "raymarch.scene.post": "Bloom",
    "raymarch.truth": "Truth truth",
}
_SOURCES = {name: "raymarch.sdf" for name in __all__ if name != "__version__" and name not in _PACKAGES}
_SOURCES |= {name: module for module, names in _MODULES.items() for name in names.split()}
"""The module of each public name. It is imported when the name is first used."""


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        if name in _PACKAGES:
            return import_module(f"raymarch.{name}")
        if name not in _SOURCES:
            if name.startswith("_"):  # what Python and its tools look for
                raise AttributeError(f"module 'raymarch' has no attribute '{name}'")
            methods = [known for known in vars(import_module("raymarch.sdf").Node) if not known.startswith("_")]
            raise import_module("raymarch.expr.peers").unknown_function(name, [*_SOURCES, *_PACKAGES], methods)
        value = globals()[name] = getattr(import_module(_SOURCES[name]), name)
        return value


def __dir__() -> list[str]:
    return sorted({*__all__, *_BUILT_IN, *_PACKAGES, *(name for name in globals() if name.startswith("__"))})


class _Package(ModuleType):
    """This package. A public name is not replaced by a submodule of that name (`truth`), whenever that is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in _SOURCES or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
