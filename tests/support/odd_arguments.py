"""Every public function, class and method called with valid arguments but for one odd value.

A call may return, or raise an error of the package's that says what, the value, the legal range and the caller's line.
It never ends in an exception of Python's own, and never leaves what cannot be planned.
"""

from __future__ import annotations

import atexit
import decimal
import fractions
import inspect
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch import sdf
from raymarch.errors import RaymarchError
from raymarch.expr.node import expr, var
from raymarch.expr.types import VEC3
from raymarch.plan import plan
from raymarch.scene.texture import Layout
from raymarch.sdf.node import METHODS
from raymarch.shader import assemble
from tests.support.node_samples import USUAL

LONGEST = 420
"""Characters of a message, the names of files apart."""

PICTURE = np.linspace(0.0, 1.0, 48).reshape(4, 4, 3)
HEIGHTS = np.linspace(0.0, 1.0, 16).reshape(4, 4)
BALL = np.linalg.norm(np.stack(np.meshgrid(*[np.linspace(-1, 1, 8)] * 3, indexing="ij")), axis=0) - 0.7


def _fails(*_: Any) -> Any:
    raise ZeroDivisionError("by its user")


def _folder() -> Path:
    """A folder that is removed when the process ends."""
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


ODD: dict[str, Any] = {
    "None": None,
    "empty text": "",
    "text": "abc",
    "number as text": "1.5",
    "text with zero": "a\0b",
    "long text": "x" * 5000,
    "True": True,
    "nan": float("nan"),
    "inf": float("inf"),
    "-inf": float("-inf"),
    "-1": -1,
    "0": 0,
    "0.0": 0.0,
    "1e-50": 1e-50,
    "1e39": 1e39,
    "1e308": 1e308,
    "2**70": 2**70,
    "10**400": 10**400,
    "-10**5000": -(10**5000),
    "complex": 1j,
    "bytes": b"abc",
    "object": object(),
    "type": int,
    "decimal": decimal.Decimal("0.5"),
    "fraction": fractions.Fraction(1, 2),
    "empty list": [],
    "empty tuple": (),
    "ragged": [[1], [1, 2]],
    "list of texts": ["a", "b", "c"],
    "list of None": [None, None, None],
    "list with a huge integer": [1, 10**400, 1],
    "list of nan": [float("nan")] * 3,
    "list of 1e39": [1e39] * 3,
    "list of nodes": [rm.sphere()],
    "2D list": [[1, 2], [3, 4]],
    "2D array": np.ones((2, 2)),
    "2x3 array": np.arange(6.0).reshape(2, 3),
    "3x3 array": np.eye(3),
    "empty array": np.empty(0),
    "large array": np.zeros((300, 300)),
    "4D array": np.zeros((1, 1, 1, 1)),
    "nan array": np.full(3, np.nan),
    "nan 2D array": np.full((3, 3), np.nan),
    "object array": np.array([1, None, "x"], object),
    "complex array": np.ones(3) * 1j,
    "text array": np.array(["a", "b", "c"]),
    "bool array": np.array([True, False, True]),
    "structured array": np.zeros(3, [("a", float)]),
    "dict": {},
    "dict of numbers": {"x": 1},
    "set": {1, 2, 3},
    "range": range(3),
    "generator": (i for i in ()),
    "NumPy text": np.str_("abc"),
    "NumPy nan": np.float32("nan"),
    "NumPy date": np.datetime64("2020-01-01"),
    "array of nan without axes": np.array(np.nan),
    "node": rm.sphere(),
    "flat node": rm.circle(),
    "Param": rm.Param("odd", 0.5),
    "Param of a range": rm.Param("odd range", 0.5, -1.0, 1.0),
    "vector Param": rm.Param("odd vector", (0.5, 0.5, 0.5)),
    "time": rm.time,
    "vector expression": expr((0.5, 0.6, 0.7)),
    "condition": expr(0.5) < rm.time,
    "free variable": var("stray", VEC3),
    "free number": var("stray", VEC3).x,
    "lambda without parameters": lambda: 1,
    "lambda giving a text": lambda *_: "abc",
    "lambda giving None": lambda *_: None,
    "lambda that fails": _fails,
    "material": rm.Material(),
    "camera": rm.Camera(),
    "path": Path("none/such.png"),
    "folder": Path("/"),
    "exception": ValueError("x"),
    "NotImplemented": NotImplemented,
}
NUMBERS: dict[str, Callable[[float], Any]] = {
    "np.float64": np.float64,
    "np.float32": np.float32,
    "np.float16": np.float16,
    "array without axes": np.array,
}
"""Ways to say a number; each is accepted wherever a float is."""
WHOLE: dict[str, Callable[[int], Any]] = {"np.int64": np.int64, "np.uint16": np.uint16, "array without axes": np.array}
"""Ways to say a whole number."""


@dataclass(frozen=True)
class Call:
    """A function, the arguments that are valid, and how it is called."""

    name: str
    function: Callable[..., Any]
    given: dict[str, Any]

    def odd(self) -> list[str]:
        """The parameters that may be given something odd. Errors of a function that is called back are its own."""
        return [name for name in self.given if (self.name, name) not in (("triangulate", "progress"), ("hull", "*"))]

    def __call__(self, **changes: Any) -> Any:
        given = {**self.given, **changes}
        several = given.pop("*", ())
        return self.function(*several, **given)


NEEDED: dict[str, dict[str, Any]] = {
    "Scene": {"node": rm.box(1)},
    "hull": {"points": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], "*": ()},
    "Medium": {"density": 1.0, "bounds": ((-1, -1, -1), (1, 1, 1))},
    "DirectionSample": {"direction": (0, 1, 0), "distance": 1.0, "radiance": (1, 1, 1)},
    "Light": {"color": (1, 1, 1), "intensity": 1.0, "shadow": False, "softness": 0.0, "penumbra": "cone"},
    "PointLight": {"position": (0, 3, 0)},
    "SpotLight": {"position": (0, 3, 0)},
    "SphereLight": {"position": (0, 3, 0)},
    "RectLight": {"position": (0, 3, 0)},
    "instances": {"transforms": [(0, 0, 0), (2, 0, 0)]},
    "Param": {"name": "p", "value": 0.5, "min": 0.0, "max": 1.0},
    "checker": {"a": 0.1, "b": 0.9},
    "grid_lines": {"a": 0.1, "b": 0.9},
    "marble": {"a": 0.1, "b": 0.9},
    "stripes": {"a": 0.1, "b": 0.9},
    "noise": {"a": 0.1, "b": 0.9},
    "planar": {"source": PICTURE},
    "triplanar": {"source": PICTURE},
    "Layout": {"axis": "x"},
    "grid": {"values": BALL},
    "isosurface": {"values": BALL, "level": 0.0},
    "heightmap": {"source": HEIGHTS},
    "image": {"source": HEIGHTS},
    "text": {"string": "a", "resolution": 16},
    "mesh": {"source": "none.stl"},
    "displace_by_image": {"source": HEIGHTS},
    "displace_by": {"function": lambda p: 0.1 * p.x, "amplitude": 0.1, "lipschitz": 1.0},
    "warp": {"function": lambda p: 0.1 * p.zyx, "amplitude": 0.1, "lipschitz": 1.1},
    "glsl_node": {"code": "float level(vec3 p) { return p.y; }", "name": "level"},
    "fold_fractal": {"fold": lambda z, growth, p: (2.0 * z - p, 2.0 * growth)},
    "repeat_varied": {"build": lambda cell: rm.sphere(0.3), "spacing": 1.0},
    "translate": {"offset": (1, 2, 3)},
    "rotate": {"angle": 0.5},
    "scale": {"factor": 2.0},
    "transform": {"matrix": np.eye(4)},
    "mirror": {"axis": "x"},
    "repeat": {"spacing": 3.0, "count": 3},
    "repeat_mirrored": {"spacing": 3.0, "count": 3},
    "repeat_interval": {"spacing": 3.0, "first": 0, "last": 2},
    "polar": {"count": 5},
    "round": {"radius": 0.1},
    "shell": {"thickness": 0.1},
    "offset": {"distance": 0.1},
    "elongate": {"extent": (1, 1, 1)},
    "material": {"material": rm.Material()},
    "transition": {"start": (0, -1, 0), "end": (0, 1, 0)},
    **{name: dict(given) for name, given in USUAL.items()},
    "plane_fold": {"normal": (1, 0, 0), "z": var("p", VEC3)},
    "box_fold": {"z": var("p", VEC3)},
    "ball_fold": {"z": var("p", VEC3), "growth": 1.0},
    "ImageSky": {"source": Path(__file__).parents[2] / "docs" / "pictures" / "hard-camera-inside-a-solid.png"},
    "hash": {"cell": var("p", VEC3)},
    **{name: {"p": var("p", VEC3)} for name in "value_noise gradient_noise worley fbm ridged turbulence".split()},
    "implicit": {"function": lambda p: rm.dot(p, p) - 1.0, "bounds": 1.5},
    "wrap_around": {"start": -3.0, "end": 3.0},
    "export": {"scene": rm.box(1), "path": _folder() / "made.glsl"},
    "triangulate": {"scene": rm.box(1), "cells": 4},
    "show": {"scene": rm.box(1)},
    "sampled": {"values": BALL},
    "colormap": {"value": 0.5},
    "Slice": {"normal": (0, 1, 0)},
    "tube": {"points": [(0, 0, 0), (1, 0, 0)]},
    "cone_between": {"a": (0, 0, 0), "b": (1, 1, 0)},
    "round_cone_between": {"a": (0, 0, 0), "b": (1, 1, 0)},
    "measure": {"part": rm.box(1), "cells": 4},
    "floor_evaluations": {"scene": rm.box(1), "size": (4, 3)},
    "raycast": {"scene": rm.box(1), "origins": (0, 0, 5), "directions": (0, 0, -1)},
    "material_at": {"node": rm.box(1), "points": (0, 0, 1), "time": 0.5, "params": {}},
}
NEEDED |= {name: {"x": 0.5} for name in "acos asin atan ceil cos cosh exp exp2 floor fract log log2 sign sin".split()}
NEEDED |= {name: {"x": 0.5} for name in "sinh sqrt tan tanh".split()}
NEEDED |= {
    "atan2": {"y": 1.0, "x": 0.5},
    "mod": {"x": 1.0, "y": 0.3},
    "clamp": {"x": 0.5, "low": 0.0, "high": 1.0},
    "mix": {"a": 0.0, "b": 1.0, "t": 0.5},
    "step": {"edge": 0.0, "x": 1.0},
    "smoothstep": {"low": 0.0, "high": 1.0, "x": 0.5},
    "where": {"condition": True, "a": 1.0, "b": 2.0},
    "length": {"v": (1.0, 2.0, 3.0)},
    "normalize": {"v": (1.0, 2.0, 3.0)},
    "vec2": {"*": (1.0, 2.0)},
    "vec3": {"*": (1.0, 2.0, 3.0)},
    "vec4": {"*": (1.0, 2.0, 3.0, 4.0)},
} | {name: {"a": (1.0, 2.0, 3.0), "b": (0.0, 1.0, 0.0)} for name in ("dot", "distance", "cross_product")}
FLAT = ("extrude", "revolve", "extrude_to", "stroke")
UNCALLED = {
    "Node",
    "Frame",
    "Truth",
    "Hits",
    "Measures",
    "RaySamples",
    "TracerState",
    "Probe",
    "Proof",
    "Texture",
    "shape",
    "operator",
    "cost",
    "time",
    "pi",
    "tau",
    "__version__",
}
"""Names that are no function that takes values, or that are made by others; those with a device are tried with one."""
WITH_DEVICE = {"Renderer", "render", "render_frames", "probe", "prove", "truth", "ray_samples", "plot_ray", "figure"}


def calls() -> Iterator[Call]:
    """All public functions, classes and methods of nodes."""
    solid, plane = rm.box(1), rm.rectangle()
    for name in rm.__all__:
        function = getattr(rm, name)
        if callable(function) and name not in UNCALLED | WITH_DEVICE and not _is_error(function):
            yield _call(name, function, solid, plane)
    yield _call("Layout", Layout, solid, plane)
    for name in METHODS:
        if name not in rm.__all__ and callable(getattr(sdf, name, None)):
            yield _call(name, getattr(sdf, name), solid, plane)
    for name in METHODS:
        if hasattr(rm.Node, name) and not name.startswith("evaluate"):
            node = plane if name in FLAT else solid
            given = _call(name, METHODS[name], solid, plane).given
            own = dict(list(given.items())[1:]) if "*" not in given else {**given, "*": (rm.sphere(),)}
            if "b" in own:
                own["other"] = own.pop("b")
            yield Call(f"node.{name}", getattr(node, name), own)
    for name in ("distance", "gradient"):
        yield Call(f"node.{name}", getattr(solid, name), {"points": (0.0, 1.0, 2.0)})
    yield Call("node.material_at", solid.material_at, {"points": (0, 0, 1), "time": 0.5, "params": {}})
    yield Call("node.raycast", solid.raycast, {"origins": (0, 0, 5), "directions": (0, 0, -1)})
    for name in ("__or__", "__and__", "__sub__", "__xor__"):
        yield Call(f"node.{name}", lambda other, name=name: getattr(solid, name)(other), {"other": rm.sphere()})
    scene = rm.Scene(solid)
    for name, value in scene.arguments().items():
        yield Call(f"scene.replace {name}", scene.replace, {name: value})
    yield Call("Quality.preset", rm.Quality.preset, {"name": "fine"})
    yield Call("SunSky.sun", rm.SunSky().sun, {"intensity": 2.0})


def _is_error(function: Any) -> bool:
    return isinstance(function, type) and issubclass(function, BaseException)


def _call(name: str, function: Any, solid: rm.Node, plane: rm.Node) -> Call:
    given: dict[str, Any] = {}
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is parameter.VAR_POSITIONAL:
            given["*"] = NEEDED.get(name, {}).get("*", (solid, rm.sphere()))
        elif parameter.name in NEEDED.get(name, {}):
            given[parameter.name] = NEEDED[name][parameter.name]
        elif parameter.default is not parameter.empty:
            given[parameter.name] = parameter.default
        elif parameter.name in ("node", "a", "child", "solid"):
            given[parameter.name] = plane if name in FLAT else solid
        elif parameter.name in ("other", "b"):
            given[parameter.name] = rm.circle() if name in FLAT else rm.sphere()
    return Call(name, function, given)


def fault_of(call: Callable[[], Any], file: str) -> str | None:
    """What is wrong with how a call ends; None if nothing is."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            made = call()
            _used(made)
    except RaymarchError as refused:
        message = str(refused)
        if refused.where is None or refused.where.file != file:
            return f"names the line {refused.where}: {message}"
        if not refused.legal:
            return f"says no legal range: {message}"
        if len(message) - len(file) > LONGEST or "\n" in message:
            return f"says too much: {len(message)} characters, {message[:200]}"
        return None
    except rm.SceneWarning:
        return None
    except Exception as fault:
        return f"{type(fault).__name__}: {str(fault)[:150]}"
    return None


def _used(made: Any) -> None:
    """What was accepted can be planned and written out."""
    if isinstance(made, rm.Node) and not made.facts.empty:
        made.glsl()
        if made.dimension == 3 and made.label is not None:
            rm.Scene(made)
    elif isinstance(made, rm.Scene):
        assemble(plan(made)).text()
    elif isinstance(made, rm.Sun | rm.PointLight):
        assemble(plan(rm.Scene(rm.box(1), lights=[made]))).text()
