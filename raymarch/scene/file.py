"""Scene files: plain Python that defines a module-level `scene`."""

from __future__ import annotations

import ast
import importlib
import inspect
import linecache
import os
import re
import sys
import traceback
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from raymarch.errors import Location, RaymarchError, SceneError, columns_of, is_users
from raymarch.expr.convert import described, working_directory_kept
from raymarch.scene.scene import Scene, scene_of
from raymarch.sdf.node import Node


def read(path: str | os.PathLike[str]) -> bytes:
    """The content of a scene file. SceneError if it cannot be read."""
    try:
        return Path(path).read_bytes()
    except OSError as fault:
        raise SceneError(f"cannot read scene file '{path}': {fault.strerror or fault}", legal="a Python file") from None


def load(path: str | os.PathLike[str], source: bytes | None = None) -> Scene:
    """Run a scene file in a fresh namespace and return its scene.

    The file defines `scene`: a Scene, a node (which is wrapped in a Scene), or a function without parameters that
    returns either. Modules in the folder of the file can be imported. The working directory is afterwards what it was
    before. Raises SceneError with the file and line at fault.

    source : the content of the file, if it is read already.
    """
    file = Path(path)
    source = read(file) if source is None else source
    name = str(file)
    namespace = types.ModuleType("__raymarch_scene__")
    namespace.__file__ = name
    linecache.checkcache(name)
    try:
        with working_directory_kept(), _module_beside(namespace, str(file.resolve().parent)):
            exec(_compiled(source, name), namespace.__dict__)
            scene = _find(namespace, name, source)
            scene.expressions()  # evaluates the file's own definitions, so that their errors name lines of the file
            return scene
    except RaymarchError:
        raise
    except SyntaxError as fault:
        in_a_file = fault.filename and not fault.filename.startswith("<")
        where = _place(fault) if in_a_file else _line_in(fault, name)
        raise SceneError(f"{type(fault).__name__}: {fault.msg}", where=where) from fault
    except SystemExit as fault:
        raise SceneError(
            f"the scene file exited Python (SystemExit: {fault.code})", where=_line_in(fault, name)
        ) from None
    except Exception as fault:
        what, legal = _in_our_words(fault)
        raise SceneError(what, legal=legal, where=_line_in(fault, name)) from fault


HABITS = {"rm": "import raymarch as rm", "np": "import numpy as np", "math": "import math", "pi": "rm.pi"}
"""Names that a scene file uses and forgets to import."""


def _in_our_words(fault: Exception) -> tuple[str, str]:
    """A Python exception as a fault and its cure, which is "" where none is known."""
    package, text = sys.modules.get("raymarch"), str(fault)
    what = f"{type(fault).__name__}: {text}"
    if isinstance(fault, NameError):
        known = fault.name in getattr(package, "__all__", ())
        return text, HABITS.get(str(fault.name), f"rm.{fault.name}, with import raymarch as rm" if known else "")
    if isinstance(fault, ImportError) and (named := re.match(r"cannot import name '(\w+)' from 'raymarch'", text)):
        try:
            getattr(package, named[1])
        except RaymarchError as said:
            return said.what, said.legal
    if isinstance(fault, AttributeError) and (named := re.match(r"type object '(\w+)' has no attribute '(\w+)'", text)):
        owner = getattr(package, named[1], None)
        own = [key for key, value in vars(owner).items() if isinstance(value, classmethod)] if owner else []
        return f"{named[1]} has no '{named[2]}'", ", ".join([f"{named[1]}(...)", *(f"{named[1]}.{key}" for key in own)])
    return what, _parameters(fault) if isinstance(fault, TypeError) else ""


def _parameters(fault: TypeError) -> str:
    """The parameters of the public function that was called with wrong arguments; "" for other faults."""
    called = re.match(r"(\w+)\(\) .*argument", str(fault))
    function = getattr(sys.modules.get("raymarch"), called[1], None) if called else None
    if not inspect.isfunction(function):
        return ""
    return ", ".join(inspect.signature(function).parameters)


def _compiled(source: bytes, name: str) -> types.CodeType:
    """The code of the file. SyntaxError for bytes that are no text; early versions of Python 3.11 raise ValueError."""
    try:
        return compile(source, name, "exec")
    except ValueError as fault:
        raise SyntaxError(str(fault), (name, 1, None, None)) from fault


@contextmanager
def _module_beside(namespace: types.ModuleType, folder: str) -> Iterator[None]:
    """A context in which the scene file is a registered module and modules of its folder can be imported.

    Libraries such as dataclasses look up the module. On exit the modules of the folder are removed from `sys.modules`,
    so that the next load reads them again and does not confuse them with modules of another scene.
    """
    before, writes = dict(sys.modules), sys.dont_write_bytecode
    sys.modules[namespace.__name__] = namespace
    sys.path.insert(0, folder)
    sys.dont_write_bytecode = True  # leaves no files in the user's folder
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.dont_write_bytecode = writes
        with suppress(ValueError):
            sys.path.remove(folder)
        for name in [n for n in sys.modules if n not in before]:
            source = str(getattr(sys.modules[name], "__file__", None) or "")
            if sys.modules[name] is namespace or (source.startswith(folder + os.sep) and is_users(source)):
                del sys.modules[name]


def _find(namespace: types.ModuleType, name: str, source: bytes) -> Scene:
    if not hasattr(namespace, "scene"):
        own = [key for key, value in vars(namespace).items() if isinstance(value, Node | Scene)]
        legal = (
            f"scene = {own[-1]}, or scene = rm.Scene(...)" if own else "scene = rm.Scene(...), a node, or a function"
        )
        raise SceneError("the file defines no 'scene'", legal=legal, where=Location(name, 1))
    found, where = namespace.scene, Location(name, _last_set(source))
    if callable(found) and not isinstance(found, Node | Scene | type):
        found = _called(found, where)
    if isinstance(found, Node):
        found = scene_of(found)
    if not isinstance(found, Scene):
        several = isinstance(found, list | tuple) and found and all(isinstance(each, Node) for each in found)
        legal = "rm.union(*scene), or another node" if several else "a Scene, a node, or a function giving one"
        raise SceneError(f"'scene' is {described(found)}", legal=legal, where=where)
    return found


def _last_set(source: bytes) -> int:
    """The last line that sets or defines `scene`, in a function or outside; 1 if there is none."""
    parts = list(ast.walk(ast.parse(source)))
    names = [part for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)]
    lines = [part.lineno for part in names if part.id == "scene"]
    lines += [part.lineno for part in parts if isinstance(part, ast.FunctionDef) and part.name == "scene"]
    return max(lines, default=1)


def _called(make: Callable[..., Any], where: Location) -> Any:
    """The result of a scene function. SceneError, at the line of the function, if it has required parameters."""
    code = getattr(make, "__code__", None)
    try:
        inspect.signature(make).bind()
    except TypeError as fault:
        where = Location(code.co_filename, code.co_firstlineno) if code else where
        raise SceneError(f"'scene' is a function: {fault}", legal="one without parameters", where=where) from None
    except ValueError:  # some built-in functions have no signature
        pass
    return make()


def _line_in(fault: BaseException, name: str) -> Location:
    """The innermost line of the user's code in a traceback."""
    frames = traceback.extract_tb(fault.__traceback__)
    own = [f for f in frames if f.filename == name or (is_users(f.filename) and not f.filename.startswith("<"))]
    frame = own[-1] if own else None
    if frame is None:
        return Location(name, 1)
    line = frame.lineno or 1
    return Location(frame.filename, line, columns_of(line, line, frame.end_lineno, frame.colno, frame.end_colno))


def _place(fault: SyntaxError) -> Location:
    """The place of an error of syntax."""
    line, text = fault.lineno or 1, fault.text or ""
    start = None if not fault.offset else len(text[: fault.offset - 1].encode())
    after = fault.end_offset if fault.end_offset and fault.end_offset > 0 else (fault.offset or 0) + 1
    end = len(text[: after - 1].encode())
    return Location(str(fault.filename), line, columns_of(line, line, fault.end_lineno or line, start, end))
