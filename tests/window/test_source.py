"""Values written into scene files: right or refused with a word, and nothing else in the file changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raymarch.scene.file import load
from raymarch.window import commands as do
from raymarch.window.edits import editable_lights, editable_material
from raymarch.window.model import Model
from raymarch.window.state import opened
from tests.window.test_commands import carried_out

HEAD = "import raymarch as rm\n"
RADIUS = {"radius": 1.25}
SPHERE = "scene = rm.Scene(rm.sphere().translate(({}, 0, 0)))\n"

# name: the lines after the import, the values, and what stands in place of what, or the word of refusal
PARAMS: dict[str, tuple[str, dict[str, Any], tuple[str, str] | str]] = {
    "a number": (SPHERE.format('rm.Param("radius", 1.0, 0.5, 2)'), RADIUS, ("1.0,", "1.25,")),
    "an integer": (SPHERE.format('rm.Param("radius", 1, 0.5, 2)'), {"radius": 2.0}, ("1,", "2,")),
    "an integer that becomes a fraction": (SPHERE.format('rm.Param("radius", 1, 0.5, 2)'), RADIUS, ("1,", "1.25,")),
    "by its name": (SPHERE.format('rm.Param(name="radius", max=2, value=1.0)'), RADIUS, ("1.0", "1.25")),
    "a negative number": (SPHERE.format('rm.Param("r", -.5, -1, 1)'), {"r": 0.25}, ("-.5", "0.25")),
    "scientific": (SPHERE.format('rm.Param("radius", 1e0, 0.5, 2)'), RADIUS, ("1e0", "1.25")),
    "imported": ("from raymarch import Param\n" + SPHERE.format('Param("radius", 1.0)'), RADIUS, ("1.0", "1.25")),
    "in lines": (
        SPHERE.format('rm.Param(  # the size\n    "radius",\n    1.0,  # of 2.0\n    0.5, 2.0)'),
        RADIUS,
        ("1.0,", "1.25,"),
    ),
    "letters of other alphabets": (
        'ü = "größe ☃"; r = rm.Param("radius", 1.0)  # né\n' + SPHERE.format("r"),
        RADIUS,
        ("1.0", "1.25"),
    ),
    "with tabs and lines of Windows": (
        'def f():\r\n\treturn rm.Param("radius",\t1.0)\r\nscene = rm.Scene(rm.sphere().translate((f(), 0, 0)))\r\n',
        RADIUS,
        ("1.0", "1.25"),
    ),
    "two equal literals": (
        'a = rm.Param("radius", 1.0)\nb = rm.Param("other", 1.0)\n' + SPHERE.format("a + b"),
        RADIUS,
        ('"radius", 1.0', '"radius", 1.25'),
    ),
    "twice the same": (
        SPHERE.format('rm.Param("radius", 1.0) + rm.Param("radius", 1.0)'),
        RADIUS,
        ('"radius", 1.0', '"radius", 1.25'),
    ),
    "a vector": (
        "scene = rm.Scene(rm.box(rm.Param('size', (1.0, 2.0, 3.0), 0.5, 4)))\n",
        {"size": (1.0, 2.5, 3.0)},
        ("2.0", "2.5"),
    ),
    "a list with a comment": (
        "scene = rm.Scene(rm.box(rm.Param('size', [1.0,  # wide\n  2.0, 3.0], 0.5, 4)))\n",
        {"size": (1.5, 2.0, 3.5)},
        ("[1.0,  # wide\n  2.0, 3.0]", "[1.5,  # wide\n  2.0, 3.5]"),
    ),
    "a name": ("R = 1.0  # the radius\n" + SPHERE.format('rm.Param("radius", R)'), RADIUS, ("R = 1.0", "R = 1.25")),
    "a name of a tuple": (
        "S = (1.0, 2.0, 3.0)\nscene = rm.Scene(rm.box(rm.Param('size', S, 0.5, 4)))\n",
        {"size": (1.0, 2.0, 0.75)},
        ("3.0", "0.75"),
    ),
    "a name that is read elsewhere": (
        "R = 1.0\n" + SPHERE.format('rm.Param("radius", R, R / 2)'),
        RADIUS,
        "radius: R is read in several places",
    ),
    "a name that is set twice": (
        "R = 2.0\nR = 1.0\n" + SPHERE.format('rm.Param("radius", R)'),
        RADIUS,
        "radius: it is computed in line 4: R",
    ),
    "computed": (SPHERE.format('rm.Param("radius", 2 * 0.5)'), RADIUS, "radius: it is computed in line 2: 2 * 0.5"),
    "a computed part": (
        "x = 1\nscene = rm.Scene(rm.box(rm.Param('size', (x + 0, 2.0, 3.0), 0.5, 4)))\n",
        {"size": (1.5, 2.0, 3.0)},
        "size: it is computed in line 3: x + 0",
    ),
    "a name in an f-string": (
        'i = 1\nscene = rm.Scene(rm.sphere().translate((rm.Param(f"radius", 1.0), 0, 0)))\n',
        RADIUS,
        "radius: its name is computed",
    ),
    "a call in an f-string": (
        "p = []\ntext = f\"{p.append(rm.Param('radius', 1.0))}\"\n" + SPHERE.format("p[0]"),
        RADIUS,
        ("1.0", "1.25"),
    ),
    "of a loop": (
        'r = [rm.Param(name, 1.0) for name in ("radius", "other")]\n' + SPHERE.format("r[0] + r[1]"),
        RADIUS,
        "radius: its name is computed",
    ),
    "annotated": (
        "R: float = 1.0\n" + SPHERE.format('rm.Param("radius", R)'),
        RADIUS,
        "radius: it is computed in line 3: R",
    ),
    "a mark at the start": ("# \ufeff é\n" + SPHERE.format('rm.Param("radius", 1.0)'), RADIUS, ("1.0", "1.25")),
    "in a function": (
        "def r(k):\n    return k * rm.Param('radius', 1.0, 0, 2)  # 1.0\n" + SPHERE.format("r(1) + r(2)"),
        RADIUS,
        ("'radius', 1.0", "'radius', 1.25"),
    ),
    "in a lambda": (
        'r = lambda: rm.Param("radius", 1.0)\n' + SPHERE.format("r()"),
        RADIUS,
        ("1.0", "1.25"),
    ),
    "as a default argument": (
        'def r(p=rm.Param("radius", 1.0)):\n    return p\n' + SPHERE.format("r()"),
        RADIUS,
        ("1.0", "1.25"),
    ),
    "a default argument of a number": (
        'def r(v=1.0):\n    return rm.Param("radius", v)\n' + SPHERE.format("r()"),
        RADIUS,
        "radius: it is computed in line 3: v",
    ),
    "a name that a function hides": (
        'v = 1.0\ndef r(v):\n    return rm.Param("radius", v)\n' + SPHERE.format("r(1.0)"),
        RADIUS,
        "radius: it is computed in line 4: v",
    ),
    "a name of a loop": (
        "for v in (1.0, 1.0):\n    r = rm.Param('radius', v)\n" + SPHERE.format("r"),
        RADIUS,
        "radius: it is computed in line 3: v",
    ),
    "a loop around a literal": (
        "for _ in range(2):\n    r = rm.Param('radius', 1.0)\n" + SPHERE.format("r"),
        RADIUS,
        ("1.0", "1.25"),
    ),
    "a continued line": ('r = \\\n  rm.Param("radius", \\\n  1.0)\n' + SPHERE.format("r"), RADIUS, ("1.0", "1.25")),
    "in brackets": (SPHERE.format('rm.Param("radius", (1.0))'), RADIUS, ("1.0", "1.25")),
    "with a plus": (SPHERE.format('rm.Param("radius", +1.0)'), RADIUS, ("+1.0", "1.25")),
    "with underscores": (SPHERE.format('rm.Param("radius", 1_0.0, 0, 20)'), RADIUS, ("1_0.0", "1.25")),
    "a choice": (SPHERE.format('rm.Param("radius", 1.0 if True else 2.0)'), RADIUS, "radius: it is computed in line 2"),
    "assigned inside": (SPHERE.format('rm.Param("radius", (v := 1.0))'), RADIUS, "radius: it is computed in line 2"),
    "from a dictionary": (
        'given = dict(value=1.0)\nscene = rm.Scene(rm.sphere().translate((rm.Param("radius", **given), 0, 0)))\n',
        RADIUS,
        "radius: value does not stand in line 3",
    ),
}


def model_of(file: Path, text: str) -> Model:
    file.write_bytes(text.encode())
    return Model(opened(file, load(file), {}, 1.6))


def written_into(model: Model, file: Path) -> tuple[bytes, str]:
    """The content of the file after it was written, and all words."""
    before = file.read_bytes()
    do.write_values(model)
    assert file.read_bytes() == before, "it was written without being shown"
    words = model.notice_text.splitlines()
    if model.draft is not None:
        words.append(model.draft.text())
        do.write_values(model)
    return file.read_bytes(), "\n".join(words)


@pytest.mark.parametrize("name", PARAMS)
def test_a_parameter_is_written_or_refused(name: str, tmp_path: Path) -> None:
    lines, values, result = PARAMS[name]
    file, text = tmp_path / "scene.py", HEAD + lines
    model = model_of(file, text)
    for parameter, value in values.items():
        do.set_param(model, parameter, value)
    content, words = written_into(model, file)
    if isinstance(result, str):
        assert content == text.encode() and result in words
        return
    assert content == text.replace(*result).encode()
    assert all(line in words for line in ("scene.py", "-", "+"))
    again = load(file)
    assert {n: again.parameters[n].value for n in values} == values


def test_the_camera_materials_and_lights_are_written(tmp_path: Path) -> None:
    text = HEAD + (
        'red = rm.Material(color="tomato",  # as the fruit\n    shininess=20.0)\n'
        "ball, cube = rm.sphere().material(red), rm.box(1).material(rm.Material((0.6, 0.6, 0.6), 8))\n"
        "two = [rm.Material(color=(0.1, 0.2, 0.3)), rm.Material(color=(0.3, 0.2, 0.1))]\n"
        "scene = rm.Scene(ball | cube.translate((2, 0, 0)) | rm.box(1).translate((4, 0, 0)).material(two[0])\n"
        "    | rm.box(1).translate((6, 0, 0)).material(two[1]),\n"
        "    camera=rm.Camera((0, 1, 6), target=(0, 0, 0)),  # from in front\n"
        "    lights=[rm.Sun((0, 1, 0)), rm.PointLight((1, 3, 2), intensity=2)])\n"
    )
    file = tmp_path / "scene.py"
    model = model_of(file, text)
    state = model.state
    materials = {i: editable_material(m) for i, m in enumerate(state.base.materials) if i}
    do.edit(model, edits_of(model, materials))
    carried_out(model)
    colors = [tuple(m.color.data) for m in state.base.materials]
    red, grey, last = (next(i for i, c in enumerate(colors) if c[0] == r) for r in (1.0, 0.6, 0.3))
    changed: dict[str, Any] = {
        f"material {red} color": (0.25, 0.5, 0.75),
        f"material {grey} shininess": 9.0,
        f"material {last} color": (0.3, 0.9, 0.1),
        f"material {red} specular": 0.9,
        "light 2 intensity": 3.5,
    }
    for name, value in changed.items():
        do.set_param(model, name, value)
    do.move(model, lambda view: replace(view, position=view.position + np.array([0.5, 0, 0]), fov=30.0))
    content, words = written_into(model, file)
    wanted = text.replace('"tomato"', "(0.25, 0.5, 0.75)").replace("0.6), 8)", "0.6), 9)")
    wanted = wanted.replace("color=(0.3, 0.2, 0.1)", "color=(0.3, 0.9, 0.1)").replace("intensity=2", "intensity=3.5")
    wanted = wanted.replace("rm.Camera((0, 1, 6)", "rm.Camera((0.5, 1, 6)")
    assert content.decode() == wanted
    assert f"material {red} specular: specular does not stand in line 2" in words
    assert "camera fov: fov does not stand in line" in words
    again = load(file)
    assert np.allclose(again.materials[last].color.data, (0.3, 0.9, 0.1))


def edits_of(model: Model, materials: dict[int, dict[str, Any]]) -> Any:
    return replace(model.state.edits, materials=materials, lights=editable_lights(model.state.base))


def test_a_file_that_changed_meanwhile_is_not_written(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    model = model_of(file, HEAD + SPHERE.format('rm.Param("radius", 1.0)'))
    do.set_param(model, "radius", 1.5)
    do.write_values(model)
    assert model.draft is not None
    file.write_text("other")
    do.write_values(model)
    assert file.read_text() == "other" and "has changed meanwhile" in model.notice_text
    do.write_values(model)
    do.escape(model)
    assert model.draft is None and file.read_text() == "other"


@pytest.mark.parametrize(("start", "encoding"), [("", "utf-8-sig"), ("# coding: latin-1\n", "latin-1")])
def test_bytes_stay_in_files_of_other_encodings(start: str, encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    text = f"{start}{HEAD}# größe\n" + SPHERE.format('rm.Param("radius", 1.0)')
    file.write_bytes(text.encode(encoding))
    model = Model(opened(file, load(file), {}, 1.6))
    do.set_param(model, "radius", 1.25)
    assert written_into(model, file)[0] == text.replace("1.0", "1.25").encode(encoding)


def test_equal_calls_in_a_line_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    lines = (
        "a, b = rm.Material(color=(1, 0, 0)), rm.Material(color=(1, 0, 0), shininess=9)\n"
        "scene = rm.Scene(rm.sphere().material(a) | rm.box(1).translate((3, 0, 0)).material(b))\n"
    )
    model = model_of(file, HEAD + lines)
    do.edit(model, edits_of(model, {1: editable_material(model.state.base.materials[1])}))
    carried_out(model)
    do.set_param(model, "material 1 color", (0.0, 1.0, 0.0))
    content, words = written_into(model, file)
    assert content == (HEAD + lines).encode() and "2 equal calls of Material stand in line 2" in words
