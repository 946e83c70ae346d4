"""Scene files: plain Python that leaves a module-level `scene`."""

from __future__ import annotations

import linecache
import os
import sys
import traceback
import types
from pathlib import Path
from typing import Any

from raymarch.errors import Location, RaymarchError, SceneError
from raymarch.scene.scene import Scene
from raymarch.sdf.node import Node

_PACKAGE = str(Path(__file__).resolve().parent.parent) + os.sep


def load(path: str | os.PathLike[str]) -> Scene:
    """Run a scene file in a fresh namespace and return its scene.

    The file leaves `scene`: a Scene, a node (which is wrapped in one), or a function without parameters that
    returns either. Modules beside the file can be imported. Raises SceneError, with the file and line at fault.
    """
    file = Path(path)
    try:
        source = file.read_bytes()
    except OSError as fault:
        raise SceneError(f"cannot read scene file '{file}': {fault.strerror or fault}", legal="a Python file") from None
    name = str(file)
    namespace = types.ModuleType("__raymarch_scene__")
    namespace.__file__ = name
    linecache.checkcache(name)
    folder = str(file.resolve().parent)
    sys.path.insert(0, folder)
    try:
        exec(compile(source, name, "exec"), namespace.__dict__)
        found = _find(namespace, name)
    except RaymarchError:
        raise
    except SyntaxError as fault:
        where = Location(fault.filename or name, fault.lineno or 0)
        raise SceneError(f"{type(fault).__name__}: {fault.msg}", where=where) from fault
    except SystemExit as fault:
        raise SceneError(
            f"the scene file ended Python (SystemExit: {fault.code})", where=_line_in(fault, name)
        ) from None
    except Exception as fault:
        raise SceneError(f"{type(fault).__name__}: {fault}", where=_line_in(fault, name)) from fault
    finally:
        sys.path.remove(folder)
    return found


def _find(namespace: types.ModuleType, name: str) -> Scene:
    where = Location(name, 1)
    if not hasattr(namespace, "scene"):
        raise SceneError(
            "the file leaves no 'scene'", legal="scene = rm.Scene(...), a node, or a function", where=where
        )
    found: Any = namespace.scene
    if callable(found) and not isinstance(found, Node | Scene | type):
        found = found()
    if isinstance(found, Node):
        found = Scene(found)
    if not isinstance(found, Scene):
        raise SceneError(
            f"'scene' is {found!r} ({type(found).__name__})",
            legal="a Scene, a node, or a function giving one",
            where=where,
        )
    return found


def _line_in(fault: BaseException, name: str) -> Location:
    """The innermost line of the user's own code in a traceback."""
    frames = traceback.extract_tb(fault.__traceback__)
    own = [f for f in frames if f.filename == name] or [f for f in frames if not f.filename.startswith(_PACKAGE)]
    frame = own[-1] if own else None
    return Location(frame.filename, frame.lineno or 0) if frame else Location(name, 0)
