"""What a cluster needs without its processes: scenes as they are sent, addresses, kinds of workers, tiles."""

from __future__ import annotations

import os
import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.cluster.connect import check_address
from raymarch.cluster.frames import failures, shares_of
from raymarch.cluster.machines import Machine, accepted, libraries, package
from raymarch.cluster.source import of_file, of_scene
from raymarch.cluster.worker import Refused
from raymarch.export.sequence import Item
from raymarch.gpu.context import Driver
from tests.support.commands import files, run

SCENE = """import raymarch as rm
from colors import RED
relief = rm.planar("maps/dots.png")
scene = rm.Scene(rm.sphere().material(rm.Material(color=relief)) | rm.box().material(rm.Material(color=RED)))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes" / "maps").mkdir(parents=True)
    (tmp_path / "scenes" / "ball.py").write_text(SCENE)
    (tmp_path / "scenes" / "colors.py").write_text("RED = (1, 0.2, 0.1)\n")
    Image.new("RGB", (4, 4), "teal").save(tmp_path / "scenes" / "maps" / "dots.png")
    return tmp_path


@pytest.mark.parametrize("absolute", [False, True])
def test_a_file_is_sent_with_all_that_it_reads(absolute: bool, folder: Path) -> None:
    path = folder / "scenes" / "ball.py" if absolute else Path("scenes/ball.py")
    source, scene = of_file(path)
    names = {Path(name).relative_to(folder).as_posix() for name in source.files}
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
    assert of_scene(scene).scene() == scene and of_scene(scene).digest != of_scene(rm.Scene(rm.box())).digest
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
    (folder / "ball.py").write_text("import raymarch as rm\nscene = rm.Scene(rm.sphere(1.2) | rm.box())\n")
    command = ("render", "ball.py", "--size", "70x50", "-o", name)
    assert run(*command) == 0
    whole, plain = np.asarray(Image.open(name)), Path(name).read_bytes()
    Path(name).unlink()
    for module in ("raymarch.cli.render", "raymarch.export.sequence"):
        monkeypatch.setattr(sys.modules[module], "LARGE", 100)
    monkeypatch.setattr(sys.modules["raymarch.cli.render"], "EDGE", 32)
    capsys.readouterr()
    assert run(*command) == 0
    assert f"{name}  70x50, 6 tiles" in capsys.readouterr().err
    assert np.array_equal(np.asarray(Image.open(name)), whole)
    assert name == "big.tif" or Path(name).read_bytes() == plain
    assert not (folder / f"{name}.tiles").exists() and "big" in "".join(files(folder))
