"""Scene files: plain Python that leaves a scene, run afresh each time; a fault names the line that has it."""

from __future__ import annotations

import math
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import raymarch as rm
from raymarch.errors import Location, PlanError, SceneError
from raymarch.scene import load
from raymarch.scene.parameter import Values


def written(folder: Path, text: str, name: str = "scene.py") -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(textwrap.dedent(text), encoding="utf-8")
    return file


def radius(scene: rm.Scene) -> float:
    return float(scene.node.bounds[1][0])


# What may be left.


@pytest.mark.parametrize(
    "last",
    [
        "scene = rm.Scene(rm.sphere(2))",
        "scene = rm.sphere(2)",
        "def scene():\n    return rm.Scene(rm.sphere(2))",
        "def scene(radius=2):\n    return rm.sphere(radius)",
        "scene = lambda: rm.sphere(2)",
        "class Make:\n    def __call__(self):\n        return rm.sphere(2)\nscene = Make()",
        "from functools import partial\nscene = partial(rm.sphere, 2)",
    ],
)
def test_a_scene_is_a_scene_a_node_or_a_function_of_nothing(tmp_path: Path, last: str) -> None:
    found = load(written(tmp_path, f"import raymarch as rm\n{last}\n"))
    assert isinstance(found, rm.Scene) and radius(found) == 2


def test_a_path_may_be_text_and_relative(tmp_path: Path, monkeypatch: Any) -> None:
    file = written(tmp_path, "import raymarch as rm\nscene = rm.sphere(2)\n", "s/höhe und breite.py")
    monkeypatch.chdir(tmp_path)
    for path in (file, str(file), "s/höhe und breite.py", Path("s/höhe und breite.py")):
        found = load(path)
        assert radius(found) == 2 and found.node.where == Location(str(path), 2)


def test_nodes_know_their_line(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        """\
        import raymarch as rm
        ball = rm.sphere()
        block = rm.box(1)
        scene = ball | block
        """,
    )
    found = load(file)
    lines = {node.name: node.where for node in (found.node, *found.node.children)}
    assert lines == {n: Location(str(file), i) for n, i in (("sphere", 2), ("box", 3), ("union", 4))}


def test_a_scene_file_is_plain_python(tmp_path: Path) -> None:
    """What works in a module works here: postponed annotations, dataclasses, __file__, __name__."""
    file = written(
        tmp_path,
        """\
        from __future__ import annotations
        from dataclasses import dataclass
        from pathlib import Path
        import raymarch as rm

        @dataclass
        class Post:
            height: float = 2.0

            def node(self) -> rm.Node:
                return rm.sphere(self.height)

        assert Path(__file__).name == "scene.py"
        if __name__ == "__main__":
            raise AssertionError("not run as a script")

        def scene() -> rm.Scene:
            return rm.Scene(Post().node())
        """,
    )
    assert radius(load(file)) == 2


# Modules beside it.


def test_modules_beside_the_file_can_be_imported(tmp_path: Path) -> None:
    written(tmp_path, "import raymarch as rm\nball = rm.sphere(3)\n", "parts.py")
    written(tmp_path, "from . import size\nvalue = size.value\n", "kit/__init__.py")
    written(tmp_path, "value = 1.5\n", "kit/size.py")
    file = written(tmp_path, "import kit\nfrom parts import ball\nscene = ball.scale(kit.value)\n")
    before = list(sys.path)
    assert radius(load(file)) == 4.5
    assert sys.path == before and not {"parts", "kit", "kit.size"} & set(sys.modules)
    assert not list(tmp_path.rglob("__pycache__")), "files were left in the user's folder"


def test_two_loads_are_fresh(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        """\
        import math
        import parts
        import raymarch as rm
        parts.made.append(1)
        math.seen_by_a_scene = getattr(math, "seen_by_a_scene", 0) + 1
        scene = rm.sphere(parts.radius + 10 * len(parts.made))
        """,
    )
    written(tmp_path, "made = []\nradius = 1\n", "parts.py")
    assert radius(load(file)) == 11
    assert radius(load(file)) == 11, "the module beside the file kept its state"
    written(tmp_path, "made = []\nradius = 2\n", "parts.py")
    assert radius(load(file)) == 12, "the module beside the file was not read again"
    written(tmp_path, "import raymarch as rm\nscene = rm.sphere(7)\n")
    assert radius(load(file)) == 7
    assert math.seen_by_a_scene == 3  # type: ignore[attr-defined]  # installed modules are not imported anew
    del math.seen_by_a_scene  # type: ignore[attr-defined]


def test_two_folders_have_their_own_modules(tmp_path: Path) -> None:
    files = []
    for name, size in (("a", 2), ("b", 3)):
        written(tmp_path, f"size = {size}\n", f"{name}/parts.py")
        files.append(written(tmp_path, "import parts, raymarch\nscene = raymarch.sphere(parts.size)\n", f"{name}/s.py"))
    assert [radius(load(file)) for file in files] == [2, 3]


def test_a_scene_may_load_another(tmp_path: Path) -> None:
    written(tmp_path, "import raymarch as rm\nscene = rm.sphere(2)\n", "inner.py")
    file = written(
        tmp_path,
        """\
        from __future__ import annotations
        from dataclasses import dataclass
        from pathlib import Path
        from raymarch.scene import load
        inner = load(Path(__file__).with_name("inner.py"))

        @dataclass
        class After:
            x: float = 1.5

        scene = inner.node.scale(After().x)
        """,
    )
    assert radius(load(file)) == 3


# Faults.


def fault_of(file: Path, line: int, *words: str, where: Path | None = None) -> SceneError:
    before = list(sys.path), set(sys.modules)
    with pytest.raises(SceneError) as caught:
        load(file)
    message = str(caught.value)
    assert caught.value.where == Location(str(where or file), line), message
    for word in words:
        assert word in message
    assert (list(sys.path), {m for m in sys.modules if m.startswith("__raymarch")}) == (before[0], set())
    return caught.value


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    for path, answer in ((tmp_path / "none.py", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(SceneError, match=answer) as caught:
            load(path)
        assert str(path) in str(caught.value) and "a Python file" in str(caught.value)


OWN = """import raymarch as rm
from raymarch.expr.vocabulary import length
from raymarch.sdf.definition import cube
@rm.shape(exactness="bound", bounds=lambda: cube(1.0))
def crooked(p):
"""
"""The head of a definition, which is not run before it is asked for."""


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("import raymarch as rm\nscene = rm.sphere(\n", 2, ("SyntaxError", "never closed")),
        ("x = 1\n  y = 2\n", 2, ("IndentationError",)),
        ("def f():\n\treturn 1\n        return 2\n", 3, ("TabError",)),
        ("eval('1 +')\n", 1, ("SyntaxError",)),
        ("import raymarch as rm\n\nscene = rm.sphere(1 / 0)\n", 3, ("ZeroDivisionError", "division by zero")),
        ("def f():\n    raise ValueError('[bold]')\n\nf()\n", 2, ("ValueError: [bold]",)),
        (OWN + "    return p.length()\nscene = crooked()\n", 6, ("length",)),
        (OWN + "    return length(p) / 0.0\nscene = crooked()\n", 4, ("crooked divides by 0.0",)),
        ("import nothing_of_this_name\n", 1, ("ModuleNotFoundError", "nothing_of_this_name")),
        ("def f():\n    f()\nf()\n", 2, ("RecursionError",)),
        ("x = 1\nimport sys\nsys.exit(3)\n", 3, ("exited Python", "SystemExit: 3")),
        ("raise SystemExit\n", 1, ("exited Python",)),
        ("exit()\n", 1, ("exited Python",)),
        ("import raymarch as rm\nx = rm.sphere()\n", 1, ("defines no 'scene'", "scene = x", "scene = rm.Scene")),
        ("", 1, ("defines no 'scene'",)),
        ("x = 1\nscene = 5\n", 2, ("'scene' is 5 (int)", "a Scene, a node")),
        ("scene = None\n", 1, ("'scene' is None",)),
        ("import raymarch as rm\nscene = rm.Scene\n", 2, ("'scene' is <class", "a Scene, a node")),
        ("import raymarch as rm\nscene = [rm.sphere()]\n", 2, ("'scene' is [<sphere", "rm.union(*scene)")),
        ("scene = 1\nif True:\n    scene = {}\n", 3, ("'scene' is {}",)),
        ("def scene():\n    pass\n", 1, ("'scene' is None",)),
        ("import math\ndef scene():\n    return math.sqrt(-1)\n", 3, ("ValueError",)),
        ("x = 1\ndef scene(radius):\n    pass\n", 2, ("missing a required argument: 'radius'", "without parameters")),
        ("import raymarch as rm\n\nscene = rm.sphere(0)\n", 3, ("sphere: radius = 0", "> 0")),
        ("import raymarch as rm\ndef scene():\n    return rm.box((1, -1, 1))\n", 3, ("(1, -1, 1)", "> 0")),
        ("import raymarch as rm\nscene = rm.sphere().material('red')\n", 2, ("material = 'red'", "Material(color")),
        ("import raymarch as rm\n\nscene = rm.sphere().union(rm.box(1), k=-1)\n", 3, ("k = -1", ">= 0")),
        ("import raymarch as rm\nrm.PointLight()\n", 2, ("PointLight needs 'position'",)),
        ("import raymarch as rm\nrm.Sun(colour=(1, 1, 1))\n", 2, ("did you mean 'color'",)),
        ("import raymarch as rm\nscene = rm.Scene(rm.sphere(), camera=rm.Camera(fov=0))\n", 2, ("fov = 0",)),
        ("import raymarch as rm\n\n\nrm.Quality(max_steps=0)\n", 4, ("max_steps = 0",)),
    ],
)
def test_a_fault_names_its_line(tmp_path: Path, text: str, line: int, words: tuple[str, ...]) -> None:
    fault_of(written(tmp_path, text), line, *words)


@pytest.mark.parametrize("content", [b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", b"x = 1\0\n", b"name = 'h\xf6he'\n"])
def test_a_file_that_is_no_python(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "scene.py"
    file.write_bytes(content)
    fault_of(file, 1, "SyntaxError")


def test_a_fault_beside_the_file_names_that_file(tmp_path: Path) -> None:
    file = written(tmp_path, "import raymarch as rm\nimport parts\nscene = parts.made()\n")
    beside = written(tmp_path, "def made(:\n", "parts.py")
    fault_of(file, 1, "SyntaxError", where=beside)
    written(tmp_path, "import raymarch as rm\n\n\ndef made():\n    return rm.sphere(-1)\n", "parts.py")
    fault_of(file, 5, "sphere: radius = -1", where=beside)
    written(tmp_path, "def made():\n    return {}['key']\n", "parts.py")
    fault_of(file, 2, "KeyError: 'key'", where=beside)


def test_clashing_parameters_name_the_line_of_one(tmp_path: Path) -> None:
    text = """\
    import raymarch as rm
    a = rm.Param("r", 1, 0.5, 2)
    b = rm.Param("r", 1, 0.5, 3)
    scene = rm.sphere(a) | rm.sphere(b)
    """
    file = written(tmp_path, text)
    earlier = [rm.Param("r", 1, 0.5, most) for most in (2, 3)]  # equal ones, as before a reload
    with pytest.raises(PlanError, match="named 'r'") as caught:
        _ = load(file).parameters
    assert earlier and caught.value.where in (Location(str(file), 2), Location(str(file), 3))


def test_a_keyboard_interrupt_is_not_a_fault_of_the_scene(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        load(written(tmp_path, "raise KeyboardInterrupt\n"))


def test_loading_draws_nothing_and_changes_no_defaults(tmp_path: Path) -> None:
    found = load(written(tmp_path, "import raymarch as rm\nscene = rm.sphere(rm.Param('r', 1.5, 1, 2))\n"))
    assert list(found.parameters) == ["r"]
    assert found.pose(Values({})).position.shape == (3,)


def test_data_lies_beside_the_scene_or_in_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside, here = tmp_path / "scenes", tmp_path / "here"
    beside.mkdir()
    here.mkdir()
    monkeypatch.chdir(here)
    code = "import raymarch as rm\nscene = rm.box(1).material(rm.Material(albedo=rm.planar('grey.png')))\n"
    (beside / "scene.py").write_text(code)
    words = r"scene.py:2: planar: source: no file 'grey.png' \(tried: .*scenes.*grey.png, "
    with pytest.raises(SceneError, match=words):
        load(beside / "scene.py")
    for folder, grey in ((here, 50), (beside, 200)):  # the one beside the scene comes first
        Image.new("L", (2, 2), grey).save(folder / "grey.png")
        texture = load(beside / "scene.py").materials[1]._given["albedo"]
        assert round(float(texture.pixels.max()) * 255) == grey


@pytest.mark.parametrize(
    "call", ["rm.text('A', size=2)", "rm.marble(scale=3)", "rm.instances(rm.box(1), positions=[])"]
)
def test_a_call_with_wrong_arguments_is_answered_with_the_parameters(tmp_path: Path, call: str) -> None:
    file = tmp_path / "wrong.py"
    file.write_text(f"import raymarch as rm\nscene = {call}\n")
    with pytest.raises(SceneError) as caught:
        load(file)
    legal = {"text": "string, font, height", "marble": "a, b, scale", "instances": "node, transforms, materials"}
    assert legal[call[3:].partition("(")[0]] in str(caught.value.legal)
    assert caught.value.where == Location(str(file), 2)
