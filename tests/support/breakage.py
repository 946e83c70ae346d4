"""Broken scene files of many kinds, each with the file and line at fault."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

GOOD = """import math

import raymarch as rm
from parts import RED

WIDTH = rm.Param("width", 1.0, 0.5, 2.0)
body = rm.box((WIDTH, 1.0, 1.0)).round(0.1)
ball = rm.sphere(0.65)
ring = rm.torus(major=1.0, minor=0.1).rotate(0.4, "x")
floor = rm.plane(offset=-1.0)
red = rm.Material(color=RED, shininess=50)
blue = rm.Material(color=(0.1, 0.2, 0.8))
solid = (body.material(red) - ball) | ring.material(blue)
posts = rm.union(*[rm.capsule((i, 0, 0), (i, 1, 0), 0.1) for i in range(3)], k=0.1)
sun = rm.Sun(sun_direction=(1, 2, 1.5))
lamp = rm.PointLight(position=(-3, 2, 4), intensity=8)
eye = rm.Camera(position=(2.2, 1.8, 3.8), target=(0, 0, 0))
sky = rm.Sky((0.9, 0.9, 1.0))
best = rm.Quality(max_steps=200)
scene = rm.Scene(solid | posts.translate((0, 0, -2)) | floor, camera=eye, lights=[sun, lamp], sky=sky, quality=best)
"""
PARTS = "RED = (0.8, 0.2, 0.1)\n"


@dataclass(frozen=True, slots=True)
class Break:
    """One broken state of the files: what `scene.py` and `parts.py` hold, and where the fault is.

    `file` None: no line of any file is at fault (the process was ended).
    """

    kind: str
    scene: bytes
    parts: str
    file: str | None
    line: int | None


REPLACED = {
    "a radius below 0": ("rm.sphere(0.65)", "rm.sphere(-0.65)"),
    "a radius of another type": ("rm.sphere(0.65)", "rm.sphere('big')"),
    "a radius that is no number": ("rm.sphere(0.65)", "rm.sphere(math.nan)"),
    "a vector too short": ("(0.1, 0.2, 0.8)", "(0.1, 0.2)"),
    "a colour above 1": ("(0.1, 0.2, 0.8)", "(0.1, 0.2, 8)"),
    "a size below 0": ("(WIDTH, 1.0, 1.0)", "(WIDTH, -1.0, 1.0)"),
    "a name that is not": ("(body.material", "(bodi.material"),
    "a function that is not": ("rm.torus(", "rm.torsu("),
    "an argument that is not": ("minor=0.1", "minus=0.1"),
    "an argument too many": ("rm.plane(offset=-1.0)", "rm.plane((0, 1, 0), -1.0, 3)"),
    "an axis that is not": ('0.4, "x"', '0.4, "w"'),
    "a parameter outside its range": ("1.0, 0.5, 2.0", "3.0, 0.5, 2.0"),
    "a range upside down": ("1.0, 0.5, 2.0", "1.0, 2.0, 0.5"),
    "a light of another type": ("lights=[sun, lamp]", "lights=[sun, ball]"),
    "a light without a place": ("rm.PointLight(position=(-3, 2, 4)", "rm.PointLight(position=(-3, 2)"),
    "a sun from nowhere": ("sun_direction=(1, 2, 1.5)", "sun_direction=(0, 0, 0)"),
    "a camera in its target": ("target=(0, 0, 0)", "target=(2.2, 1.8, 3.8)"),
    "steps below 1": ("max_steps=200", "max_steps=0"),
    "a sky of another type": ("rm.Sky((0.9, 0.9, 1.0))", "rm.Sky('grey')"),
    "a bracket that is not closed": ("rm.sphere(0.65)", "rm.sphere(0.65"),
    "a bracket too many": ("rm.sphere(0.65)", "rm.sphere(0.65))"),
    "a string that is not closed": ('0.4, "x")', '0.4, "x)'),
    "an operator too many": ("- ball)", "- - / ball)"),
    "a flat scene": ("rm.Scene(solid |", "rm.Scene(rm.circle(1).round(0) and rm.circle() or"),
    "a blend below 0": ("k=0.1", "k=-0.1"),
}

INSERTED = {
    "a division by 0": "x = 1 / 0",
    "a raise": "raise RuntimeError('not today')",
    "an assertion": "assert 1 > 2, 'never'",
    "a key that is not": "x = {}['colour']",
    "an index that is not": "x = [][3]",
    "a module that is not": "import no_such_module_anywhere",
    "a name from nowhere": "from math import sine",
    "a file that is not": "open('no-such-file.txt')",
    "a keyword alone": "lambda",
    "an indent": "    x = 1",
    "an end of Python": "raise SystemExit('enough')",
    "a number that is none": "x = float('one')",
    "a recursion": "(lambda f: f(f))(lambda f: f(f))",
    "a bad conversion": "rm.sphere(int('z'))",
}

WHOLE: dict[str, tuple[bytes, str | None, int | None]] = {
    "an empty file": (b"", "scene.py", 1),
    "no scene": (GOOD.replace("scene = ", "picture = ").encode(), "scene.py", 1),
    "a scene of another type": ((GOOD + "scene = 3\n").encode(), "scene.py", 1),
    "a process that ends": ((GOOD + "import os; os._exit(3)\n").encode(), None, None),
    "bytes that are no text": (GOOD.encode().replace(b"body =", b"b\xffdy ="), "scene.py", 7),
    "a function that fails": (
        GOOD.replace("scene = ", "def scene():\n    return 1 / 0\nother = ").encode(),
        "scene.py",
        len(GOOD.splitlines()) + 1,
    ),
    "a function that asks": (
        GOOD.replace("scene = ", "def scene(size):\n    return None\nother = ").encode(),
        "scene.py",
        len(GOOD.splitlines()),
    ),
}

PARTS_BROKEN = {
    "a module that fails": ("RED = (0.8, 0.2, 0.1)\nx = 1 / 0\n", 2),
    "a module with a syntax error": ("RED = (0.8, 0.2\n", 1),
    "a module that refuses": ("import raymarch as rm\nRED = (0.8, 0.2, 0.1)\nrm.sphere(-1)\n", 3),
}


def breaks(count: int, seed: int = 1) -> Iterator[Break]:
    """So many broken states, all kinds in turn, at places chosen by the seed."""
    draw = random.Random(seed)
    makers: list[Callable[[], Break]] = [
        *(lambda kind=kind: _replaced(kind) for kind in REPLACED),  # type: ignore[misc]
        *(lambda kind=kind: _inserted(kind, draw) for kind in INSERTED),  # type: ignore[misc]
        *(lambda kind=kind: Break(kind, WHOLE[kind][0], PARTS, *WHOLE[kind][1:]) for kind in WHOLE),  # type: ignore[misc]
        *(lambda kind=kind: _in_parts(kind) for kind in PARTS_BROKEN),  # type: ignore[misc]
    ]
    order = list(range(len(makers)))
    for i in range(count):
        if i % len(makers) == 0:
            draw.shuffle(order)
        yield makers[order[i % len(makers)]]()


def _replaced(kind: str) -> Break:
    old, new = REPLACED[kind]
    before = GOOD.partition(old)[0]
    assert before != GOOD, kind
    return Break(kind, GOOD.replace(old, new, 1).encode(), PARTS, "scene.py", before.count("\n") + 1)


def _inserted(kind: str, draw: random.Random) -> Break:
    lines = GOOD.splitlines()
    at = draw.randrange(4, len(lines) + 1)
    lines.insert(at, INSERTED[kind])
    return Break(kind, ("\n".join(lines) + "\n").encode(), PARTS, "scene.py", at + 1)


def _in_parts(kind: str) -> Break:
    text, line = PARTS_BROKEN[kind]
    return Break(kind, GOOD.encode(), text, "parts.py", line)
