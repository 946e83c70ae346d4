"""What people do to a window, by real events: `python -m tests.lab.window_trials FOLDER [NAME ...]`.

Each trial prints a line and saves a picture to look at.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from tests.support import window_driver
from tests.support.window_driver import Session, serve_display

BALL = """import raymarch as rm
radius = rm.Param("radius", 1.0, 0.5, 2.0)
scene = rm.Scene(rm.sphere(radius) | rm.plane(offset=-1), camera=rm.Camera(position=(0, 1, 6), target=(0, 0, 0)))
"""
STILL = "import raymarch as rm\nscene = rm.sphere()\n"
MANY = (
    "import raymarch as rm\nps = [rm.Param(f'height of ball {i}', 0.01 * i, 0, 1) for i in range(60)]\n"
    "balls = (rm.sphere(0.3).translate((i % 10 - 4.5, p, i // 10 - 2.5)) for i, p in enumerate(ps))\n"
    "scene = rm.Scene(rm.union(*balls))\n"
)
VECTORS = """import raymarch as rm
size = rm.Param("size", (1.0, 2.0, 1.0), 0.1, 3)
free = rm.Param("free vector with a rather long name", (0.0, 0.0, 0.0))
tint = rm.Param("tint", (0.9, 0.3, 0.1), 0, 1)
scene = rm.Scene(rm.box(size).translate(free).material(rm.Material(color=tint)))
"""
INSIDE = (
    "import raymarch as rm\nscene = rm.Scene(rm.sphere(2), camera=rm.Camera(position=(0, 0, 0.5), target=(0, 0, -1)))\n"
)
SLOW = """import raymarch as rm
rng = [((i * 7919) % 97 / 97 - 0.5, (i * 104729) % 89 / 89 - 0.5, (i * 1299709) % 83 / 83 - 0.5) for i in range(60)]
balls = rm.union(*(rm.sphere(0.35).translate((5 * x, 2 * y, 5 * z)) for x, y, z in rng), k=0.3)
fractals = rm.mandelbulb().translate((3, 1, 0)) | rm.menger(3).scale(0.8).translate((-3, 1, 0))
suns = [rm.Sun(sun_direction=d, shadow=True, softness=0.1) for d in ((1, 2, 1.5), (-1, 2, 0.5))]
scene = rm.Scene(balls | fractals | rm.plane(offset=-1.5), camera=rm.Camera(position=(0, 3, 9), target=(0, 0, 0)),
                 lights=suns, sky=rm.GradientSky(light=True))
"""
TURNING = "import raymarch as rm\nscene = rm.Scene(rm.torus().rotate(rm.time, 'x'))\n"

Trial = Callable[[Session, Path], str]


def none(session: Session, folder: Path) -> str:
    session.hand.key("n")
    session.hand.key("Right")
    return "N and an arrow"


def many(session: Session, folder: Path) -> str:
    for _ in range(45):
        session.hand.key("n")
    return "the 45th of 60 is selected"


def vectors(session: Session, folder: Path) -> str:
    return "vectors and colours in the panel"


def inside(session: Session, folder: Path) -> str:
    session.hand.click(440, 150)
    session.wait("truth")
    return f"a picture with {len(np.unique(session.settled().reshape(-1, 3), axis=0))} colours"


def resized(session: Session, folder: Path) -> str:
    """While another shader is compiled."""
    mark = session.save(SLOW)
    session.wait("reloading", since=mark)
    for width in (500, 700, 420, 640):
        session.hand.resize(width, 300)
        time.sleep(0.1)
    session.wait("loaded", since=mark)
    return f"size {session.settled().shape[:2]}"


def vim(session: Session, folder: Path) -> str:
    """The old file is renamed, and a new one is made in its place, in two steps."""
    mark = session.mark()
    (folder / "scene.py").rename(folder / "scene.py~")
    time.sleep(0.05)
    (folder / "scene.py").write_text(BALL.replace("plane(offset=-1)", "plane(offset=-0.5)"))
    session.wait("loaded", since=mark)
    time.sleep(0.3)
    failed = [e for e in session.events()[mark:] if e["event"] == "failed"]
    return f"loaded; {len(failed)} errors before it"


def undone(session: Session, folder: Path) -> str:
    """A slider, a reload, and undo."""
    session.hand.key("n")
    for _ in range(5):
        session.hand.key("Right")
    mark = session.save(BALL.replace("plane(offset=-1)", "plane(offset=-0.5)"))
    session.wait("loaded", since=mark)
    mark = session.mark()
    session.hand.key("Control_L", "z")
    session.wait("returned", since=mark)
    mark = session.mark()
    session.hand.key("Right")
    value = session.wait("param", since=mark)["value"]
    return f"radius after undo and one step: {value:.3g} (1.03)"


def film(session: Session, folder: Path) -> str:
    """A film while a slider moves: the pictures keep one value or follow, and the window stays alive."""
    mark = session.mark()
    session.hand.key("Control_L", "p")
    session.hand.key("n")
    for _ in range(10):
        session.hand.key("Right")
        time.sleep(0.02)
    made = session.wait("saved", since=mark)
    return f"{made['file']}"


def minimised(session: Session, folder: Path) -> str:
    """No frame is drawn while the window cannot be seen; all is there again afterwards."""
    before = session.settled()
    session.hand._window.unmap()
    session.hand._display.sync()
    time.sleep(0.5)
    mark = session.mark()
    time.sleep(1.0)
    drawn = sum(e["event"] == "frame" for e in session.events()[mark:])
    session.hand._window.map()
    session.hand._display.sync()
    time.sleep(0.3)
    same = np.array_equal(before, session.hand.see())
    return f"{drawn} frames in a second of a still scene; the same picture again: {same}"


def slow(session: Session, folder: Path) -> str:
    """The first picture, the longest stall of a drag, and of the tiles: a budget of 33 ms, and a last one of 99."""
    frames = [e for e in session.events() if e["event"] == "frame"]
    start = time.monotonic()
    mark = session.mark()
    session.hand.move(400, 150)
    session.hand.press()
    for i in range(40):
        session.hand.move(400 + 3 * i, 150)
        time.sleep(0.05)
    session.hand.release()
    moved = [e for e in session.events()[mark:] if e["event"] == "frame" and e["moving"]]
    spent, stalls = time.monotonic() - start, [e["ms"] + e["rest"] for e in moved]
    session.wait("frame", lambda e: e["whole"] and not e["preview"])
    still = [e["ms"] for e in session.events() if e["event"] == "frame" and not e["moving"] and not e["preview"]]
    return (
        f"first picture {frames[0]['ms']:.0f} ms (bar 500); dragging {len(moved)} frames in {spent:.0f} s, "
        f"longest {max(stalls):.0f} ms (bar 150); tiles of a frame up to {max(still[2:], default=0):.0f} ms"
    )


TRIALS: dict[str, tuple[str, Trial, tuple[str, ...]]] = {
    "none": (STILL, none, ("--panel",)),
    "many": (MANY, many, ()),
    "many-panel": (MANY, vectors, ("--panel",)),
    "vectors": (VECTORS, vectors, ("--panel",)),
    "inside": (INSIDE, inside, ()),
    "resized": (BALL, resized, ()),
    "vim": (BALL, vim, ()),
    "undone": (BALL, undone, ()),
    "film": (TURNING.replace("rm.torus()", "rm.torus(1, rm.Param('minor', .2, .1, .4))"), film, ()),
    "minimised": (BALL, minimised, ()),
    "slow": (SLOW, slow, ()),
}


def main() -> None:
    folder, names = Path(sys.argv[1]), sys.argv[2:] or list(TRIALS)
    window_driver.PATIENCE = 120.0
    with serve_display() as display:
        for name in names:
            text, act, options = TRIALS[name]
            with tempfile.TemporaryDirectory() as inner:
                scene = Path(inner) / "scene.py"
                scene.write_text(text)
                with Session(display, Path(inner), scene, "--size", "640x360", *options, moving=True) as session:
                    try:
                        if name != "slow":  # its first moments are measured
                            session.wait("watching")
                        words = act(session, Path(inner))
                        time.sleep(0.2)
                        Image.fromarray(session.hand.see()).save(folder / f"{name}.png")
                    except AssertionError as fault:
                        words = f"FAILED: {str(fault)[-300:]}"
                    print(f"{name}: {words} {session.complaints()}", flush=True)


if __name__ == "__main__":
    main()
