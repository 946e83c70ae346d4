"""Scenes tried out in another process: by forks, as on Linux, and by a process for each, as elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from raymarch.scene.file import load
from raymarch.scene.scene import Scene
from raymarch.window import trial
from raymarch.window.sent import packed
from raymarch.window.trials import Trials

SCENE = "import raymarch as rm\n{}scene = rm.Scene(rm.sphere(0.7))\n"
KNOWN: dict[str, Any] = {"constants": {}, "clicks": {}}


@pytest.fixture(params=[True, False], ids=["forks", "processes"])
def trials(request: pytest.FixtureRequest) -> Iterator[Trials]:
    made = Trials(forks=request.param)
    yield made
    made.close()


def test_what_a_scene_file_does_is_told(trials: Trials, tmp_path: Path) -> None:
    file = tmp_path / "scene.py"

    def run(text: str, over: Callable[[], str | None] = lambda: None) -> dict[str, Any] | None:
        file.write_text(SCENE.format(text))
        return trials.run(str(file), {}, (80, 48), KNOWN, over)

    for _ in range(2):
        good = run("")
        assert good is not None and good["ok"] and good["ms"]["compile"] > 0 and str(file) in good["files"]

    wrong = run("rm.sphere(-1)\n")
    assert wrong is not None and (wrong["error"]["file"], wrong["error"]["line"]) == (str(file), 2)

    ended = run("import os\nos._exit(3)\n")
    assert ended is not None and "code 3" in ended["error"]["what"]

    hung = Path(f"{file}.hangs")
    hangs = f"open({str(hung)!r}, 'w').close()\nwhile True:\n    pass\n"
    stopped = run(hangs, lambda: "stopped" if hung.exists() else None)
    assert stopped is not None and stopped["error"]["what"] == "stopped" and stopped["error"]["line"] in (2, 3, 4)

    hung.unlink()
    assert run(hangs, lambda: "changed" if hung.exists() else None) is None

    good = run("")
    assert good is not None and good["ok"]


LIT = "lights=[rm.Sun((1, 2, i), shadow=True) for i in range({})]"


@pytest.mark.parametrize("counts", [(2, 3), (3, 2), (1, 2), (7, 8)])
def test_what_one_light_more_or_less_needs_is_compiled_before(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, counts: tuple[int, int]
) -> None:
    """The driver's cache on disk has the program of the next number of lights as soon as a trial is over."""
    compiled: list[str] = []
    monkeypatch.setattr(trial, "_warm", lambda scene, ready, *_: compiled.extend(ready.texts.values()))
    file, memory = tmp_path / "scene.py", trial.LightMemory()
    asked = {"id": 1, "scene": str(file), "params": {}, "size": (80, 48), **KNOWN}

    def tried(count: int, lights: trial.LightMemory | None) -> Scene:
        file.write_text(f"import raymarch as rm\nscene = rm.Scene(rm.sphere(0.7), {LIT.format(count)})\n")
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stdin", sys.stdin)
            trial.examine({**asked, "lights": None if lights is None else packed(lights)}, lambda answer: None)
            sys.stdin.close()  # a trial opens its own
        return trial.progressive(trial.staged(load(file)))

    assert memory.fit(tried(counts[0], None), str(file)) is None
    before = set(compiled)
    compiled.clear()
    tried(counts[1], memory)
    assert len(before) >= 2 and compiled and set(compiled) <= before
