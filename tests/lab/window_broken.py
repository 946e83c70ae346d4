"""Broken edits in a window that stays: `python -m tests.lab.window_broken [--edits 200] [--seed 1]`.

Each edit breaks the scene; the window must keep its picture, go on moving it, and name the right file and line.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.support.breakage import GOOD, PARTS, Break, breaks
from tests.support.window_driver import Session, serve_display


@dataclass
class Score:
    """What came of a run."""

    edits: int = 0
    lost: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    placed: int = 0

    def __str__(self) -> str:
        right = self.placed - len(self.wrong)
        words = [
            f"{self.edits} broken edits: {len(self.lost)} lost pictures; "
            f"file and line right in {right} of the {self.placed} that have one"
        ]
        return "\n".join([*words, *self.lost, *self.wrong])


def run(display: str, folder: Path, count: int, seed: int = 1) -> Score:
    """Break the scene so many times in one window, move the camera each time, and mend it at the end."""
    (folder / "parts.py").write_text(PARTS)
    scene = folder / "scene.py"
    scene.write_text(GOOD)
    score = Score()
    with Session(display, folder, scene, "--size", "200x120") as session:
        session.settled()
        session.wait("watching")
        for i, broken in enumerate(breaks(count, seed)):
            _break(session, broken, score, i)
        mark = session.mark()
        _write(session, GOOD.encode(), PARTS)
        session.wait("loaded", since=mark)
        session.hand.key("r")
        session.settled()
        session.hand.key("Control_L", "q")
        if session.end() != 0 or session.complaints():
            score.lost.append(f"at the end: {session.complaints()}")
    return score


def _break(session: Session, broken: Break, score: Score, number: int) -> None:
    mark = session.mark()
    _write(session, broken.scene, broken.parts)
    failed = session.wait("failed", since=mark)
    score.edits += 1
    if broken.file is not None:
        score.placed += 1
        place = (Path(failed["file"] or "").name, failed["line"])
        if place != (broken.file, broken.line):
            score.wrong.append(f"{broken.kind}: {place}, not {(broken.file, broken.line)}: {failed['what']}")
    before = session.hand.see()[:50]
    mark = session.mark()
    session.hand.drag((100, 40), (100 + 20 * (-1) ** number, 40), steps=2)
    frame = session.wait("frame", since=mark)
    after = session.settled()[:50]
    if not frame or np.array_equal(before, after) or after.std() < 5:
        score.lost.append(f"{broken.kind}: the picture did not move")


def _write(session: Session, scene: bytes, parts: str) -> None:
    """Save what is to change; one change at a time."""
    for file, data in (("parts.py", parts.encode()), ("scene.py", scene)):
        if (session.folder / file).read_bytes() != data:
            session.save(data, file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edits", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with serve_display() as display, tempfile.TemporaryDirectory() as folder:
        score = run(display, Path(folder), asked.edits, asked.seed)
    print(score)
    sys.exit(bool(score.lost) or len(score.wrong) > 0.01 * score.placed)


if __name__ == "__main__":
    main()
