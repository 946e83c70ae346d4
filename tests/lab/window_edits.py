"""Kinds of edits of a scene file in a live window: `python -m tests.lab.window_edits [NAME ...]`.

For each: seconds from the save to the new picture, the share of them that a cold `raymarch render` of the same files
takes, and the verdict: the picture is that of a fresh renderer with the window's camera and parameter, and parameter,
camera and time are kept. The machine may be loaded: compare the share, not the seconds.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.scene import load
from tests.support import window_driver
from tests.support.window_driver import ROOT, Session, alike, serve_display

SIZE = (320, 200)
BELOW = slice(70, None)
"""Rows that no message covers."""

HELPER = "import raymarch as rm\n\ndef stand(height):\n    return rm.box((3, height, 3)).translate((0, -1.2, 0))\n"
SCENE = """import raymarch as rm
from helper import stand

RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
paint = rm.Material(color=(0.8, 0.2, 0.1))
ball = rm.sphere(RADIUS).material(paint)
scene = rm.Scene(
    ball | stand(0.2),
    camera=rm.Camera(position=(0, 1, 6), target=(0, 0, 0)),
    lights=[rm.Sun((1, 2, 1))],
)
"""
Act = Callable[[Path], None]


def renamed(text: str, name: str = "scene.py") -> Act:
    """A new file is renamed over the old one, as most editors do."""

    def act(folder: Path) -> None:
        (folder / f"{name}.new").write_text(text)
        os.replace(folder / f"{name}.new", folder / name)

    return act


def truncated(text: str) -> Act:
    """The file is emptied, and written in two parts with a pause between them."""

    def act(folder: Path) -> None:
        with (folder / "scene.py").open("w") as out:
            out.write(text[: len(text) // 2])
            out.flush()
            time.sleep(0.03)
            out.write(text[len(text) // 2 :])

    return act


def replaced(text: str) -> Act:
    """The file is deleted, and made again after a while."""

    def act(folder: Path) -> None:
        (folder / "scene.py").unlink()
        time.sleep(0.1)
        (folder / "scene.py").write_text(text)

    return act


def of(old: str, new: str) -> str:
    assert old in SCENE
    return SCENE.replace(old, new)


TALLER = HELPER.replace("(3, height, 3)", "(3, 2 * height, 3)")
SECOND = of("2.0)\n", '2.0)\nSIDE = rm.Param("side", 0.5, 0.1, 1)\n').replace("stand(0.2)", "stand(SIDE)")
EDITS: dict[str, list[Act]] = {
    "a number": [renamed(of("stand(0.2)", "stand(0.3)"))],
    "the same number": [renamed(of("stand(0.2)", "stand(0.4)"))],
    "another shape": [renamed(of("stand(0.2)", "stand(0.2) | rm.torus(1.6, 0.2)"))],
    "truncate and write": [truncated(of("rm.sphere(RADIUS)", "rm.box(RADIUS)"))],
    "delete and create": [replaced(of("rm.sphere(RADIUS)", "rm.octahedron(RADIUS)"))],
    "error, then mend": [renamed(of("stand(0.2)", "stand(-0.2)")), renamed(of("stand(0.2)", "stand(0.25)"))],
    "syntax, then mend": [renamed(of("stand(0.2)", "stand(0.2")), renamed(of("stand(0.2)", "stand(0.35)"))],
    "another variable": [renamed(SCENE.replace("ball", "thing"))],
    "a module": [renamed(TALLER, "helper.py")],
    "the module again": [renamed(HELPER, "helper.py")],
    "material": [renamed(of("(0.8, 0.2, 0.1)", "(0.1, 0.7, 0.2), roughness=0.3"))],
    "parameter added": [renamed(SECOND)],
    "parameter removed": [renamed(of("stand(0.2)", "stand(0.3)"))],
    "parameter ranged": [renamed(of("0.5, 2.0)", "0.8, 1.5)"))],
    "light added": [renamed(of("1))]", "1)), rm.PointLight((-3, 2, 3), intensity=8)]"))],
    "light with shadow": [renamed(of("rm.Sun((1, 2, 1))", "rm.Sun((1, 2, 1), shadow=True, softness=0.1)"))],
    "quality": [renamed(of("    lights", "    quality=rm.Quality(max_steps=32, analytic=False),\n    lights"))],
    "a function": [renamed(of("scene = rm.Scene(", "def scene():\n  return rm.Scene("))],
    "camera": [renamed(of("position=(0, 1, 6)", "position=(0, 2, 6)"))],
    "a solid alone": [renamed(of("\nscene = rm.Scene(", "\nscene = ball | stand(0.2)\nunused = rm.Scene("))],
    "back": [renamed(SCENE)],
}
TURNED = {"camera": [0, 2, 6], "a solid alone": None, "back": [0, 1, 6]}
"""Edits that change the camera in the file, and where it stands then; None for the studio's own."""


def settings(session: Session) -> dict[str, Any]:
    """Camera, parameters and time, as Ctrl+S saves them."""
    mark = session.mark()
    session.hand.key("Control_L", "s")
    file = session.folder / session.wait("saved", since=mark)["file"]
    found: dict[str, Any] = json.loads(file.read_text())
    file.unlink()
    return found


def fresh(folder: Path, kept: dict[str, Any]) -> Any:
    """The picture of the files as they are, with what the window keeps."""
    from raymarch.scene.studio import staged

    sys.path.insert(0, str(folder))
    sys.modules.pop("helper", None)
    sys.dont_write_bytecode = True
    scene = staged(load(folder / "scene.py"))
    sys.path.remove(str(folder))
    seen = kept["camera"]
    camera = replace(
        scene.camera, **{name: tuple(seen[name]) for name in ("position", "target", "up")}, fov=seen["fov"]
    )
    with rm.Renderer(SIZE) as renderer:
        frame = renderer.render(scene.replace(camera=camera), params=kept["params"])
        return np.asarray(frame.image().convert("RGB")).astype(int)


def cold(folder: Path) -> float:
    """Seconds of `raymarch render` in a process of its own."""
    start = time.monotonic()
    command = [sys.executable, "-m", "raymarch", "render", "scene.py", "-o", "cold.png", "--size", "320x200"]
    subprocess.run(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True, capture_output=True)
    return time.monotonic() - start


def tried(session: Session, name: str, before: dict[str, Any], moved: bool) -> str:
    """Make an edit. Its line of the table, with the share of a cold render."""
    *earlier, last = EDITS[name]
    for act in earlier:
        mark = session.mark()
        act(session.folder)
        session.wait("failed", since=mark)
    mark, start = session.mark(), time.time()
    last(session.folder)
    session.wait("loaded", since=mark)
    events = session.events()
    at = next(i for i, e in enumerate(events) if i >= mark and e["event"] == "loaded")
    shown = next(e for e in events[at:] if e["event"] == "frame")["when"] - start
    picture, after = session.settled(), settings(session)
    right = alike(picture[BELOW], fresh(session.folder, after)[BELOW])
    kept = all(after[key] == before[key] for key in ("params", "time", "view"))
    if moved and name in TURNED:  # the newer change of the camera is the file's
        kept = kept and TURNED[name] in (None, after["camera"]["position"])
    elif moved:
        kept = kept and after["camera"] == before["camera"]
    whole = cold(session.folder)
    words = f"{'right' if right else 'WRONG'}, {'kept' if kept else 'LOST'}"
    return f"{name:20} {shown:6.2f} s  {shown / whole:5.2f} of a cold render  {words}"


def main(names: list[str]) -> int:
    window_driver.PATIENCE = 200.0
    bad, shares = 0, list[float]()
    for moved in (False, True):
        with serve_display() as display, tempfile.TemporaryDirectory() as given:
            folder = Path(given)
            (folder / "helper.py").write_text(HELPER)
            (folder / "scene.py").write_text(SCENE)
            with Session(display, folder, folder / "scene.py", "--size", "320x200") as session:
                session.wait("watching")
                session.hand.key("n")
                session.raised(4)
                session.hand.key("Escape")
                if moved:
                    session.hand.drag((160, 100), (200, 120))
                session.settled()
                before = settings(session)
                print("camera moved" if moved else "camera of the file", before["params"], flush=True)
                for name in names or EDITS:
                    line = tried(session, name, before, moved)
                    shares.append(float(line.split()[-7]))
                    bad += "WRONG" in line or "LOST" in line
                    print(line, flush=True)
    print(f"median {statistics.median(shares):.2f} of a cold render, {bad} of {len(shares)} wrong or lost")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
