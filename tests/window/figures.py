"""What the window costs in time: `python -m tests.window.figures [--edits 9] [--seconds 5]`, on a quiet machine.

For each example: the median time from a save that is seen to the new picture, with its parts; and for a camera that
never stands still in a window of 640 x 360, which part of the frames keeps 1.5 times the budget, at which resolution,
and how long the whole picture takes once it stands still. What moves by itself is paused.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from window_driver import ROOT, Session, serve_display

BUDGET = 33.0


def reload_times(session: Session, text: str, edits: int) -> dict[str, float]:
    """Medians in milliseconds of the parts of so many reloads, each with a number that no driver has seen."""
    found: list[dict[str, float]] = []
    for _ in range(edits):
        mark = session.mark()
        fresh = session.folder / "scene.py.new"
        fresh.write_text(
            f"{text}\nimport raymarch as rm\nscene.sky = rm.Sky(({0.1 + 0.8 * random.random():.9f}, 0.3, 0.5))\n"
        )
        os.replace(fresh, session.folder / "scene.py")
        loaded = session.wait("loaded", since=mark)
        found.append({**loaded["ms"], "total": loaded["total"]})
        session.settled()
    return {name: statistics.median(each[name] for each in found) for name in found[0]}


def moving(session: Session, seconds: float) -> str:
    """A camera that is dragged about all the time."""
    mark, hand = session.mark(), session.hand
    hand.move(320, 180)
    hand.press()
    end, i = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        i += 1
        hand.move(320 + 100 * (i % 2) + i % 7, 180 + i % 5)
        time.sleep(0.004)
    hand.release()
    stopped = session.mark()
    start = time.monotonic()
    session.wait("frame", lambda e: e["samples"] >= 1, stopped)
    whole = 1e3 * (time.monotonic() - start)
    frames = [e for e in session.events()[mark:stopped] if e["event"] == "frame" and e["moving"]]
    kept = [e["ms"] + e["rest"] <= 1.5 * BUDGET for e in frames]
    sizes = [e["size"][0] / 640 for e in frames]
    return (
        f"{len(frames)} frames, {100 * statistics.mean(kept):.1f} % within {1.5 * BUDGET:.1f} ms, "
        f"median {statistics.median(e['ms'] + e['rest'] for e in frames):.1f} ms at {statistics.median(sizes):.2f} "
        f"of the width; whole {whole:.0f} ms after the stop"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edits", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("scenes", nargs="*", type=Path, default=sorted((ROOT / "examples").glob("*.py")))
    asked = parser.parse_args()
    with serve_display() as display:
        for example in asked.scenes:
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                for beside in example.parent.iterdir():
                    if beside.is_file():
                        (folder / beside.name).write_bytes(beside.read_bytes())
                text = example.read_text()
                (folder / "scene.py").write_text(text)
                session = Session(display, folder, folder / "scene.py", "--size", "640x360", moving=True)
                try:
                    session.wait("watching")
                    session.hand.key("space")
                    medians = reload_times(session, text, asked.edits)
                    parts = ", ".join(f"{part} {ms:.0f}" for part, ms in medians.items())
                    print(f"{example.name}: save to picture, ms: {parts}")
                    print(f"{example.name}: moving: {moving(session, asked.seconds)}", flush=True)
                finally:
                    session.kill()


if __name__ == "__main__":
    main()
