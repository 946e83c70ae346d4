"""Scenes tried out in another process: by forks, as on Linux, and by a process for each, as elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

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

    start = time.monotonic()
    stopped = run("while True:\n    pass\n", lambda: "stopped" if time.monotonic() > start + 1.0 else None)
    assert stopped is not None and stopped["error"]["what"] == "stopped" and stopped["error"]["line"] in (2, 3)

    start = time.monotonic()
    assert run("while True:\n    pass\n", lambda: "changed" if time.monotonic() > start + 1.0 else None) is None

    good = run("")
    assert good is not None and good["ok"]
