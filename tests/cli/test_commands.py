"""The commands as a user types them: pictures, exit codes, one message, nothing half-written."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.cli.commands import main
from raymarch.cli.views import CHOICES, Shown, shown
from raymarch.cost.effects import evaluations_of
from raymarch.gpu.renderer import Renderer
from raymarch.plan.passes import DRAWN
from tests.support.commands import files, run

HELLO = "import raymarch as rm\nscene = rm.union(rm.sphere(rm.Param('radius', 1, 0.5, 2)), rm.box(1.5), k=0.01)\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hello.py").write_text(HELLO)
    return tmp_path


# What works


def test_a_picture_of_the_size_asked_for(folder):
    assert run("render", "hello.py", "--size", "64x40") == 0
    with Image.open("hello.png") as picture:
        assert picture.size == (64, 40)
        assert picture.format == "PNG"
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 10
    assert files(folder) == {"hello.py", "hello.png"}


@pytest.mark.parametrize(("ending", "kind"), [("png", "PNG"), ("jpg", "JPEG"), ("webp", "WEBP"), ("TIFF", "TIFF")])
def test_the_ending_chooses_the_format(folder, ending, kind):
    assert run("render", "hello.py", "-o", f"a.{ending}", "--size", "16x9") == 0
    with Image.open(f"a.{ending}") as picture:
        assert picture.format == kind


VIEWED = HELLO + "scene = rm.Scene(scene, quality=rm.Quality(tracer='bracketing'))\n"
"""By a tracer that undoes steps, and has errors of more than a ten-thousandth of a pixel."""
LIT = """scene = scene.replace(
    lights=[rm.Sun(shadow=True)], occlusion=rm.AmbientOcclusion(), sky=rm.Sky(light=True), bounces=1
)
"""


@pytest.mark.parametrize("view", [name for name in CHOICES if name != "cycles"])
def test_every_view(folder, view):
    (folder / "viewed.py").write_text(VIEWED + LIT * view.endswith("_evaluations"))
    assert run("render", "viewed.py", "-o", "a.png", "--view", view, "--size", "48x32") == 0
    with Image.open("a.png") as picture:
        assert picture.width == 48
        barred = view not in ("final", "normal", "shading_normal", "position", "material", "boxes")
        assert (picture.height > 32) == barred, "a bar where it is due"
        shown = np.asarray(picture.convert("L"), int)[:32]
    assert shown.max() > shown.min()


PLANTED = """import raymarch as rm
from raymarch.expr.vocabulary import length, log, max


@rm.shape(exactness="exact", bounds=lambda: ((-1, -1, -1), (1, 1, 1)))
def planted(p):
    return max(1.5 * (length(p) - 1), log(p.x) - 200)


scene = planted() | rm.plane(offset=-1)
"""


def test_the_probe_names_node_and_line(folder, capsys):
    Path("planted.py").write_text(PLANTED)
    assert run("render", "planted.py", "-o", "a.png", "--view", "nonfinite", "--size", "24x16") == 0
    (sentence,) = capsys.readouterr().out.splitlines()
    assert sentence.startswith("planted, planted.py:10: the logarithm of 0 or less, ") and "pixel (" in sentence
    assert run("render", "planted.py", "-o", "a.png", "--view", "lipschitz", "--size", "24x16") == 0
    (sentence,) = capsys.readouterr().out.splitlines()
    assert sentence.startswith("planted, planted.py:10: slope 1.") and "exceeds the Lipschitz bound 1 at" in sentence
    for view, words in (("nonfinite", "no value at fault: "), ("lipschitz", "no slope exceeds its Lipschitz bound: ")):
        assert run("render", "hello.py", "-o", "a.png", "--view", view, "--size", "24x16") == 0
        assert capsys.readouterr().out.startswith(words)


def test_the_evaluations_of_all_rays_are_those_of_the_command_cost():
    scene = rm.Scene(rm.torus(1, 0.3) | rm.plane(offset=-1), lights=[rm.Sun(shadow=True)])
    with Renderer((24, 16)) as renderer:
        numbers = shown(renderer, renderer.render(scene), "all_evaluations", scene, {}).numbers()
        assert numbers.shape == (16, 24, 3) and np.ptp(numbers, axis=-1).max() == 0.0
        assert numbers.mean() == pytest.approx(evaluations_of(scene, renderer), rel=1e-6)


def test_the_evaluations_of_each_kind_add_up():
    """Nothing is counted twice, shadows of bounces are shadows, and occlusion takes its samples at each hit."""
    scene = rm.Scene(
        rm.torus(1, 0.3) | rm.plane(offset=-1),
        lights=[rm.Sun(shadow=True), rm.PointLight((0, 3, 0), shadow=True)],
        occlusion=rm.AmbientOcclusion(steps=4),
    )
    with Renderer((24, 16)) as renderer:

        def counted(of: rm.Scene, view: str) -> np.ndarray:
            return shown(renderer, renderer.render(of), view, of, {}).numbers()[..., 0]

        kinds = {kind: counted(scene, f"{kind}_evaluations") for kind in ("all", "shadow", "occlusion", "bounce")}
        bare = scene.replace(lights=[rm.Sun()], occlusion=None)
        assert np.all(kinds["occlusion"] == 4.0)
        assert np.all(kinds["shadow"] >= 0.0) and kinds["shadow"].mean() > 1.0
        assert np.all(kinds["bounce"] == 0.0)
        np.testing.assert_array_equal(
            kinds["shadow"] + kinds["occlusion"] + counted(bare, "all_evaluations"), kinds["all"]
        )
        mirror = scene.replace(node=scene.node.material(rm.Material(metalness=1, roughness=0)), bounces=1)
        kinds = {kind: counted(mirror, f"{kind}_evaluations") for kind in ("all", "shadow", "occlusion", "bounce")}
        frame = renderer.render(mirror)
        rest = kinds["all"] - kinds["shadow"] - kinds["occlusion"] - kinds["bounce"]
        assert kinds["bounce"].mean() > 1.0
        np.testing.assert_array_equal(rest, frame.evaluations + np.isfinite(frame.depth))  # and the normal of a hit


@pytest.mark.parametrize(
    "view",
    ["evaluations", "all_evaluations", "shadow_evaluations", "slice", "boxes", "error", "nonfinite", "lipschitz"],
)
def test_views_are_written_as_numbers_too(folder, view):
    assert run("render", "hello.py", "-o", "a.exr", "--view", view, "--size", "24x16") == 0
    assert files(folder) == {"hello.py", "a.exr"}


def test_cycles_are_shown_or_refused(folder, capsys):
    """Whether the driver has a clock for shaders depends on the machine; there is no third way."""
    with Renderer((8, 8)) as renderer:
        known = "GL_ARB_shader_clock" in renderer.context.gl.extensions
    assert run("render", "hello.py", "-o", "a.png", "--view", "cycles", "--size", "48x32") == (0 if known else 2)
    assert files(folder) == ({"hello.py", "a.png"} if known else {"hello.py"})
    if not known:
        assert "has no GL_ARB_shader_clock" in capsys.readouterr().err


def test_a_driver_without_a_shader_clock_is_bad_input(folder, capsys, monkeypatch):
    lacking = {**DRAWN, "cycles": replace(DRAWN["cycles"], extension="GL_ARB_nosuch")}
    monkeypatch.setattr("raymarch.plan.passes.DRAWN", lacking)
    assert run("render", "hello.py", "-o", "a.png", "--view", "cycles", "--size", "48x32") == 2
    assert "has no GL_ARB_nosuch" in capsys.readouterr().err
    assert files(folder) == {"hello.py"}


def test_the_plane_of_a_slice_can_be_chosen(folder):
    """The last is one that the camera does not see at all."""
    for text, file in (("y=0", "y.png"), ("x = 0.1", "x.png"), ("0,0,2=0.5", "z.png"), ("z=99", "behind.png")):
        assert run("render", "hello.py", "-o", file, "--view", "slice", "--slice", text, "--size", "48x32") == 0
    shown = {f: np.asarray(Image.open(f).convert("L"), int)[:32] for f in ("x.png", "y.png", "z.png", "behind.png")}
    assert not shown["behind.png"].any()
    assert len({v.tobytes() for v in shown.values()}) == 4


def test_a_parameter_changes_the_picture_and_a_frame_depends_on_time(folder):
    (folder / "moving.py").write_text("import raymarch as rm\nscene = rm.sphere(0.5).translate((rm.time, 0, 0))\n")
    assert run("render", "hello.py", "-o", "small.png", "--set", "radius=0.5", "--size", "32x20") == 0
    assert run("render", "hello.py", "-o", "large.png", "--set", "radius=2", "--size", "32x20") == 0
    assert run("render", "moving.py", "-o", "at0.png", "--size", "32x20") == 0
    assert run("render", "moving.py", "-o", "at1.png", "--time", "0.5", "--size", "32x20") == 0
    pictures = {n: Path(f"{n}.png").read_bytes() for n in ("small", "large", "at0", "at1")}
    assert pictures["small"] != pictures["large"]
    assert pictures["at0"] != pictures["at1"]


def test_frames(folder):
    (folder / "moving.py").write_text("import raymarch as rm\nscene = rm.sphere(0.5).translate((rm.time, 0, 0))\n")
    assert run("render", "moving.py", "-o", "f-{:03d}.png", "--frames", "2:5", "--fps", "10", "--size", "32x20") == 0
    assert {f for f in files(folder) if f.startswith("f-")} == {"f-002.png", "f-003.png", "f-004.png"}
    assert run("render", "moving.py", "-o", "one.png", "--time", "0.3", "--size", "32x20") == 0
    with Image.open("one.png") as one, Image.open("f-003.png") as same:  # compressed more
        assert np.array_equal(one, same) and one.text == same.text


def test_a_parameter_goes_from_one_value_to_another_over_the_frames(folder, capsys):
    swept = ["render", "hello.py", "--size", "24x16", "--set", "radius=0.5:2"]
    assert run(*swept, "-o", "s{}.png", "--frames", "0:3") == 0
    for i, radius in enumerate((0.5, 1.25, 2)):
        assert run("render", "hello.py", "--size", "24x16", "-o", "one.png", "--set", f"radius={radius}") == 0
        assert np.array_equal(Image.open("one.png"), Image.open(f"s{i}.png"))
    capsys.readouterr()
    assert run(*swept[:-1], "radius=0.5:1.5", "-o", "s{}.png", "--frames", "0:2") == 0
    said = capsys.readouterr().err.splitlines()
    assert "is already drawn" in said[0] and "to draw" in said[1], "each frame has the value of its own"
    assert run(*swept[:-1], "radius=0.5:9", "-o", "s{}.png", "--frames", "0:2") == 2
    assert "'radius' = 9 (a number >= 0.5 and <= 2)" in capsys.readouterr().err


def test_an_output_without_a_letter_of_the_text(folder):
    """Of a file name, a Param or a sign such as an infinity; the encoding of a pipe may be ASCII or that of Windows."""
    (folder / "scène.py").write_text(HELLO, encoding="utf-8")
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "raymarch", "explain", "scène.py"]
    done = subprocess.run(command, env=ascii_only, cwd=folder, capture_output=True, timeout=180)
    assert done.returncode == 0 and b"sc\\xe8ne.py" in done.stdout, done.stderr


def test_explain_says_what_is_used_and_what_is_not(folder, capsys):
    assert run("explain", "hello.py") == 0
    text = capsys.readouterr().out
    assert "sun light" in text.partition("Left out")[0]
    assert re.search(r"^  hard shadows +no light has shadow=True$", text.partition("Left out")[2], re.MULTILINE)
    names = [line[2:].split("  ")[0] for line in text.splitlines() if line.startswith("  ")]
    assert "light/surface" in names and "view/camera" in names, "two spaces part a name and its text"
    assert "radius" in text
    assert run("explain", "hello.py", "--glsl") == 0
    glsl = capsys.readouterr().out
    assert glsl.startswith("#version 330 core")
    assert "shadow" not in glsl
    assert run("explain", "hello.py", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["glsl"] == glsl
    assert found["field"]["exactness"] == "bound"
    assert [p["name"] for p in found["passes"]] == ["color"]
    assert all(f["reason"] for f in found["features"])


def test_doctor_names_each_backend(folder, capsys):
    assert run("doctor", "--json") == 0
    reports = {r["backend"]: r for r in json.loads(capsys.readouterr().out)}
    assert set(reports) == {"egl", "osmesa", "window"}
    assert reports["egl"]["works"]
    assert run("doctor") == 0
    assert "clock" in capsys.readouterr().out


def test_prove_says_what_is_proved(folder, capsys):
    where = ("--size", "32x18", "-o", "proof.png", "--json", "proof.json")
    assert run("prove", "hello.py", *where, "--strict") == 0
    assert capsys.readouterr().out.startswith("576 of 576 pixels proved at 32x18: nothing deeper than 0.05 px")
    found = json.loads((folder / "proof.json").read_text())
    assert found["proved"] == 576 and found["contradicted"] == found["open"] == 0 and found["tolerance"] == "0.05px"
    with Image.open(folder / "proof.png") as picture:
        assert picture.size == (32, 18)
    assert run("prove", "hello.py", "--size", "4x3", "--shadows") == 0
    assert "no light has a hard shadow" in capsys.readouterr().out
    for wrong in (("--tolerance", "0px"), ("--json", "proof.txt"), ("-o", "proof.jpg"), ("--size", "3")):
        assert run("prove", "hello.py", *wrong) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("command", [[], ["render"], ["explain"], ["doctor"], ["prove"]])
def test_help(folder, command, capsys):
    assert run(*command, "--help") == 0
    assert "Usage" in capsys.readouterr().out


# What does not


def scene_with(body: str) -> dict[str, str]:
    return {"bad.py": f"import raymarch as rm\nimport numpy as np\n{body}\n"}


BAD_SCENES = {
    "no scene": ("x = 1", 1, "no 'scene'"),
    "python error": ("scene = rm.sphere(1 / 0)", 3, "ZeroDivisionError"),
    "syntax error": ("scene = rm.sphere(", 3, "SyntaxError"),
    "import error": ("import nosuchmodule", 3, "nosuchmodule"),
    "wrong type": ("scene = rm.Scene(3)", 3, "3 (int)"),
    "scene of a wrong type": ("scene = [1]", 3, "[1]"),
    "not a number": ("scene = rm.sphere('big')", 3, "'big'"),
    "zero size": ("scene = rm.box((1, 0, 1))", 3, "(1, 0, 1)"),
    "negative size": ("scene = rm.sphere(-1)", 3, "-1"),
    "flat": ("scene = rm.circle()", 3, "circle is flat"),
    "flat, far down": ("def disc():\n    return rm.circle()\n\nscene = disc()", 4, "circle is flat"),
    "too small for float32": ("scene = rm.sphere(1e-300)", 3, "radius = 1e-300 is 0 in float32 (a number > 0)"),
    "too large for float32": ("scene = rm.sphere(1e39)", 3, "radius = 1e+39 is infinite in float32 (a number > 0)"),
    "negative k": ("scene = rm.union(rm.sphere(), rm.box(1), k=-0.5)", 3, "-0.5"),
    "nan": ("scene = rm.sphere(float('nan'))", 3, "nan"),
    "infinity": ("scene = rm.sphere().translate((float('inf'), 0, 0))", 3, "inf"),
    "singular matrix": ("scene = rm.sphere().transform(np.diag([1, 1, 0, 1]))", 3, "singular"),
    "up parallel": ("scene = rm.Scene(rm.sphere(), rm.Camera((0, 5, 0), (0, 0, 0)))", 3, "parallel"),
    "fov 0": ("scene = rm.Scene(rm.sphere(), rm.Camera(fov=0))", 3, "fov = 0"),
    "fov 180": ("scene = rm.Scene(rm.sphere(), rm.Camera(fov=180))", 3, "fov = 180"),
    "eye is target": ("scene = rm.Scene(rm.sphere(), rm.Camera((1, 1, 1), (1, 1, 1)))", 3, "target"),
    "unknown parameter of a node": ("scene = rm.sphere(size=3)", 3, "'size'"),
    "clashing parameters": (
        "scene = rm.sphere(rm.Param('a', 1, 0.5, 2)) | rm.box(rm.Param('a', 1, 0.5, 3))",
        3,
        "'a'",
    ),
    "too many shapes": (
        "scene = rm.Scene(rm.union(*[rm.sphere(0.1).translate((i, 0, 0)) for i in range(3000)]), "
        "quality=rm.Quality(objects='text'))",
        3,
        "3000",
    ),
    "light without a direction": ("scene = rm.Scene(rm.sphere(), lights=[rm.Sun((0, 0, 0))])", 3, "(0, 0, 0)"),
}


@pytest.mark.parametrize("name", BAD_SCENES)
def test_a_bad_scene_ends_with_its_own_line(folder, capsys, name):
    body, line, words = BAD_SCENES[name]
    for file, text in scene_with(body).items():
        (folder / file).write_text(text)
    (folder / "out.png").write_bytes(b"old")
    assert run("render", "bad.py", "-o", "out.png", "--size", "16x9") == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"raymarch: bad.py:{line}: "), err
    assert words in err
    assert "Traceback" not in err
    assert len(err.strip().splitlines()) == 1
    assert files(folder) == {"hello.py", "bad.py", "out.png"}
    assert (folder / "out.png").read_bytes() == b"old"


BAD_CALLS = {
    "missing file": (["render", "nosuch.py"], "nosuch.py"),
    "a folder": (["render", "."], "'.'"),
    "size 0": (["render", "hello.py", "--size", "0x5"], "0x5"),
    "size without x": (["render", "hello.py", "--size", "5"], "--size 5"),
    "size beyond the driver": (["render", "hello.py", "--size", "99999x5"], "99999"),
    "unknown parameter": (["render", "hello.py", "--set", "nosuch=1"], "hello.py:2: unknown parameter 'nosuch' = 1"),
    "parameter out of range": (["render", "hello.py", "--set", "radius=9"], "hello.py:2: parameter 'radius' = 9"),
    "parameter of a wrong size": (["render", "hello.py", "--set", "radius=1,2"], "radius"),
    "parameter without value": (["render", "hello.py", "--set", "radius"], "NAME=VALUE"),
    "parameter of a wrong size by a color": (["render", "hello.py", "--set", "radius=red"], "a number >= 0"),
    "parameter without number": (["render", "hello.py", "--set", "radius=big"], "radius=big"),
    "unknown view": (["render", "hello.py", "--view", "x"], "--view x"),
    "a slice of another view": (["render", "hello.py", "--slice", "y=0"], "--slice together with --view final"),
    "a slice without a number": (["render", "hello.py", "--view", "slice", "--slice", "y"], "--slice y"),
    "a slice of no axis": (["render", "hello.py", "--view", "slice", "--slice", "w=1"], "--slice w=1"),
    "a slice without a normal": (["render", "hello.py", "--view", "slice", "--slice", "0,0,0=1"], "--slice 0,0,0=1"),
    "a slice at infinity": (["render", "hello.py", "--view", "slice", "--slice", "y=inf"], "--slice y=inf"),
    "unknown backend": (["render", "hello.py", "--backend", "x"], "'x'"),
    "a folder in a file": (["render", "hello.py", "-o", "hello.py/a.png"], "hello.py/a.png"),
    "no such format": (["render", "hello.py", "-o", "a.xyz"], "a.xyz"),
    "frames backwards": (["render", "hello.py", "-o", "a{}.png", "--frames", "5:2"], "5:2"),
    "a sweep of one picture": (["render", "hello.py", "--set", "radius=1:2"], "without --frames"),
    "a sweep of three": (["render", "hello.py", "--set", "radius=1:2:3", "--frames", "0:2", "-o", "a{}.png"], "1:2:3"),
    "a sweep of a mesh": (["export", "hello.py", "-o", "a.stl", "--set", "radius=1:2"], "raymarch render --frames"),
    "a mesh by render": (["render", "hello.py", "-o", "a.stl"], "`raymarch export` writes it"),
    "a picture by export": (["export", "hello.py", "-o", "a.png"], "`raymarch render` writes it"),
    "frames into one file": (["render", "hello.py", "-o", "a.png", "--frames", "0:2"], "a.png"),
    "time is nan": (["render", "hello.py", "--time", "nan"], "time = nan"),
    "frames and time": (["render", "hello.py", "-o", "a{}.png", "--frames", "0:2", "--time", "1"], "--time"),
    "two outputs of explain": (["explain", "hello.py", "--json", "--glsl"], "--json"),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_bad_call_says_what_is_wrong(folder, capsys, name):
    call, words = BAD_CALLS[name]
    assert run(*call) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert len(err.strip().splitlines()) == 1
    assert files(folder) == {"hello.py"}


WRONG_USAGE = {
    "nosuch": "No such command 'nosuch' (raymarch --help)",
    "render": "Missing argument 'SCENE.py' (raymarch render --help)",
    "render hello.py --nosuch": "No such option: --nosuch (raymarch render --help)",
    "render hello.py --time x": "--time x (a number; raymarch render --help)",
    "render hello.py --samples 1.5": "--samples 1.5 (an integer; raymarch render --help)",
    "cost hello.py --repeats=0": "--repeats 0 (greater than or equal to 1; raymarch cost --help)",
}


@pytest.mark.parametrize("call", WRONG_USAGE)
def test_wrong_usage_is_one_line_and_code_2(folder, capsys, call):
    assert run(*call.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.strip().splitlines()
    assert line.startswith(f"raymarch: {WRONG_USAGE[call]}")


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("raymarch pr", ["prove"]),
        ("raymarch export --shad", ["--shadertoy"]),
        ("raymarch view hello.py --quality f", ["fine"]),
        ("raymarch render hello.py --view no", ["normal", "nonfinite"]),
        ("raymarch cost --by flip_m", ["flip_mean", "flip_max"]),
    ],
)
def test_a_shell_completes_commands_options_and_values(capsys, monkeypatch, typed, offered):
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" ")), "_RAYMARCH_COMPLETE": "complete_bash"}
    for name, value in words.items():
        monkeypatch.setenv(name, value)
    assert run() == 0
    assert capsys.readouterr().out.split() == offered


def test_explain_plans_for_the_size_of_the_picture(folder, capsys):
    """By default that of `render`."""
    found = {}
    for size in ("640x360", "16x9", None):
        assert run("explain", "hello.py", "--json", *(["--size", size] if size else [])) == 0
        found[size] = capsys.readouterr().out
    assert found[None] == found["640x360"]
    assert "cones would cost more than they save: their pass takes 5 ms" in found["16x9"]
    assert "size of the picture is not known" not in found[None]
    assert run("explain", "hello.py", "--size", "5") == 2
    assert "--size 5" in capsys.readouterr().err


def test_without_the_package_of_exr_nothing_is_drawn_and_the_file_is_named(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    monkeypatch.setattr("raymarch.cli.drawing.Renderer", lambda *_: pytest.fail("it was drawn"))
    assert run("render", "hello.py", "-o", "a.exr", "--size", "16x9") == 2
    assert "'a.exr' needs the package OpenEXR (pip install OpenEXR)" in capsys.readouterr().err
    assert files(folder) == {"hello.py"}


def test_an_output_that_cannot_be_replaced(folder, capsys):
    (folder / "a.png").mkdir()
    assert run("render", "hello.py", "-o", "a.png", "--size", "16x9") == 2
    assert "a.png" in capsys.readouterr().err
    assert files(folder) == {"hello.py", "a.png"}


def test_a_failure_on_the_way_leaves_no_file(folder, monkeypatch):
    def fails(*_: object) -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr("raymarch.cli.drawing.shown", lambda *_: Shown(fails, fails))  # with the file open
    with pytest.raises(RuntimeError, match="planted"):
        main(["render", "hello.py", "--size", "16x9"])
    assert files(folder) == {"hello.py"}


def test_a_fault_of_ours_is_code_1(folder):
    code = (
        "import raymarch.cli.drawing as m\ndef f(*a): raise RuntimeError('planted')\nm.shown = f\n"
        "from raymarch.cli import main\nmain()"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, "-c", code, "render", "hello.py", "--size", "16x9"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert re.search("Traceback.*planted", done.stderr, re.DOTALL)


def test_the_command_runs_as_a_module(folder):
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, "-m", "raymarch", "render", "nosuch.py"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == "raymarch: cannot read scene file 'nosuch.py': No such file or directory (a Python file)\n"


def test_a_long_picture_shows_its_progress(folder):
    """In a terminal; the bar comes after a second, so the picture is made slow."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2]), "TTY_COMPATIBLE": "1"}
    code = (
        "import time, raymarch.cli.commands as m\nfrom raymarch.gpu import program\n"
        "draw = program.Program.draw\n"
        "left = [5]\n"
        "def slow(*a, **k):\n    left[0] -= 1\n    time.sleep(0.4 if left[0] > 0 else 0)\n    return draw(*a, **k)\n"
        "program.Program.draw = slow\nm.main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "render", "hello.py", "--size", "512x256"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert "drawing" in done.stderr


def test_samples_take_the_jags_from_edges(folder):
    colours = []
    for samples in ("1", "8"):
        assert run("render", "hello.py", "--size", "48x32", "-o", "a.png", "--samples", samples) == 0
        with Image.open("a.png") as picture:
            colours.append(len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)))
    assert colours[1] > colours[0], "there are colours between"
    assert run("render", "hello.py", "--samples", "0") == 2


@pytest.mark.parametrize(("slow", "said"), [(3600.0, []), (0.05, ["loading hello.py (Ctrl+C to stop)"])])
def test_a_slow_start_of_the_window_is_reported(folder, monkeypatch, slow, said):
    words, told = [], threading.Event()

    def opens(*_: object) -> SimpleNamespace:
        assert told.wait(60 if said else 0) == bool(said)
        return SimpleNamespace(run=lambda _: 0)

    monkeypatch.setattr("raymarch.cli.view.SLOW", slow)
    monkeypatch.setattr("raymarch.cli.view.errors.say", lambda text: (words.append(text), told.set()))
    monkeypatch.setattr("raymarch.window.viewer.Viewer", opens)
    assert run("view", "hello.py") == 0
    assert words == said
