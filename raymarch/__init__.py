"""raymarch: signed-distance scenes in Python, compiled to one GLSL fragment shader.

import raymarch as rm

rm.render(rm.Scene(rm.box(1) - rm.sphere(0.65))).save("hello.png")
"""

from __future__ import annotations

import raymarch.startup  # noqa: F401 - first, because further imports take some tenths of a second

# isort: split
import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from raymarch.conveniences import attach

if TYPE_CHECKING:
    from raymarch import cost as cost
    from raymarch.cluster.frames import render_frames as render_frames
    from raymarch.cost import RaySamples as RaySamples
    from raymarch.cost import plot_ray as plot_ray
    from raymarch.cost import ray_samples as ray_samples
    from raymarch.errors import *
    from raymarch.export import export as export
    from raymarch.export import triangulate as triangulate
    from raymarch.export.annotated import figure as figure
    from raymarch.export.measures import Measures as Measures
    from raymarch.export.measures import measure as measure
    from raymarch.export.notebook import show as show
    from raymarch.expr.maths import *
    from raymarch.gpu import Frame as Frame
    from raymarch.gpu import Renderer as Renderer
    from raymarch.gpu import render as render
    from raymarch.gpu.probe import Probe as Probe
    from raymarch.gpu.probe import probe as probe
    from raymarch.gpu.slices import Slice as Slice
    from raymarch.proof import Proof as Proof
    from raymarch.proof import prove as prove
    from raymarch.scene import *
    from raymarch.scene.studio import studio as studio
    from raymarch.sdf import *
    from raymarch.truth import Hits as Hits
    from raymarch.truth import Truth as Truth
    from raymarch.truth import floor_evaluations as floor_evaluations
    from raymarch.truth import raycast as raycast
    from raymarch.truth import truth as truth

__version__ = "0.1.0"

_BUILT_IN = ("abs", "hash", "max", "min", "pow")
"""Public names that `from raymarch import *` leaves out, because they would hide Python's own."""

_PACKAGES = frozenset("cost errors expr glsl gpu plan scene sdf shader".split())
"""The packages that are attributes of this one without an import of their own."""

_SEARCHED = ("raymarch.errors", "raymarch.expr.maths", "raymarch.sdf", "raymarch.scene")
"""The modules whose public names are public here, too. They are imported in this order until one has the name."""

_MODULES = {
    "raymarch.cluster.frames": "render_frames",
    "raymarch.cost": "RaySamples plot_ray ray_samples",
    "raymarch.export": "export triangulate",
    "raymarch.export.annotated": "figure",
    "raymarch.export.measures": "Measures measure",
    "raymarch.export.notebook": "show",
    "raymarch.gpu": "Frame Renderer render",
    "raymarch.gpu.probe": "Probe probe",
    "raymarch.gpu.slices": "Slice",
    "raymarch.proof": "Proof prove",
    "raymarch.scene.studio": "studio",
    "raymarch.truth": "Hits Truth floor_evaluations raycast truth",
}
attach(
    {
        "render": "raymarch.gpu:render",
        "raycast": "raymarch.truth.raycast:raycast",
        "material_at": "raymarch.truth.raycast:material_at",
        "png": "raymarch.export.notebook:png",
        "for_error": "raymarch.cost:for_error",
        "for_time": "raymarch.cost:for_time",
        "warn_of_values": "raymarch.scene.legal:warn_of_values",
        "materials_by_value": "raymarch.scene.material:materials_by_value",
    }
)
_SOURCES = {name: module for module, names in _MODULES.items() for name in names.split()}
"""The module of each other public name. It is imported when the name is first used."""


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        if name in _PACKAGES:
            return import_module(f"raymarch.{name}")
        if name == "__all__":
            searched = {name for module in _SEARCHED for name in import_module(module).__all__}
            return sorted(searched.union(_SOURCES, ["__version__", "cost"]).difference(_BUILT_IN))
        if name.startswith("_"):  # what Python and its tools look for
            raise AttributeError(f"module 'raymarch' has no attribute '{name}'")
        searched = (module for module in _SEARCHED if name in import_module(module).__all__)
        module = _SOURCES.get(name) or next(searched, None)
        if module is None:
            node = vars(import_module("raymarch.sdf").Node)
            methods = [known for known, what in node.items() if callable(what) and not known.startswith("_")]
            raise import_module("raymarch.expr.peers").unknown_function(name, __dir__(), methods)
        value = globals()[name] = getattr(import_module(module), name)
        return value


def __dir__() -> list[str]:
    public = sys.modules[__name__].__all__
    return sorted({*public, *_BUILT_IN, *_PACKAGES, *(name for name in globals() if name.startswith("__"))})


_CALLS = {
    "plan": "raymarch explain SCENE.py prints the plan",
    "cost": "raymarch cost SCENE.py measures, rm.cost.compare(scene, frame) compares a frame",
    "glsl": "node.glsl() is the text of a field, raymarch explain SCENE.py --glsl that of a shader",
    "scene": "rm.Scene(node, ...)",
    "shader": "raymarch explain SCENE.py --glsl prints the shader",
}
"""What to use for a package that is called as if it were a function."""


class _Called(ModuleType):
    """A package of this one, which says what it is when it is called."""

    def __call__(self, *args: object, **kwargs: object) -> None:
        name = self.__name__.removeprefix("raymarch.")
        legal = _CALLS.get(name, "help(raymarch) lists the functions")
        raise import_module("raymarch.errors").SceneError(f"raymarch.{name} is a package", legal=legal)


class _Package(ModuleType):
    """This package. A public name is not replaced by a submodule of that name (`truth`), whenever that is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in _SOURCES or not isinstance(value, ModuleType):
            if type(value) is ModuleType and value.__name__ == f"raymarch.{name}":
                value.__class__ = _Called
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
for _module in [value for value in globals().values() if isinstance(value, ModuleType)]:  # imported before
    if _module.__name__.startswith("raymarch."):
        setattr(sys.modules[__name__], _module.__name__.rpartition(".")[2], _module)
