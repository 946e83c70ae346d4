"""Random events and edits for minutes: `python -m tests.lab.window_soak --minutes N [--seed 1]`.

Prints the memory of the window's process and the OpenGL objects that are alive in its context, minute by minute, and
fails if either grows after the first part of the run, or if anything was printed as an error. Objects are counted by
asking OpenGL about every name, not by our own books.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.support.breakage import GOOD, PARTS, breaks
from tests.support.window_driver import Session, serve_display

KINDS = ("Texture", "Buffer", "Program", "Framebuffer", "VertexArray", "Query", "Shader")
NAMES = 50_000
"""OpenGL names that are asked about; drivers give out small ones first."""

GROWTH = 0.05
"""The part by which memory may be larger at the end than after a fifth of the run: pages that are used in part only."""


def inside(scene: Path, log: Path) -> int:
    """The window's process: as the command runs it, and it says now and then what is alive."""
    from raymarch.window.viewer import Viewer

    viewer = Viewer(scene, (240, 160), log=log, samples=4)
    viewer.renderer.kept = 8  # so that a short run fills what is kept
    viewer.reloader.start(viewer.model.state.base, viewer._read)
    gl = ctypes.CDLL("libGL.so.1")
    asks = {kind: getattr(gl, f"glIs{kind}") for kind in KINDS}
    for ask in asks.values():
        ask.restype = ctypes.c_ubyte
    after = time.monotonic()
    try:
        while not viewer.window.closing:
            viewer.turn()
            if time.monotonic() > after:
                with viewer.window.context.bound():
                    alive = {kind: sum(ask(i) for i in range(1, NAMES)) for kind, ask in asks.items()}
                viewer.model.say("alive", objects=alive, kilobytes=_memory())
                after = time.monotonic() + 2.0
    finally:
        viewer.model.say("closed", code=0)
        viewer.release()
    return 0


def _memory() -> int:
    """Kilobytes that the process holds, once the allocator has given back what nobody uses."""
    ctypes.CDLL(None).malloc_trim(0)
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1])
    return 0


def act(session: Session, draw: random.Random) -> None:
    """Something that a user may do."""
    hand = session.hand
    place = (draw.randrange(240), draw.randrange(160))
    other = (draw.randrange(240), draw.randrange(160))
    match draw.randrange(12):
        case 0 | 1:
            hand.drag(place, other, button=draw.choice((1, 2, 3)))
        case 2:
            hand.wheel(draw.choice((-2, -1, 1, 2)))
        case 3:
            hand.click(*place)
        case 4:
            names = ("v", "n", "Right", "Left", "space", "period", "Home", "h", "Escape", "f", "l", "k", "o", "x")
            hand.key(draw.choice(names))
        case 5:
            hand.key("r")
        case 6:
            hand.resize(240 + draw.randrange(60), 160 + draw.randrange(40))
        case 7:
            hand.key("Tab")
        case 8:
            key = draw.choice("wasdqe")
            hand.hold(key)
            time.sleep(0.1)
            hand.let_go(key)
        case 9 | 10:
            edit(session, draw)
        case 11:
            hand.move(*place)


def edit(session: Session, draw: random.Random) -> None:
    """Save the scene: with another number, moving, or broken."""
    size = round(draw.uniform(0.4, 0.8), 3)
    good = GOOD.replace("rm.sphere(0.65)", f"rm.sphere({size})")
    text = draw.choice((good, good.replace("offset=-1.0", "offset=-1.0 - 0.1 * rm.time"), None))
    data = next(breaks(1, draw.randrange(10**6))).scene if text is None else text.encode()
    (session.folder / "scene.py").write_bytes(data)


def run(display: str, folder: Path, minutes: float, seed: int) -> list[dict[str, Any]]:
    """A session of random acts; what was alive over time."""
    (folder / "parts.py").write_text(PARTS)
    scene = folder / "scene.py"
    scene.write_text(GOOD)
    command = [sys.executable, "-m", "tests.lab.window_soak", "--inside", str(scene), str(folder / "log.jsonl")]
    draw, end = random.Random(seed), time.monotonic() + 60 * minutes
    acts = 0
    with Session(display, folder, scene, command=command) as session:
        while time.monotonic() < end:
            act(session, draw)
            acts += 1
            time.sleep(draw.choice((0.0, 0.02, 0.1)))
            if session.process.poll() is not None:
                raise AssertionError(f"the window ended:\n{session.errors.read_text()}")
        (folder / "scene.py").write_text(GOOD)
        session.hand.close_window()
        session.end()
        errors = session.errors.read_text()
    print(f"{acts} acts, {sum(e['event'] == 'loaded' for e in session.events())} loaded, ", end="")
    print(f"{sum(e['event'] == 'failed' for e in session.events())} failed")
    if "Traceback" in errors:
        raise AssertionError(errors)
    return [e for e in session.events() if e["event"] == "alive"]


def main() -> None:
    if sys.argv[1:2] == ["--inside"]:
        sys.exit(inside(Path(sys.argv[2]), Path(sys.argv[3])))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with serve_display() as display, tempfile.TemporaryDirectory() as folder:
        alive = run(display, Path(folder), asked.minutes, asked.seed)
    for i in range(0, len(alive), max(1, len(alive) // 20)):
        print(json.dumps({"kilobytes": alive[i]["kilobytes"], **alive[i]["objects"]}))
    sys.exit(verdict(alive))


def verdict(alive: list[dict[str, Any]]) -> int:
    """0 if nothing grew: the last fifth of the run against the second, by the most of each."""
    fifth = max(1, len(alive) // 5)
    early, late = alive[fifth : 2 * fifth], alive[-fifth:]
    code = 0
    for name, most in (("memory", 1 + GROWTH), *((kind, 1.0) for kind in KINDS)):
        first, last = (
            max(e["kilobytes"] if name == "memory" else e["objects"][name] for e in part) for part in (early, late)
        )
        # Programs and data are kept for later, up to a fixed number; a run must be long enough to reach it.
        grew = last > first * most + (0 if name == "memory" else 2)
        print(f"{name}: {first} after a fifth, {last} at the end{'  GREW' if grew else ''}")
        code |= int(grew)
    return code


if __name__ == "__main__":
    main()
