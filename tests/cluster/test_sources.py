"""What a cluster needs without its processes: scenes as they are sent, addresses, kinds of workers, tiles."""

from __future__ import annotations

import importlib
import io
import os
import pickle
import shutil
import sys
import threading
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.cluster.connect import check_address
from raymarch.cluster.frames import failures, shares_of
from raymarch.cluster.machines import Machine, accepted, libraries
from raymarch.cluster.source import PREFIX, of_file, of_scene, without_folder
from raymarch.cluster.worker import Refused
from raymarch.export.sequence import Item
from raymarch.export.stills import package
from raymarch.gpu.driver import Driver
from raymarch.plan import plan
from raymarch.shader import assemble
from tests.support.commands import files, run

SCENE = """import raymarch as rm
from colors import RED
relief = rm.planar("maps/dots.png")
scene = rm.Scene(rm.sphere().material(rm.Material(color=relief)) | rm.box(1).material(rm.Material(color=RED)))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes" / "maps").mkdir(parents=True)
    (tmp_path / "scenes" / "ball.py").write_text(SCENE)
    (tmp_path / "scenes" / "colors.py").write_text("RED = (1, 0.2, 0.1)\n")
    Image.new("RGB", (4, 4), "teal").save(tmp_path / "scenes" / "maps" / "dots.png")
    return tmp_path


MOVED = """import os
import sys
import raymarch as rm
from parts import pair
ball = rm.sphere(float(sys.stdin.read())).translate((0, 2, 0))
left = rm.text("L", font="own.ttf", resolution=16).extrude(0.1) | ball
os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), "maps"))
right = rm.text("R", font="../own.ttf", resolution=16).extrude(0.1).material(rm.Material(color=rm.planar("dots.png")))
scene = rm.Scene(left | right.translate((3, 0, 0)) | pair() | rm.plane(offset=-1))
"""
PARTS = """import raymarch as rm
def pair():
    left = rm.sphere(0.4) | rm.box(1)
    right = left.translate((0, 0, 2))
    return left.rotate(0.3) | right
"""
SERIF = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSerif.ttf"


def text_of(scene: rm.Scene) -> str:
    return assemble(plan(scene)).text()


def test_one_scene_is_one_text_wherever_its_file_lies(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By all paths and links, from other folders, sent to a worker and pickled; with a sibling, a font and a pipe."""
    here = folder / "two words" / "scenes"
    shutil.copytree(folder / "scenes", here)
    shutil.copy(SERIF, here / "own.ttf")
    (here / "moved.py").write_text(MOVED)
    (here / "parts.py").write_text(PARTS)
    (folder / "link.py").symlink_to(here / "moved.py")
    (folder / "linked").symlink_to(here.parent)
    (folder / "other").mkdir()
    sources, texts = [], []
    for start, path in (
        (folder, here / "moved.py"),
        (here, "moved.py"),
        (folder / "other", "../two words/scenes/moved.py"),
        (folder, "linked/scenes/moved.py"),
        (folder / "other", "../linked/../two words/scenes/../scenes/moved.py"),
        (folder / "linked" / "scenes", folder / "linked" / "scenes" / "moved.py"),
    ):
        monkeypatch.chdir(start)
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"0.75")))
        source, scene = of_file(path)
        assert os.getcwd() == os.path.realpath(start), "the working directory of the scene file is its own"
        sources.append(pickle.loads(pickle.dumps(source)))
        texts += [text_of(scene), text_of(pickle.loads(pickle.dumps(scene)))]
    monkeypatch.chdir(folder)
    shutil.rmtree(here)
    texts += [text_of(source.scene()) for source in sources]
    assert len(set(texts)) == 1 and os.getcwd() == str(folder)


def test_a_linked_file_has_its_siblings_and_what_lies_beside_it(folder: Path) -> None:
    shutil.copy(SERIF, folder / "scenes" / "own.ttf")
    letters = 'rm.text("A", font="own.ttf").extrude(1)'
    (folder / "scenes" / "ball.py").write_text(f"{SCENE}scene = rm.Scene({letters} | scene.node)\n")
    (folder / "link.py").symlink_to(folder / "scenes" / "ball.py")
    source, scene = of_file("link.py")
    shutil.rmtree(folder / "scenes")
    assert source.scene() == scene


def test_a_scene_file_in_a_pipe_is_read_once(folder: Path) -> None:
    os.mkfifo("pipe.py")
    writer = threading.Thread(
        target=Path("pipe.py").write_text, args=["import raymarch as rm\nscene = rm.sphere(0.7)\n"]
    )
    writer.start()
    source, scene = of_file("pipe.py")
    writer.join()
    assert source.scene() == scene


def test_modules_that_the_program_has_imported_already_are_sent(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(folder / "scenes")
    importlib.import_module("colors")
    try:
        source, scene = of_file("scenes/ball.py")
    finally:
        del sys.modules["colors"]
    shutil.rmtree(folder / "scenes")
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p != str(folder / "scenes")])
    assert source.scene() == scene


def test_the_temporary_folder_of_a_worker_is_in_no_message(folder: Path) -> None:
    here = folder / "scenes" / "ball.py"
    source, _ = of_file(here)
    missing = replace(source, files={**source.files, str(here): SCENE.replace("dots", "none").encode()})
    with pytest.raises(rm.SceneError, match=f"tried: {folder}/scenes/maps/none.png"):
        missing.scene()
    late = "import raymarch as rm\nscene = rm.Scene(rm.sphere(), rm.Camera((rm.time, 0, 0), (1, 0, 0)))\n"
    scene = replace(source, files={str(here): late.encode()}).scene()
    with rm.Renderer((8, 8)) as renderer, pytest.raises(rm.SceneError) as caught:
        renderer.render(scene, time=1.0)
    assert without_folder(str(caught.value)).startswith(f"{here}:2: Camera") and PREFIX in str(caught.value)


@pytest.mark.parametrize("absolute", [False, True])
def test_a_file_is_sent_with_all_that_it_reads(absolute: bool, folder: Path) -> None:
    path = folder / "scenes" / "ball.py" if absolute else Path("scenes/ball.py")
    source, scene = of_file(path)
    names = {Path(name).relative_to(folder).as_posix() for name, content in source.files.items() if content is not None}
    assert names == {"scenes/ball.py", "scenes/colors.py", "scenes/maps/dots.png"}
    sent = pickle.loads(pickle.dumps(source))
    assert sent.digest == source.digest and len(sent.digest) == 32
    for file in (folder / "scenes").rglob("*.*"):
        file.unlink()
    before = os.getcwd()
    assert sent.scene() == scene and os.getcwd() == before and "colors" not in sys.modules


def test_an_error_on_a_worker_has_the_line_of_the_users_file(folder: Path) -> None:
    source, _ = of_file("scenes/ball.py")
    broken = SCENE.replace('rm.planar("maps/dots.png")', "rm.sphere(-1)").encode()
    name = str(folder / "scenes" / "ball.py")
    with pytest.raises(rm.SceneError, match=r"^scenes/ball.py:3: sphere: radius = -1"):
        replace(source, files={**source.files, name: broken}).scene()
    absolute = replace(source, name=name, files={**source.files, name: broken})
    with pytest.raises(rm.SceneError) as caught:
        absolute.scene()
    assert str(caught.value).startswith(f"{name}:3: sphere")


def test_a_scene_is_sent_by_its_content() -> None:
    scene = rm.Scene(rm.sphere())
    assert of_scene(scene).scene() == scene and of_scene(scene).digest != of_scene(rm.Scene(rm.box(1))).digest
    with pytest.raises(rm.SceneError, match="scene"):
        of_scene("scene.py")  # type: ignore[arg-type]


def test_addresses() -> None:
    assert check_address("local:3") == 3 and check_address("local") == os.cpu_count()
    assert check_address("tcp://10.0.0.1:8786") is None
    for wrong in ("", "local:0", "local:x", "10.0.0.1:8786", "tcp://", "http://a:1"):
        with pytest.raises(rm.ClusterError, match="--cluster"):
            check_address(wrong)


def machine(renderer: str = "a", version: str | None = None) -> Machine:
    return Machine(version or package(), libraries(), Driver(renderer, "", "1", True))


def test_workers_with_other_drivers_or_versions_are_refused() -> None:
    same = {"tcp://1": machine(), "tcp://2": machine()}
    assert accepted(same, mixed=False) == ([machine()], [])
    mixed = {"tcp://0": machine("b"), **same}
    with pytest.raises(
        rm.ClusterError, match=r"2 kinds of drivers .* 2 workers such as tcp://1: a.*tcp://0: b.*--mixed"
    ):
        accepted(mixed, mixed=False)
    kinds, notes = accepted(mixed, mixed=True)
    assert [kind.driver.renderer for kind in kinds] == ["a", "b"] and "last bit" in notes[0]
    with pytest.raises(rm.ClusterError, match=r"worker tcp://3 has raymarch 0.0, this is"):
        accepted({**same, "tcp://3": machine(version="0.0")}, mixed=True)
    assert accepted({**same, "tcp://3": "no context"}, mixed=False)[1] == ["worker tcp://3 is not used: no context"]
    with pytest.raises(rm.ClusterError, match="no worker can draw: tcp://3: no context"):
        accepted({"tcp://3": "no context"}, mixed=False)


def test_shares_cover_all_samples_once() -> None:
    assert shares_of(5, 2) == [(0, 2), (2, 5)] and shares_of(4, 4) == [(0, 1), (1, 2), (2, 3), (3, 4)]


def test_equal_failures_are_one_line() -> None:
    items = [Item(f"frame {i}", 0.0, Path("a"), (1, 1)) for i in range(3)]
    found = failures([(items[0], Refused("a.py:1: no")), (items[1], Refused("b")), (items[2], Refused("a.py:1: no"))])
    assert found == ["frame 0 and 1 more cannot be drawn: a.py:1: no", "frame 1 cannot be drawn: b"]


@pytest.mark.parametrize("name", ["big.tif", "big.png", "big.jpg"])
def test_a_large_picture_is_drawn_in_tiles_and_resumed(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "ball.py").write_text("import raymarch as rm\nscene = rm.Scene(rm.sphere(1.2) | rm.box(1))\n")
    command = ("render", "ball.py", "--size", "70x50", "-o", name)
    assert run(*command) == 0
    whole, plain = np.asarray(Image.open(name)), Path(name).read_bytes()
    Path(name).unlink()
    for module in ("raymarch.cli.job", "raymarch.export.sequence"):
        monkeypatch.setattr(sys.modules[module], "LARGE", 100)
    monkeypatch.setattr(sys.modules["raymarch.cli.job"], "EDGE", 32)
    capsys.readouterr()
    assert run(*command) == 0
    assert f"{name}  70x50, 6 tiles" in capsys.readouterr().err
    assert np.array_equal(np.asarray(Image.open(name)), whole)
    assert name == "big.tif" or Path(name).read_bytes() == plain
    assert not (folder / f"{name}.tiles").exists() and "big" in "".join(files(folder))
