"""The pictures of docs/window.md: `python -m tests.lab.window_screenshot [FOLDER]`."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from tests.support import window_driver
from tests.support.window_driver import ROOT, Session, serve_display

SIZE = (900, 560)
SCENE = """import raymarch as rm

radius = rm.Param("radius", 1.0, 0.5, 2.0)
tint = rm.Param("tint", (0.75, 0.2, 0.08), 0, 1)
ball = rm.sphere(radius).material(rm.Material(color=tint, shininess=90))
gold = rm.Material(albedo=(0.9, 0.7, 0.3), metalness=1.0, roughness=0.3)
ring = rm.torus(1.6, 0.2).rotate(0.6, "x").material(gold)
scene = rm.Scene(
    ball | ring | rm.plane(offset=-1.4).material(rm.Material(color=(0.25, 0.35, 0.4))),
    camera=rm.Camera(position=(3, 2.2, 6.5), target=(0, 0, 0)),
    lights=[rm.Sun(sun_direction=(1, 2, 1.5), shadow=True), rm.PointLight(position=(-3, 2, 4), intensity=4)],
    sky=rm.GradientSky(light=True),
)
"""


def work(session: Session, folder: Path) -> None:
    """Click through the window, and take the pictures."""
    session.wait("watching")
    hand = session.hand
    for section in ("Frame", "Lights"):
        hand.click(*session.item(section))
        session.settled()
    hand.press()
    for i in range(60):
        hand.move(600 + 10 * (i % 2), 300)
    hand.release()
    hand.key("r")
    session.settled()
    mark = session.mark()
    hand.click(560, 250)
    session.wait("truth", since=mark)
    hand.move(700, 540)
    Image.fromarray(session.settled()).save(folder / "window.png", optimize=True)

    # The coarsest setting beside the reference, with its errors.
    for section in ("Frame", "Lights", "Quality"):
        hand.click(*session.item(section))
        session.settled()
    for keys in (("Shift_L", "x"), ("Shift_L", "x"), ("k",), ("k",), ("o",), ("Escape",)):
        hand.key(*keys)
    mark = session.mark()
    session.wait("reference", lambda e: e["share"] == 1.0, mark)
    time.sleep(5)  # until the notices are gone
    Image.fromarray(session.settled()).save(folder / "window-compare.png", optimize=True)


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures"
    window_driver.PATIENCE = 300.0  # of a reference
    with serve_display() as display, tempfile.TemporaryDirectory() as name:
        scene = Path(name) / "scene.py"
        scene.write_text(SCENE)
        size = f"{SIZE[0]}x{SIZE[1]}"
        options = ("--size", size, "--panel", "--samples", "16")
        with Session(display, Path(name), scene, *options, moving=True) as session:
            work(session, folder)


if __name__ == "__main__":
    main()
