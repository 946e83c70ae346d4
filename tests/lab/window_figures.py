"""What the window costs in time: `python -m tests.lab.window_figures`, on a quiet machine; some five minutes.

For each example, in a window of 640 x 360:

- save to picture: the time from a save that is seen to the new picture, for an edited number and for a new shape, with
  its parts. `trial` is the process that the scene is tried out in, `import`, `plan`, `compile` and `first frame` are
  the window's own;
- what a moved parameter compiles;
- for a camera that never stands still, which part of the frames keeps 1.5 times the budget, at which resolution, and
  how long the whole picture takes once it stands still.

Each bar gets a verdict; the exit code is 1 if one is missed. What moves by itself is paused.
"""

from __future__ import annotations

import argparse
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.support.window_driver import ROOT, Session, serve_display

BUDGET = 33.0
KEPT = 0.95
SIZE = (640, 360)


def number(_: int) -> str:
    """An edit of a number, which no driver has seen."""
    return f"scene = scene.replace(sky=rm.Sky(({random.uniform(0.1, 0.9):.9f}, 0.3, 0.5)))\n"


def shape(count: int) -> str:
    """An edit that makes another shader: so many new shapes."""
    places = [tuple(round(random.uniform(-1, 1), 9) for _ in range(3)) for _ in range(count + 1)]
    return f"scene = scene.replace(node=rm.union(scene.node, *[rm.sphere(0.1).translate(at) for at in {places}]))\n"


def reloads(session: Session, text: str, edit: Callable[[int], str], edits: int) -> list[dict[str, float]]:
    """Milliseconds of the parts of so many reloads."""
    found: list[dict[str, float]] = []
    for i in range(edits):
        mark = session.save(f"{text}\nimport raymarch as rm\n{edit(i)}")
        loaded = session.wait("loaded", since=mark)
        ms = loaded["ms"]
        own = {name: ms[name] for name in ("import", "plan", "compile", "first frame")}
        trial = sum(spent for name, spent in ms.items() if name.startswith("trial"))
        found.append({"total": loaded["total"], "trial": trial, **own, "programs": loaded["compiled"]})
        session.settled()
    return found


def told(found: list[dict[str, float]]) -> str:
    """The median and the spread of the total, and the medians of the parts."""
    totals = sorted(each["total"] for each in found)
    parts = ", ".join(
        f"{part} {statistics.median(each[part] for each in found):.0f}"
        for part in ("trial", "import", "plan", "compile", "first frame")
    )
    without = sum(each["programs"] == 0 for each in found)
    return (
        f"median {statistics.median(totals):.0f} ms, {totals[0]:.0f} to {totals[-1]:.0f} "
        f"({parts}); {without} of {len(found)} compiled nothing"
    )


def parameters(session: Session) -> int | None:
    """How many programs were compiled by moving each parameter; None if there is none."""
    before = [e["compiled"] for e in session.events() if e["event"] == "frame"][-1]
    moved, mark = False, session.mark()
    for _ in range(8):
        session.hand.key("n")
        for _ in range(2):
            session.hand.key("Right")
        session.settled()
        moved = moved or any(e["event"] == "param" for e in session.events()[mark:])
    session.hand.key("Escape")
    session.settled()
    after = [e["compiled"] for e in session.events() if e["event"] == "frame"][-1]
    return int(after - before) if moved else None


def moving(session: Session, seconds: float) -> tuple[bool, str]:
    """A camera that is dragged about all the time: whether it keeps the budget, and how."""
    mark, hand = session.mark(), session.hand
    hand.move(SIZE[0] // 2, SIZE[1] // 2)
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
    times = [e["ms"] + e["rest"] for e in frames]
    kept = statistics.mean(ms <= 1.5 * BUDGET for ms in times)
    share = statistics.median(e["size"][0] / SIZE[0] for e in frames)
    return kept >= KEPT, (
        f"{100 * kept:.1f} % of {len(frames)} frames within {1.5 * BUDGET:.1f} ms, median "
        f"{statistics.median(times):.1f}, longest {max(times):.0f} ms, at {share:.2f} of the width; "
        f"whole {whole:.0f} ms after the stop"
    )


def measure(display: str, example: Path, edits: int, seconds: float) -> list[str]:
    """Print the figures of an example; the bars that it misses."""
    missed = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for beside in example.parent.iterdir():
            if beside.is_file():
                (folder / beside.name).write_bytes(beside.read_bytes())
        text = example.read_text()
        (folder / "scene.py").write_text(text)
        size = f"{SIZE[0]}x{SIZE[1]}"
        with Session(display, folder, folder / "scene.py", "--size", size, moving=True) as session:
            session.wait("watching")
            session.hand.key("space")
            session.settled()
            compiled = parameters(session)
            if compiled is not None:
                missed += [f"{example.name}: a parameter compiles"] if compiled else []
                print(f"{example.name}: moved parameters compiled {compiled} programs: {verdict(compiled == 0)}")
            keeps, how = moving(session, seconds)
            missed += [] if keeps else [f"{example.name}: the frame budget"]
            print(f"{example.name}: moving: {how}: {verdict(keeps)}")
            print(f"{example.name}: a number saved: {told(reloads(session, text, number, edits))}")
            print(
                f"{example.name}: a shape saved: {told(reloads(session, text, shape, max(edits // 2, 1)))}", flush=True
            )
    return missed


def verdict(kept: bool) -> str:
    return "kept" if kept else "MISSED"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--edits", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=8.0, help="of a moving camera")
    parser.add_argument("scenes", nargs="*", type=Path, default=sorted((ROOT / "examples").glob("*.py")))
    asked = parser.parse_args()
    missed: list[str] = []
    with serve_display() as display:
        for example in asked.scenes:
            missed += measure(display, example, asked.edits, asked.seconds)
    print(f"bars missed: {'; '.join(missed) or 'none'}")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
