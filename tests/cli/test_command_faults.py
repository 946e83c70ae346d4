"""Commands under bad luck: odd names and lines, full disks, missing drivers, closed pipes, a fault on the way."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import resource
import shutil
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.errors import SceneError, SceneWarning
from raymarch.export.stills import FORMATS
from raymarch.files import import_optional, write
from raymarch.gpu.doctor import Report
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.shader import assemble
from tests.support.commands import run

ROOT = Path(rm.__file__).parents[1]
HELLO = "import raymarch as rm\nscene = rm.sphere(rm.Param('radius', 1, 0.5, 2)) | rm.box(1.5)\n"
SMALL = ("--size", "16x9")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hello.py").write_text(HELLO)
    return tmp_path


def names(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def spawn(*args: str, **how: Any) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | how.pop("env", {})
    command = [sys.executable, *how.pop("python", ()), "-m", "raymarch", *args]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, **how)


# Messages.


def test_names_and_messages_command_no_terminal(folder: Path, capsys: Any) -> None:
    """Escape sequences and ends of lines are shown as \\x1b and \\n."""
    Image.new("RGB", (4, 4), (9, 90, 200)).save("a\n\x1b[31m#error\x9b.png")
    (folder / "odd\x1b[2J.py").write_text(
        "import raymarch as rm\nprint('hello')\n"
        "scene = rm.sphere(1).material(rm.Material(rm.triplanar('a\\n\\x1b[31m#error\\x9b.png')))\n"
    )
    (folder / "wrong\x1b[2J\n.py").write_text("raise ValueError('bad\\x1b[2J\\n')\n")
    assert run("explain", "wrong\x1b[2J\n.py") == 2
    assert run("explain", "odd\x1b[2J.py", "--json") == 0
    said = capsys.readouterr()
    assert "\x1b" not in said.err and said.err.count("\n") == 2 and "\\x1b[2J\\n.py:1" in said.err
    assert "\x1b" not in json.loads(said.out)["glsl"] and said.err.endswith("hello\n")
    assert run("export", "odd\x1b[2J.py", "-o", "a.glsl") == 0 and "\x1b" not in capsys.readouterr().err
    exported = (folder / "a.glsl").read_text()
    assert "\x1b" not in exported and not re.search(r"^\W*#error", exported, re.M) and "\x9b" not in exported


def test_a_message_names_the_output_and_no_temporary_file(folder: Path) -> None:
    def full(partial: Path) -> None:
        raise OSError(f"Failed to write pixel data to image file '{partial}'")

    with pytest.raises(SceneError, match=r"cannot write 'a.exr': Failed to write .* image file 'a.exr' "):
        write(Path("a.exr"), full)
    assert not Path("a.exr").exists()


def test_json_is_json_whatever_the_scene_prints(folder: Path) -> None:
    """Also what libraries in C and programs print that the scene file starts."""
    (folder / "loud.py").write_text(
        "import os, raymarch as rm\nprint('one')\nos.write(1, b'two\\n')\nos.system('echo three')\n"
        "scene = rm.sphere(1)\n"
    )
    done = spawn("explain", "loud.py", "--json", cwd=folder)
    assert done.returncode == 0 and json.loads(done.stdout)["glsl"]
    assert {"one", "two", "three"} <= set(done.stderr.split())


@pytest.mark.parametrize("line", [100, 1234])
def test_a_message_shows_the_line_as_a_number(folder: Path, capsys: Any, line: int) -> None:
    """Not as a picture: to some consoles ":100:" is one."""
    (folder / "bad.py").write_text("import raymarch as rm\n" + "\n" * (line - 2) + "scene = rm.sphere(0)\n")
    assert run("render", "bad.py", *SMALL) == 2
    assert capsys.readouterr().err == f"raymarch: bad.py:{line}: sphere: radius = 0 (a number > 0)\n"


@pytest.mark.parametrize("words", ["[/red] [bold]x[/bold]", ":smile: %s {0} \\", "100% höher → 漢字", "a" * 500])
def test_a_message_is_shown_as_it_is(folder: Path, capsys: Any, words: str) -> None:
    (folder / "bad.py").write_text(f"raise ValueError({words!r})\n", encoding="utf-8")
    assert run("render", "bad.py", *SMALL) == 2
    assert capsys.readouterr().err == f"raymarch: bad.py:1: ValueError: {words}\n"


def test_an_interrupt_that_a_package_loses_while_it_is_imported_ends_the_command(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As trimesh does: it imports packages that it can do without in blocks that catch all exceptions."""
    (folder / "greedy.py").write_text(
        "from raymarch import startup\n"
        "try:\n    startup.interrupt()\n"
        "except BaseException as caught:\n    lost = caught\n"
    )
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr("raymarch.startup._interrupted", None)
    with pytest.raises(KeyboardInterrupt):
        import_optional("a mesh", "greedy", "mesh")
    monkeypatch.setattr("raymarch.startup._interrupted", None)
    assert import_optional("a mesh", "greedy", "mesh").lost


@pytest.mark.parametrize(
    "words",
    [
        "render wood.py",  # the default output
        "render wood.py -o link.png",
        "render wood.py --cluster local:1",
        "render wood.py -o woo{}.png --frames 0:9",
        "export wood.py -o scene.stl",
        "prove wood.py -o wood.png",
        "prove wood.py --json wood.json",
        "cost wood.py --json wood.json",
        "view wood.py --log wood.py",
        "view wood.py --settings wood.json --log wood.json",
    ],
)
def test_a_file_that_the_scene_reads_is_not_replaced(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    Image.new("RGB", (4, 4), "teal").save("wood.png")
    shutil.copy("wood.png", "woo3.png")
    Path("wood.json").write_text("1.5")
    Path("scene.stl").write_text("a user's file")
    Path("link.png").symlink_to("wood.png")
    Path("wood.py").write_text(
        "import raymarch as rm\nfrom pathlib import Path\n"
        "for name in ('wood.json', 'scene.stl', 'woo3.png'):\n    Path(name).read_bytes()\n"
        "scene = rm.sphere().material(rm.Material(color=rm.planar('wood.png')))\n"
    )
    before = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    assert run(*words.split()) == 2
    assert ": this command reads it (another name)" in capsys.readouterr().err
    assert {name: Path(name).read_bytes() for name in before} == before


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_pages_of_a_file_whose_name_is_not_utf_8(folder: Path) -> None:
    name = os.fsdecode(b"b\xff")
    Path(f"{name}.py").write_text(HELLO)
    assert run("export", f"{name}.py", "-o", "a.html") == 0
    assert "<title>b\\udcff</title>" in Path("a.html").read_text(encoding="utf-8")
    how = ("--cross", "epsilon", "--axis", "epsilon=1", "--repeats", "1", "--no-prove", "--html", "c.html")
    assert run("cost", f"{name}.py", "--size", "16x9", *how) == 0


@pytest.mark.parametrize("name", ["höhe und breite.py", "[bold]x.py", "scene", "-.py", "a.b.c.py"])
def test_a_scene_may_have_any_name(folder: Path, name: str, capsys: Any) -> None:
    (folder / name).write_text("import raymarch as rm\nscene = rm.Scene(rm.sphere(), lights=[rm.Sun()])\n")
    assert run("render", *SMALL, "--", name) == 0
    assert Path(name).with_suffix(".png").name in names(folder)
    assert run("explain", "--", name) == 0
    assert f"{name}:2" in capsys.readouterr().out


# Where the picture goes.


def test_a_scene_elsewhere_is_drawn_into_the_folder_where_one_is(tmp_path: Path, monkeypatch: Any) -> None:
    scenes, here = tmp_path / "scenes", tmp_path / "here"
    scenes.mkdir()
    here.mkdir()
    (scenes / "hello.py").write_text(HELLO)
    monkeypatch.chdir(here)
    assert run("render", str(scenes / "hello.py"), *SMALL) == 0
    assert run("render", "../scenes/hello.py", "-o", "../here/other.png", *SMALL) == 0
    assert names(here) == {"hello.png", "other.png"} and names(scenes) == {"hello.py"}
    assert (here / "hello.png").read_bytes() == (here / "other.png").read_bytes()


@pytest.mark.parametrize("name", ["hello", "csg", "columns"])
def test_an_example_is_drawn_from_an_empty_folder(name: str, tmp_path: Path) -> None:
    done = spawn(
        "render", str(ROOT / "examples" / f"{name}.py"), "--size", "64x36", cwd=tmp_path, python=("-W", "error")
    )
    assert done.returncode == 0 and done.stdout == "", done.stderr
    assert names(tmp_path) == {f"{name}.png"}
    with Image.open(tmp_path / f"{name}.png") as picture:
        assert picture.size == (64, 36) and picture.mode == "RGB"
    assert "64x36" in done.stderr and "ms" in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_picture_has_the_rights_that_any_new_file_has(folder: Path) -> None:
    previous = os.umask(0o027)
    try:
        assert run("render", "hello.py", *SMALL) == 0
    finally:
        os.umask(previous)
    assert stat.S_IMODE((folder / "hello.png").stat().st_mode) == 0o640


def test_an_old_picture_is_replaced_and_links_to_it_keep_the_old_one(folder: Path) -> None:
    (folder / "hello.png").write_bytes(b"old")
    os.link(folder / "hello.png", folder / "kept.png")
    assert run("render", "hello.py", *SMALL) == 0
    assert (folder / "kept.png").read_bytes() == b"old"
    with Image.open(folder / "hello.png") as picture:
        assert picture.size == (16, 9)


@pytest.mark.parametrize(
    ("output", "answer"),
    [("hello.py/no/a.png", "Not a directory"), ("hello.py/a.png", "Not a directory"), ("/proc/a.png", "/proc/a.png")],
)
def test_a_folder_that_cannot_be_written(folder: Path, output: str, answer: str, capsys: Any) -> None:
    assert run("render", "hello.py", "-o", output, *SMALL) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"raymarch: cannot write '{output}'") and answer in message
    assert names(folder) == {"hello.py"}


@pytest.mark.parametrize("fault", [OSError(errno.ENOSPC, "No space left on device"), ValueError("picture too long")])
def test_a_picture_that_cannot_be_written_leaves_the_old_one(
    folder: Path, fault: Exception, monkeypatch: Any, capsys: Any
) -> None:
    (folder / "hello.jpg").write_bytes(b"old")

    def save(self: Image.Image, file: io.BytesIO, kind: str, **_: Any) -> None:
        file.write(b"half")
        raise fault

    monkeypatch.setattr(Image.Image, "save", save)
    assert run("render", "hello.py", "-o", "hello.jpg", *SMALL) == 2
    message = capsys.readouterr().err
    assert message.startswith("raymarch: cannot write 'hello.jpg': ") and str(fault.args[-1]) in message
    assert names(folder) == {"hello.py", "hello.jpg"} and (folder / "hello.jpg").read_bytes() == b"old"


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".webp", ".tif", ".bmp", ".gif"])
def test_a_disk_that_takes_a_part_of_a_picture(
    folder: Path, suffix: str, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python does not notice that its own file is cut
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        frames = ("--frames", "0:1") if suffix == ".gif" else ()
        assert run("render", "hello.py", "-o", f"a{suffix}", "--size", "40x30", *frames) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert capsys.readouterr().err.startswith("raymarch: cannot write 'a") and names(folder) == {"hello.py"}


def test_a_format_with_a_limit_of_its_own(folder: Path, capsys: Any) -> None:
    assert run("render", "hello.py", "-o", "long.webp", "--size", "16384x1") == 2
    assert "cannot write 'long.webp'" in capsys.readouterr().err and names(folder) == {"hello.py"}


def drawn(name: str, view: str) -> Image.Image:
    """The picture that a command writes."""
    assert run("render", "hello.py", "-o", name, "--view", view, "--set", "radius=2", *SMALL) == 0
    with Image.open(name) as picture:
        picture.load()
        return picture


@cache
def exact(view: str) -> Image.Image:
    """The same without loss."""
    return drawn("exact.png", view)


@pytest.mark.parametrize("ending", sorted(FORMATS))
@pytest.mark.parametrize("view", ["final", "depth"])
def test_every_format_takes_pictures_and_heat_maps(folder: Path, ending: str, view: str) -> None:
    picture, known = drawn(f"a{ending}", view), exact(view)
    assert picture.size == known.size and picture.width == 16 and picture.format == FORMATS[ending]
    wrong = np.abs(np.asarray(picture.convert("L"), int) - np.asarray(known.convert("L"), int))
    assert np.ptp(np.asarray(known.convert("L"), int)) > 60
    # JPEG and WebP are lossy; a picture of 16 pixels, which are all edges, shows it.
    assert wrong.mean() <= (8 if ending in (".jpg", ".jpeg", ".webp") else 0)


def size_of(file: Any) -> tuple[int, int]:
    with Image.open(file) as picture:
        return picture.size


def test_an_output_keeps_its_link_its_mode_and_its_kind(folder: Path) -> None:
    (folder / "real.png").write_text("old")
    (folder / "real.png").chmod(0o600)
    (folder / "link.png").symlink_to("real.png")
    (folder / "loose.png").symlink_to("new.png")
    for name in ("link.png", "loose.png"):
        assert run("render", "hello.py", "-o", name, *SMALL) == 0 and (folder / name).is_symlink()
    assert size_of("real.png") == size_of("new.png") == (16, 9)
    assert stat.S_IMODE((folder / "real.png").stat().st_mode) == 0o600
    os.mkfifo("pipe.png")
    with ThreadPoolExecutor(1) as threads:
        read = threads.submit((folder / "pipe.png").read_bytes)
        assert run("render", "hello.py", "-o", "pipe.png", *SMALL) == 0
        assert size_of(io.BytesIO(read.result())) == (16, 9)
    assert (folder / "pipe.png").is_fifo() and not [name for name in names(folder) if name.startswith(".")]


def folder_in_its_place(folder: Path) -> str:
    (folder / "a.png").mkdir()
    return "a.png"


def read_only_file(folder: Path) -> str:
    (folder / "a.png").write_text("mine")
    (folder / "a.png").chmod(0o444)
    return "a.png"


def full_device(folder: Path) -> str:
    (folder / "a.png").symlink_to("/dev/full")
    return "a.png"


def endless_link(folder: Path) -> str:
    (folder / "a.png").symlink_to("a.png")
    return "a.png"


PLACES: list[Callable[[Path], str]] = [
    folder_in_its_place, read_only_file, full_device, endless_link, lambda _: "hello.py/no/a.png",
    lambda _: "hello.py/a.png", lambda _: "a" * 252 + ".png", lambda _: "a" * 245 + ".gif",
]  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_a_place_that_takes_no_picture_is_one_line(
    place: Callable[[Path], str], folder: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda file, mode: os.stat(file).st_mode & 0o222)  # as for a user who is not root
    name = place(folder)
    before = names(folder)
    assert run("render", "hello.py", "-o", name, *SMALL, *(("--frames", "0:2") if ".gif" in name else ())) == 2
    assert capsys.readouterr().err.count("\n") == 1 and names(folder) == before


def test_an_interrupted_command_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def encoded(*_: object) -> None:
        assert any(name.startswith(".raymarch.") for name in names(folder))
        raise KeyboardInterrupt

    monkeypatch.setattr(import_module("raymarch.export.stills"), "encoded", encoded)
    assert run("render", "hello.py", *SMALL) == 130 and names(folder) == {"hello.py"}


# Many frames.


def test_a_fault_in_a_later_frame_keeps_the_whole_ones(folder: Path, capsys: Any) -> None:
    camera = "rm.Camera((0, 0, 5 - rm.time), (0, 0, 0))"
    (folder / "fly.py").write_text(f"import raymarch as rm\nscene = rm.Scene(rm.sphere(), {camera})\n")
    assert run("render", "fly.py", "-o", "f{}.png", "--frames", "3:8", "--fps", "1", *SMALL) == 2
    assert "raymarch: fly.py:2: Camera: position = target" in capsys.readouterr().err
    assert names(folder) == {"hello.py", "fly.py", "f3.png", "f4.png"}
    for name in ("f3.png", "f4.png"):
        with Image.open(name) as picture:
            picture.verify()


def test_frames_are_a_time_apart(folder: Path) -> None:
    (folder / "grow.py").write_text("import raymarch as rm\nscene = rm.Scene(rm.sphere(), sky=(0.1 * rm.time, 0, 0))\n")
    assert run("render", "grow.py", "-o", "f{:02d}.png", "--frames", "0:3", "--fps", "0.5", *SMALL) == 0
    reds = []
    for i in range(3):
        with Image.open(f"f{i:02d}.png") as picture:
            reds.append(picture.getpixel((0, 0))[0])
    # Skies of 0, 0.2 and 0.4: 255 (1.055 x^(1/2.4) - 0.055).
    assert reds == [0, 124, 170]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit(3)])
def test_a_stop_on_the_way_leaves_no_half_file(folder: Path, stop: Any, monkeypatch: Any) -> None:
    def save(self: Image.Image, file: io.BytesIO, kind: str, **_: Any) -> None:
        file.write(b"half")
        raise stop

    monkeypatch.setattr(Image.Image, "save", save)
    assert run("render", "hello.py", "-o", "hello.jpg", *SMALL) != 0
    assert names(folder) == {"hello.py"}


# Parameters.


def test_settings_may_be_vectors_and_the_last_one_counts(folder: Path) -> None:
    text = "import raymarch as rm\nscene = rm.Scene(rm.sphere(), sky=rm.Param('sky color', (0, 0, 0), 0, 1))\n"
    (folder / "sky.py").write_text(text)
    settings = ("--set", "sky color=1,1,1", "--set", " sky color = 0, 0.2,1 ")
    assert run("render", "sky.py", *settings, *SMALL) == 0
    with Image.open("sky.png") as picture:
        assert picture.getpixel((0, 0)) == (0, 124, 255)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("radius=nan", "'radius' = nan"),
        ("radius=inf", "'radius' = inf"),
        ("radius=0.49", "'radius' = 0.49 (a number >= 0.5 and <= 2)"),
        ("radius=1,1", "'radius' = (1.0, 1.0)"),
        ("radius=", "--set radius="),
        ("=1", "unknown parameter ''"),
        ("Radius=1", "unknown parameter 'Radius' = 1.0 (one of: radius)"),
    ],
)
def test_a_bad_setting(folder: Path, setting: str, words: str, capsys: Any) -> None:
    assert run("render", "hello.py", "--set", setting, *SMALL) == 2
    message = capsys.readouterr().err
    assert words in message and len(message.splitlines()) == 1 and names(folder) == {"hello.py"}


@pytest.mark.parametrize("size", ["", "x", "16", "16x", "x9", "-1x9", "1.5x9", "1e2x9", "16x9x3", "0x0", "16 x 9 "])
def test_a_bad_size(folder: Path, size: str, capsys: Any) -> None:
    assert run("render", "hello.py", f"--size={size}") == 2
    assert f"--size {size} (WxH in whole pixels" in capsys.readouterr().err and names(folder) == {"hello.py"}


def test_a_size_beyond_all_limits(folder: Path, capsys: Any) -> None:
    for size, legal in (
        ("65537x1", "an integer from 1 to 65536"),
        ("1x999999999999999999999", "an integer from 1 to 65536"),
        ("40000x40000", "a .tif, or up to 268435456 pixels"),
    ):
        assert run("render", "hello.py", "--backend", "egl", "--size", size) == 2
        message = capsys.readouterr().err
        assert legal in message and len(message.splitlines()) == 1
    assert names(folder) == {"hello.py"}
    assert run("render", "hello.py", "--backend", "egl", "--size", "16385x1", "-o", "wide.png") == 0
    with Image.open(folder / "wide.png") as wide:
        assert wide.size == (16385, 1)
    assert names(folder) == {"hello.py", "wide.png"}


# Drivers.


def test_a_missing_driver_says_what_to_install(folder: Path) -> None:
    done = spawn(
        "render", "hello.py", "--backend", "egl", cwd=folder, env={"GLCONTEXT_LINUX_LIBEGL": "/nowhere/libEGL.so"}
    )
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "/nowhere/libEGL.so" in done.stderr and "libegl1" in done.stderr
    assert names(folder) == {"hello.py"}


def test_the_backend_that_drew_is_named(folder: Path, capsys: Any) -> None:
    assert run("render", "hello.py", *SMALL) == 0
    assert "egl: " in capsys.readouterr().err


BROKEN = [Report(name, works=False, error=f"{name} is broken", cure=f"mend {name}") for name in ("egl", "osmesa")]


def test_doctor_without_any_context_fails_and_names_the_cures(folder: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.setattr("raymarch.cli.doctor.examine", lambda: BROKEN)
    assert run("doctor") == 2
    out, err = capsys.readouterr()
    for name in ("egl", "osmesa"):
        assert f"{name} is broken" in out and f"mend {name}" in out
    assert err.startswith("raymarch: no OpenGL context works here") and len(err.splitlines()) == 1
    assert run("doctor", "--json") == 2
    out, err = capsys.readouterr()
    assert [report["cure"] for report in json.loads(out)] == ["mend egl", "mend osmesa"]


def test_doctor_shows_driver_limits_loops_and_clock(folder: Path, capsys: Any) -> None:
    assert run("doctor") == 0
    out = capsys.readouterr().out
    for word in ("driver", "version", "largest picture", "loops", "clock", "egl", "osmesa", "window"):
        assert word in out


# Explain.


def strict(text: str) -> Any:
    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("scene", ["rm.plane()", "rm.sphere() & rm.sphere().translate((9, 0, 0))", "rm.sphere(1e-6)"])
def test_explain_is_strict_json(folder: Path, scene: str, capsys: Any) -> None:
    (folder / "scene.py").write_text(f"import raymarch as rm\nscene = {scene}\n")
    assert run("explain", "scene.py", "--json") == 0
    out, err = capsys.readouterr()
    found = strict(out)
    assert err == "" and found["field"]["shapes"] >= 1 and names(folder) == {"hello.py", "scene.py"}


def test_explain_shows_the_text_that_is_drawn(folder: Path, capsys: Any) -> None:
    assert run("explain", "hello.py", "--glsl") == 0
    assert capsys.readouterr().out == assemble(plan(load(folder / "hello.py"), size=(640, 360))).text()


def test_explain_needs_no_driver(folder: Path) -> None:
    broken = {"GLCONTEXT_LINUX_LIBEGL": "/nowhere", "GLCONTEXT_LINUX_LIBGL": "/nowhere"}
    done = spawn("explain", "hello.py", "--json", cwd=folder, env=broken, python=("-W", "error"))
    assert done.returncode == 0 and strict(done.stdout)["field"]["shapes"] == 2


@pytest.mark.parametrize(
    "words",
    [
        ("explain", "hello.py"),
        ("explain", "hello.py", "--glsl"),
        ("explain", "hello.py", "--json"),
        ("doctor",),
        ("doctor", "--json"),
        ("cost", "hello.py", "--size", "16x9", "--repeats", "1", "--cross", "tracer", "--reference-samples", "1"),
        ("--help",),
    ],
    ids=" ".join,
)
def test_a_closed_pipe_ends_a_command_quietly(folder: Path, words: tuple[str, ...]) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-m", "raymarch", *words],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=folder,
        text=True,
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
    assert process.returncode == 0, said
    assert "Traceback" not in said and "Broken" not in said and "Exception" not in said


# A disk that is full, a cache that is broken, Ctrl+C.


def full_disk() -> None:
    """No file of more than 1,000 bytes, from now on in this process."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


@pytest.mark.parametrize("ending", [".png", ".exr", ".bmp", ".tif"])
def test_a_full_disk_is_said_in_one_line(folder: Path, ending: str) -> None:
    cache = {"MESA_SHADER_CACHE_DISABLE": "true", "PYTHONDONTWRITEBYTECODE": "1"}
    words = ("render", "hello.py", "-o", f"a{ending}", "--size", "640x360")
    done = spawn(*words, cwd=folder, preexec_fn=full_disk, env=cache)
    assert done.returncode == 2, done.stderr
    (said,) = (line for line in done.stderr.splitlines() if " %  drawing" not in line)  # a busy machine is slow
    assert said.startswith(f"raymarch: cannot write 'a{ending}': ")
    assert names(folder) == {"hello.py"}


@pytest.mark.parametrize(
    "words",
    [("explain", "hello.py"), ("explain", "hello.py", "--json"), ("doctor",), ("--help",), ("--version",)],
    ids=" ".join,
)
def test_an_output_to_a_full_disk_is_said_in_one_line(folder: Path, words: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "raymarch", *words],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=full,
            stderr=subprocess.PIPE,
            cwd=folder,
            text=True,
        )
    assert done.returncode == 2, done.stderr
    assert done.stderr == "raymarch: cannot write the output: No space left on device (a disk with space)\n"


def test_a_scene_without_a_command_says_which_there_are(folder: Path) -> None:
    done = spawn("hello.py", cwd=folder)
    assert done.returncode == 2
    assert done.stderr == "raymarch: hello.py is no command (raymarch render hello.py, or raymarch view hello.py)\n"


@pytest.mark.parametrize(
    ("redirection", "words", "code"),
    [
        ("2> /dev/full", "render nothing.py", 2),
        ("2> /dev/full", "render hello.py --size 16x9", 0),
        (">&-", "explain hello.py", 0),
        ("2>&-", "render hello.py --size 16x9", 0),
        ("<&- >&- 2>&-", "render hello.py --size 16x9", 0),
    ],
)
def test_closed_and_full_streams_leave_the_exit_code(folder: Path, redirection: str, words: str, code: int) -> None:
    command = f"exec {sys.executable} -m raymarch {words} {redirection}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-c", command], env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr and "Exception" not in done.stderr
    assert ("hello.png" in names(folder)) == (code == 0 and "render" in words)


def test_processes_of_a_command_have_the_streams_that_were_closed() -> None:
    """A worker of a cluster without a stream of errors could draw nothing."""
    child = [sys.executable, "-c", "import sys; sys.stderr.write(sys.stdin.read())"]
    code = f"import subprocess, raymarch.cli.common as c; c._open_closed_streams(); subprocess.run({child}, check=True)"
    command = 'exec "$0" -c "$1" <&- >&- 2>&-'
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    assert subprocess.run(["bash", "-c", command, sys.executable, code], env=environment).returncode == 0


MESH = """import raymarch as rm, trimesh
trimesh.creation.box((1, 1, 1)).export("box.stl")
scene = rm.mesh("box.stl", resolution=8, cache="cache")
"""


@pytest.mark.parametrize("content", [b"", b"broken", "half", "other", "nan"])
def test_a_broken_mesh_cache_is_made_anew(folder: Path, content: Any) -> None:
    (folder / "mesh.py").write_text(MESH)
    whole = load("mesh.py").node
    (kept,) = (folder / "cache").iterdir()
    before = kept.read_bytes()
    if content == "other":
        np.savez_compressed(kept, values=np.zeros(3))
    elif content == "nan":
        np.savez_compressed(kept, values=np.full((8, 8, 8), np.nan), size=np.ones(3), centre=np.zeros(3))
    else:
        kept.write_bytes(before[: len(before) // 2] if content == "half" else content)
    with pytest.warns(SceneWarning, match="cannot be read: it is made anew"):
        assert load("mesh.py").node == whole
    with np.load(kept) as mended:
        assert np.isfinite(mended["values"]).all() and mended["values"].ndim == 3


@pytest.mark.parametrize("cache", ["hello.py/cache", "/proc/none"])
def test_a_mesh_cache_that_cannot_be_written_is_not_used(folder: Path, cache: str) -> None:
    (folder / "mesh.py").write_text(MESH.replace('"cache"', repr(cache)))
    with pytest.warns(SceneWarning, match="cannot write .*: nothing is kept"):
        assert load("mesh.py").node.facts.bounded
    assert names(folder) == {"hello.py", "mesh.py", "box.stl"}


@pytest.mark.parametrize("module", ["pyrr", "typer", "PIL"])
def test_ctrl_c_during_the_imports_ends_with_130(folder: Path, module: str) -> None:
    """A module that the package imports waits, so that the signal comes in that moment."""
    (folder / "first").mkdir()
    text = "import sys, time\nprint('here', file=sys.stderr, flush=True)\ntime.sleep(60)\n"
    (folder / "first" / f"{module}.py").write_text(text)
    environment = os.environ | {"PYTHONPATH": f"{folder / 'first'}{os.pathsep}{ROOT}"}
    command = [sys.executable, "-m", "raymarch", "explain", "hello.py"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, cwd=folder, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "here\n"
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == ""
    assert process.returncode == 130


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_a_scene_file_ends_with_130(folder: Path, number: signal.Signals) -> None:
    text = "import sys, time\nprint('here', file=sys.stderr, flush=True)\ntime.sleep(60)\n"
    (folder / "slow.py").write_text(text)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "raymarch", "explain", "slow.py"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, cwd=folder, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "here\n"
        process.send_signal(number)
        assert "Traceback" not in process.stderr.read()
    assert process.returncode == 130


# Faults of ours.


def test_a_fault_of_ours_shows_its_traceback_and_leaves_nothing(folder: Path) -> None:
    code = (
        "import raymarch.cli.explain as c\ndef f(*a, **k): raise AssertionError('planted')\nc.assemble = f\n"
        "from raymarch.cli import main\nmain()"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code, "explain", "hello.py"],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1 and "Traceback" in done.stderr and "planted" in done.stderr
    assert names(folder) == {"hello.py"}
