"""A picture that cannot be vouched for says so: one line on the error stream; with --strict code 2 and no file."""

from __future__ import annotations

import pytest

from tests.support.commands import run

HEAD = "import raymarch as rm\n"
DOUBTFUL = {
    "a radius below 0": (
        "scene = rm.sphere(1 + 0.1 * rm.time)",
        ["--time", "-50"],
        "a.py:2: sphere: radius = -4.0 at time = -50 (a number > 0)",
    ),
    "a sun without a direction": (
        "scene = rm.Scene(rm.sphere(), lights=[rm.Sun(rm.Param('to sun', (0, 1, 0)))])",
        ["--set", "to sun=0,0,0"],
        "a.py:2: Sun: sun_direction = (0.0, 0.0, 0.0) at to sun = (0, 0, 0) (3 numbers, not all zero)",
    ),
    "a camera that looks away": (
        "scene = rm.Scene(rm.sphere(), rm.Camera((0, 0, 5), (0, 0, 10)))",
        [],
        "nothing is visible: no ray hits the solid, which lies between (-1, -1, -1) and (1, 1, 1)",
    ),
    "a solid that is empty": (
        "scene = rm.sphere() & rm.sphere().translate((9, 0, 0))",
        [],
        "nothing is visible: the solid is empty",
    ),
    "a solid alone that has moved out of sight": (
        "scene = rm.box(1).translate((10 * rm.time, 0, 0))",
        ["--time", "3"],
        "nothing is visible: no ray hits the solid, which lies between (29.5, -0.5, -0.5) and (30.5, 0.5, 0.5)",
    ),
    "a camera that flies away": (
        "scene = rm.Scene(rm.sphere(), rm.Camera((0, 0, 5 + 1e20 * rm.time), (0, 0, 0)))",
        ["--time", "1"],
        "a.py:2: the scene is 1e+20 units large, as its camera sees it, which float32 cannot draw at time = 1",
    ),
    "too few steps": (
        "scene = rm.Scene(rm.sphere() | rm.plane(offset=-1), rm.Camera((0, 0, 5), (0, 0, 0)),\n"
        "                 quality=rm.Quality(tracer='bracketing', max_steps=6, analytic=False))",
        [],
        "of the rays ran out of steps, and show the surface that they are near (Quality(max_steps=...), 6 now; "
        "--view iterations)",
    ),
    "a colour that is no number": (
        "from raymarch.expr.vocabulary import exp\n"
        "scene = rm.sphere().material(rm.Material(emission=lambda p: (exp(1000 * p.x), 0, 0)))",
        [],
        "have a colour that is not finite (--view nonfinite)",
    ),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", DOUBTFUL)
def test_a_doubtful_picture_is_drawn_with_a_line_and_strictly_not_at_all(folder, capsys, name):
    text, options, words = DOUBTFUL[name]
    (folder / "a.py").write_text(f"{HEAD}{text}\n")
    assert run("render", "a.py", "--size", "64x40", *options) == 0
    lines = capsys.readouterr().err.splitlines()
    doubts = [line for line in lines if line.startswith("raymarch: ")]
    assert any(words in doubt for doubt in doubts), lines
    assert len(lines) == 1 + len(doubts), "the picture's own line, and one for each doubt"
    (folder / "a.png").unlink()
    assert run("render", "a.py", "--size", "64x40", "--strict", *options) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert words in lines[0]
    assert not (folder / "a.png").exists()


SURE = {
    "a plain scene": "scene = rm.sphere(1 + 0.1 * rm.time)",
    "a sky and no end": "scene = rm.Scene(rm.plane(), rm.Camera((0, 1, 0), (0, 2, -1)))",
    "something tiny": "scene = rm.Scene(rm.sphere(0.1), rm.Camera((0, 0, 9), (0, 0, 0)))",
    "the colour of the sky": "scene = rm.Scene(rm.sphere().material(rm.Material((0, 0, 0), emission=(0.2, 0.3, 0.4),"
    " specular=0, ambient=0)), lights=[], sky=(0.2, 0.3, 0.4))",
}


@pytest.mark.parametrize("name", SURE)
def test_a_picture_without_doubts_says_nothing(folder, capsys, name):
    (folder / "a.py").write_text(f"{HEAD}{SURE[name]}\n")
    assert run("render", "a.py", "--size", "200x120", "--strict") == 0
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_each_frame_is_asked_and_the_first_doubtful_one_ends_a_strict_film(folder, capsys):
    (folder / "a.py").write_text(HEAD + "scene = rm.sphere(1 - rm.time)\n")
    film = ("render", "a.py", "-o", "f{}.png", "--frames", "0:4", "--fps", "2", "--size", "32x20")
    assert run(*film) == 0
    doubts = [line for line in capsys.readouterr().err.splitlines() if "radius" in line]
    assert [line.partition(" (")[0].rpartition("time = ")[2] for line in doubts] == ["1", "1.5"]
    assert len(list(folder.glob("f*.png"))) == 4
    for file in folder.glob("f*.png"):
        file.unlink()
    assert run(*film, "--strict") == 2
    assert sorted(p.name for p in folder.glob("f*.png")) == ["f0.png", "f1.png"]


def test_sizes_beyond_float32_are_refused(folder, capsys):
    (folder / "a.py").write_text(HEAD + "scene = rm.sphere(1e20)\n")
    assert run("render", "a.py", "--size", "32x20") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("raymarch: a.py:2: the scene is 6.54e+20 units large")
    assert "from 1e-15 to 1e+15 units" in line
    assert not (folder / "a.png").exists()


def test_solids_whose_place_float64_does_not_hold_are_refused(folder, capsys):
    """At 1e13 the picture is right; at 1e16 the box would have no width."""
    for away, code in ((1e13, 0), (1e16, 2)):
        (folder / "a.py").write_text(HEAD + f"scene = rm.sphere().translate(({away}, 0, 0))\n")
        assert run("render", "a.py", "--size", "32x20") == code
    *_, line = capsys.readouterr().err.splitlines()
    assert line.startswith("raymarch: a.py:2: solids of size 2 are 1e+16 units from the origin")
