"""The picture of docs/window.md: `python -m tests.lab.window_screenshot [FILE.png]`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

from tests.support.window_driver import ROOT, Session, serve_display

SIZE = (900, 560)
SCENE = """import raymarch as rm

radius = rm.Param("radius", 1.0, 0.5, 2.0)
tint = rm.Param("tint", (0.75, 0.2, 0.08), 0, 1)
ball = rm.sphere(radius).material(rm.Material(color=tint, shininess=90))
gold = rm.Material(albedo=(0.9, 0.7, 0.3), metalness=1.0, roughness=0.3)
ring = rm.torus(1.6, 0.2).rotate(0.6, "x").material(gold)
scene = rm.Scene(
    ball | ring | rm.plane(offset=-1.4),
    camera=rm.Camera(position=(3, 2.2, 6.5), target=(-0.9, 0, 0)),
    lights=[rm.Sun(direction=(1, 2, 1.5), shadow=True), rm.PointLight(position=(-3, 2, 4), intensity=4)],
)
"""


def main() -> None:
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures" / "window.png"
    with serve_display() as display, tempfile.TemporaryDirectory() as name:
        scene = Path(name) / "scene.py"
        scene.write_text(SCENE)
        session = Session(
            display, Path(name), scene, "--size", f"{SIZE[0]}x{SIZE[1]}", "--panel", "--samples", "16", moving=True
        )
        try:
            session.wait("watching")
            hand = session.hand
            for section in ("Frame", "Lights"):
                hand.click(*session.item(section))
                session.settled()
            for i in range(40):
                hand.drag((600, 300), (601 - 2 * (i % 2), 300), steps=1)
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
            Image.fromarray(session.settled()).save(out, optimize=True)
        finally:
            session.kill()


if __name__ == "__main__":
    main()
