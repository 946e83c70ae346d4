"""A plugin of pytest that seeds a fault into every test, named by FAULT as "module:line:text": see faults.py."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from functools import cache, wraps
from pathlib import Path
from typing import Any

from raymarch import glsl

ROOT = Path(__file__).parents[2]
LONGEST = 900.0
"""Seconds for the tests of a fault; a loop that never ends is noticed too."""

TESTS = {
    "march": (
        "cost/test_ledger.py",
        "render/test_render_geometry.py",
        "render/test_cones.py",
        "render/test_resumed.py",
        "gpu/test_slices.py",
        "render/test_projection.py",
    ),
    "light": (
        "render/test_render_shading.py",
        "render/test_render_bounces.py",
        "render/test_render_tree.py",
        "render/test_render_geometry.py",
        "examples/test_papers.py",
    ),
    "normal": ("render/test_render_geometry.py",),
    "path": ("render/test_render_bounces.py", "render/test_render_tree.py"),
    "sky": ("render/test_render_shading.py", "render/test_render_bounces.py"),
    "temporal": ("render/test_temporal.py", "gpu/test_views.py"),
    "probe": ("gpu/test_probe.py", "hard/test_probe.py"),
    "view": (
        "render/test_lens.py",
        "render/test_temporal.py",
        "gpu/test_views.py",
        "render/test_resumed.py",
        "gpu/test_cycles.py",
    ),
}
"""The tests of a folder of modules, those most likely to notice first."""


FUNCTIONS = {
    "march": ("refine", "step", "range", "state", "tracer"),
    "light": ("light", "microfacet", "map", "shadow"),
    "normal": ("normal",),
    "view": ("view_passes",),
    "path": ("path",),
    "sky": ("microfacet",),
    "temporal": ("temporal",),
    "probe": ("probe",),
}
"""The files of tests/functions on a folder of modules."""


SEEDED = frozenset({"CONES"})
"""The conditional lines in which faults are seeded, beside those of a plain shader."""


def spoil(module: str, line: int, text: str) -> Any:
    """Put a text in the place of a line of a module, from 0; returns the loader as it was."""
    original = glsl.load
    number = original(module, SEEDED).numbers[line]

    @wraps(original)
    def load(name: str, variants: frozenset[str] = frozenset()) -> glsl.Module:
        found = original(name, variants)
        if name != module or number not in found.numbers:
            return found
        lines = list(found.lines)
        lines[found.numbers.index(number)] = text
        return replace(found, lines=tuple(lines))

    glsl.load = load  # type: ignore[assignment]
    return original


@cache
def red_anyhow(room: str) -> str:
    """A test of a folder of modules that is red without a fault, and would seem to notice each."""
    folder = Path(glsl.__file__).parent / room
    module = f"{room}/{min(folder.glob('*.glsl')).stem}"
    return _first_red(module, 0, glsl.load(module).lines[0])


def by_tests(module: str, line: int, text: str) -> str:
    """The first test that notices a fault; nothing if none does."""
    found = red_anyhow(module.partition("/")[0])
    assert not found, f"{found} is red without a fault"
    return _first_red(module, line, text)


def by_functions(module: str, line: int, text: str) -> str:
    """The first test of single functions that notices a fault; nothing if none does."""
    return _first_red(module, line, text, files_on_functions(module.partition("/")[0]))


def files_on_functions(folder: str) -> tuple[str, ...]:
    """The files of tests/functions on a folder of modules; each name in FUNCTIONS stands for one file or more."""
    found = {name: sorted((ROOT / "tests" / "functions").glob(f"test_{name}*.py")) for name in FUNCTIONS[folder]}
    assert all(found.values()), f"no tests of functions for {[name for name in found if not found[name]]}"
    return tuple(f"functions/{path.name}" for paths in found.values() for path in paths)


def _first_red(module: str, line: int, text: str, tests: tuple[str, ...] = ()) -> str:
    tests = tests or TESTS[module.partition("/")[0]]
    paths = [str(ROOT / "tests" / path) for path in tests]
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "tests.lab.seeded", "--no-header", *paths]
    known = {**os.environ, "FAULT": f"{module}:{line}:{text}"}
    try:
        done = subprocess.run(command, cwd=ROOT, env=known, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return "tests that do not end"
    if done.returncode == 0:
        return ""
    lines = [found for found in done.stdout.splitlines() if found.startswith(("FAILED", "ERROR"))]
    return lines[0].split(" - ")[0].partition(" ")[2] if lines else "tests that break off"


if "FAULT" in os.environ:
    _module, _line, _text = os.environ["FAULT"].split(":", 2)
    spoil(_module, int(_line), _text)
