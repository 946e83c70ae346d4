"""Files that change: edited, broken, endless, gone. By the reloader and the model, without a window."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

from raymarch import cache
from raymarch.files import may_belong, recorded
from raymarch.scene.file import load
from raymarch.window import commands as do
from raymarch.window import reload
from raymarch.window.constants import Constants
from raymarch.window.model import Model, Show
from raymarch.window.news import Failed, Fault, Loaded, Started, Watching
from raymarch.window.reload import Reloader
from raymarch.window.state import opened
from tests.support.breakage import GOOD, INSERTED, PARTS, PARTS_BROKEN, REPLACED, WHOLE, breaks
from tests.support.window_driver import PATIENCE, ROOT
from tests.window.ball import SCENE

T = TypeVar("T")


class Live:
    """A reloader, and a model that takes its news as the main loop does."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scene.py"
        self.file.write_text(SCENE)
        self.model = Model(opened(self.file, load(self.file), {}, 1.6))
        self._woken = threading.Event()
        self.reloader = Reloader(self.file, self._woken.set, dict, (64, 40), Constants(), Constants())
        self.reloader.start(self.model.state.base, [str(self.file)])

    def wait(self, kind: type[T]) -> T:
        """The next news of a kind; the model takes all of them."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            self._woken.wait(0.05)
            self._woken.clear()
            found = None
            for news in self.reloader.latest():
                do.take_news(self.model, news)
                found = news if isinstance(news, kind) else found
            for request in self.model.requests:
                if isinstance(request, Show):
                    do.accept(self.model, request)
            self.model.requests.clear()
            if found is not None:
                return found
        raise AssertionError(f"no {kind.__name__}: {self.model.fault}")

    def save(self, text: str | bytes, file: Path | None = None) -> None:
        """Save as editors do: a new file is renamed over the old one."""
        file = file or self.file
        fresh = file.with_name(f"{file.name}.new")
        fresh.write_bytes(text if isinstance(text, bytes) else text.encode())
        os.replace(fresh, file)

    def opened(self, file: Path, text: str) -> None:
        """Change to another file, as when one is dropped onto the window."""
        file.write_text(text)
        self.file = file
        self.reloader.open(file)
        self.wait(Loaded)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    made = Live(tmp_path_factory.mktemp("live"))
    for _ in range(3):
        made.reloader.interrupt()  # does not spoil the scene that is shown, while it is tried in the background
    made.wait(Watching)
    assert made.model.fault is None
    yield made
    made.reloader.stop()


@pytest.fixture
def live(shared: Live, tmp_path: Path) -> Live:
    shared.opened(tmp_path / "scene.py", SCENE)
    return shared


def where(live: Live) -> tuple[str, int | None]:
    assert live.model.fault is not None
    return Path(live.model.fault.file or "").name, live.model.fault.line


def test_an_imported_module_is_followed_too(live: Live, tmp_path: Path) -> None:
    parts = tmp_path / "parts.py"
    parts.write_text("COLOR = (0.9, 0.1, 0.1)\n")
    scene = (
        "import raymarch as rm\nfrom parts import COLOR\nscene = rm.Scene(rm.sphere().material(rm.Material(COLOR)))\n"
    )
    live.save(scene)
    live.wait(Loaded)
    live.save("COLOR = (0.1, 0.9, 0.1)\n", parts)
    live.wait(Loaded)
    assert live.model.state.scene.materials[1].color.data[1] == 0.9
    live.save("COLOR = \n", parts)
    live.wait(Failed)
    assert where(live) == ("parts.py", 1)
    parts.unlink()
    live.wait(Failed)
    assert live.model.fault is not None and "parts" in live.model.fault.what
    parts.write_text("COLOR = (0.1, 0.9, 0.1)\n")
    live.wait(Loaded)
    assert live.model.fault is None


def test_warnings_about_lines_come_with_the_scene(live: Live) -> None:
    live.save('import raymarch as rm\nscene = rm.box().rotate(45, "z")\n')
    (words,) = live.wait(Loaded).words
    assert "scene.py:2: rotate: angle = 45 radians" in words


def test_the_file_that_was_opened_is_followed_and_the_old_one_no_more(live: Live, tmp_path: Path) -> None:
    live.opened(tmp_path / "other scene.py", SCENE.replace("(0, 1, 6)", "(0, 2, 6)"))
    assert live.model.state.file.name == "other scene.py" and live.model.state.camera.position[1] == 2
    live.save("broken(", tmp_path / "scene.py")
    live.save(SCENE)
    live.wait(Loaded)
    assert live.model.fault is None and live.model.state.camera.position[1] == 1


BEGUN = "open(__file__ + '.begun', 'w').close(); "
HANGS = {
    "a loop": (f"{BEGUN}\nwhile True:\n    pass\n", (2, 3, 4)),
    "a loop that holds on": (f"while True:\n  try:\n    {BEGUN}\n    while True: pass\n  except: pass\n", (4, 5)),
    "a sleep": (f"import time\n{BEGUN}time.sleep(1000)\n", (3,)),
    "a loop of C code": (f"import itertools\n{BEGUN}any(itertools.repeat(False))\n", (3,)),
}
"""Files that do not end, each with the lines at which it hangs once another file says so."""


def appears(file: Path) -> None:
    until = time.monotonic() + PATIENCE
    while not file.exists():
        assert time.monotonic() < until, f"no {file}"
        time.sleep(0.01)


def test_what_hangs_can_be_stopped(live: Live) -> None:
    before = live.model.state
    for name, (text, lines) in HANGS.items():
        live.save(f"import raymarch as rm\n{text}{SCENE}")
        live.wait(Started)
        begun = Path(f"{live.file}.begun")
        appears(begun)
        begun.unlink()
        live.reloader.interrupt()
        assert "stopped after" in live.wait(Failed).fault.what, name
        assert where(live)[0] == "scene.py" and where(live)[1] in lines, (name, live.model.fault)
    live.save(SCENE + "while True:\n    pass\n")
    live.wait(Started)
    assert live.model.state is before
    live.save(SCENE)  # the next save takes the place of what hangs
    live.wait(Loaded)


OWN_LIGHT = """
import raymarch as rm
class Lamp(rm.Sun):
    pass
scene = rm.Scene(rm.sphere(), lights=[Lamp()])
"""
"""A scene that a trial cannot send: its light is of a class of the file."""


def test_a_scene_that_is_loaded_in_the_window_must_end_too(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reload, "HERE_AT_LEAST", 1.0)  # for what never ends; what ends has the usual time
    monkeypatch.setattr(reload, "HERE_FACTOR", 0.0)
    before = threading.active_count()
    live.save(f"import sys\nif 'pytest' in sys.modules:\n    while True:\n        pass\n{OWN_LIGHT}")  # no trial has it
    assert "did not end" in live.wait(Failed).fault.what
    assert where(live)[0] == "scene.py" and where(live)[1] in (3, 4), live.model.fault
    assert threading.active_count() == before
    monkeypatch.undo()
    live.save(f"import sys\nif 'pytest' in sys.modules:\n    1 / 0\n{OWN_LIGHT}")
    live.wait(Failed)
    assert where(live) == ("scene.py", 3)
    live.save(OWN_LIGHT)
    live.wait(Loaded)
    assert live.model.fault is None and type(live.model.state.scene.lights[0]).__name__ == "Lamp"


CRASHES = {
    "sys.exit": "import sys\nsys.exit(3)\n",
    "os._exit": "import os\nos._exit(3)\n",
    "a crash": "import ctypes\nctypes.string_at(0)\n",
    "a deep recursion": "def f(): return f()\nf()\n",
    "all of the memory": "x = [0] * 10**13\n",
}


def test_a_scene_that_ends_or_crashes_python_is_a_fault(live: Live) -> None:
    for name, text in CRASHES.items():
        live.save(f"import raymarch as rm\n{text}")
        live.wait(Failed)
        assert where(live)[0] == "scene.py", name
    live.save(SCENE)
    live.wait(Loaded)


def test_a_scene_that_is_deleted_comes_back(live: Live) -> None:
    live.file.unlink()
    assert "cannot read scene file" in live.wait(Failed).fault.what
    live.save(SCENE)
    live.wait(Loaded)


def test_broken_edits_name_the_line(live: Live, tmp_path: Path) -> None:
    """In a real window, and more of them: `python -m tests.lab.window_broken`."""
    parts = tmp_path / "parts.py"
    parts.write_text(PARTS)
    live.save(GOOD)
    live.wait(Loaded)
    for broken in breaks(16):
        for file, text in ((parts, broken.parts.encode()), (live.file, broken.scene)):
            if file.read_bytes() != text:
                live.save(text, file)
        live.wait(Failed)
        if broken.file is not None:
            assert where(live) == (broken.file, broken.line), (broken.kind, live.model.fault)


def test_all_kinds_take_their_turn() -> None:
    kinds = {*REPLACED, *INSERTED, *WHOLE, *PARTS_BROKEN}
    assert {b.kind for b in breaks(len(kinds))} == kinds
    assert len({b.scene + b.parts.encode() for b in breaks(200)}) > len(kinds)


def test_a_message_calls_a_file_as_the_current_folder_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.py").write_text("one\ntwo\n")
    fault = Fault("it is wrong", "right", str(tmp_path / "scene.py"), 2)
    assert fault.text() == f"{tmp_path}/scene.py:2\n2 | two\nit is wrong\n(right)"
    monkeypatch.chdir(tmp_path)
    assert fault.text() == "scene.py:2\n2 | two\nit is wrong\n(right)"


def processes() -> dict[int, int]:
    """The parent of each process."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                found[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:  # it has ended meanwhile
                continue
    return found


def test_a_window_that_is_killed_leaves_no_process(tmp_path: Path) -> None:
    """The trial of an endless file ends with the process that started it."""
    (tmp_path / "scene.py").write_text("print('begun', flush=True)\nwhile True:\n    pass\n")
    run = "Trials().run('scene.py', {}, (64, 40), {'constants': {}, 'clicks': {}}, lambda: None)"
    code = f"from raymarch.window.trials import Trials; {run}"
    given: Any = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(ROOT)}, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], **given) as window:
        assert window.stderr is not None and window.stderr.readline() == b"begun\n"
        parents = processes()
        children = {pid for pid, parent in parents.items() if parent == window.pid}
        children |= {pid for pid, parent in parents.items() if parent in children}
        assert len(children) == 2
        window.kill()
        window.wait()
        until = time.monotonic() + PATIENCE
        while children & processes().keys() and time.monotonic() < until:
            time.sleep(0.05)
        assert not children & processes().keys()


def test_files_of_a_cache_are_not_watched(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each use touches them, so a window that watched them would load its scene without end."""
    ours, users, mine = tmp_path / "ours", tmp_path / "users", tmp_path / "scene" / "data.npz"
    monkeypatch.setenv("RAYMARCH_CACHE", str(ours))
    monkeypatch.setenv("XDG_CACHE_HOME", str(users))
    files = ours / "cells" / "a.npz", users / "matplotlib" / "fonts.json", mine
    for file in files:
        cache.save(file, {"values": np.zeros(3)})
    with recorded() as read:
        assert all(cache.load(file) is not None for file in files)
    assert {str(file) for file in files} <= set(read)
    assert [file for file in map(str, files) if may_belong(file)] == [str(mine)]


def test_lights_come_and_go_without_another_program(live: Live) -> None:
    lamp = "rm.PointLight(({}, 3, 2), intensity=3, shadow=True)"
    loaded = []
    for numbers in (range(2), range(3), range(1, 5), range(2, 4), [5]):
        lights = ", ".join(map(lamp.format, numbers))
        live.save(f"import raymarch as rm\n\nscene = rm.Scene(rm.sphere(), lights=[{lights}])\n")
        loaded.append(live.wait(Loaded))
    assert ["trial compile" in each.ms for each in loaded] == [True] + 4 * [False]
    assert len({each.prepared.texts["color"] for each in loaded}) == 1
