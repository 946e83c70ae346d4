"""The contact sheet of docs/start.md: what `rm.render(node)` shows of 20 nodes. `python docs/first_pictures.py`."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

import raymarch as rm

turn = rm.time
COLORS = [rm.Material(color=c) for c in ((0.8, 0.1, 0.1), (0.9, 0.8, 0.2), (0.1, 0.3, 0.7))]
NODES = {
    "sphere": rm.sphere(),
    "box": rm.box((1.6, 1, 1)).round(0.1),
    "torus": rm.torus(1, 0.35),
    "difference": rm.box((1.6, 1.6, 1.6)).round(0.1) - rm.sphere(1.0),
    "blend": rm.union(rm.sphere(0.7), rm.box((2.4, 0.4, 0.4)), k=0.4),
    "cylinder": rm.cylinder(0.4, 3),
    "plate": rm.box((4, 0.2, 4)) - rm.cylinder(0.8, 2),
    "twist": rm.box((0.7, 2.4, 0.7)).round(0.08).twist(1.2),
    "turning": rm.box((1, 1, 1)).rotate(turn, "x").rotate(0.7 * turn, "y").rotate(0.3 * turn, "z"),
    "row": rm.sphere(0.4).repeat((1, 1, 1), (5, 1, 5)),
    "lattice": rm.sphere(0.3).repeat(1),
    "gyroid": rm.gyroid(),
    "gyroid-ball": rm.gyroid(0.8) & rm.sphere(1),
    "planes": rm.intersection(*[rm.plane(n, 0.6) for n in ((1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1))]),
    "menger": rm.menger(2.0, 3),
    "plane": rm.sphere(0.5) | rm.plane(offset=-0.5),
    "text": rm.text("raymarch").extrude(0.2),
    "bulb": rm.mandelbulb(),
    "far": rm.capsule((1e4, 0, 0), (1e4, 1, 1), 0.2),
    "colours": rm.union(*[rm.sphere(0.5).translate((i, 0, 0)).material(c) for i, c in enumerate(COLORS)]),
}


def main(target: Path, size: tuple[int, int] = (240, 135)) -> None:
    width, height = size
    sheet = Image.new("RGB", (4 * width, 5 * height))
    for i, node in enumerate(NODES.values()):
        sheet.paste(rm.render(node, size), (i % 4 * width, i // 4 * height))
    sheet.save(target)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "pictures" / "first-pictures.png")
