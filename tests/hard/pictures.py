"""What visible cases look like without what mends them, on the left, and with it: docs/pictures/hard-*.png.

python -m tests.hard.pictures
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from PIL import Image

import raymarch as rm
from raymarch import glsl
from tests.hard.seeded import spoil

SIZE = (180, 120)
FOLDER = Path(__file__).parents[2] / "docs" / "pictures"


class Pair(NamedTuple):
    """A row of the table, a scene that shows it, and a piece of a module with what is put in its place."""

    row: int
    name: str
    scene: rm.Scene
    module: str
    code: str
    without: str


def pairs() -> list[Pair]:
    sun = [rm.Sun((0.6, 1.0, 0.4), shadow=True)]
    above = rm.Camera((2.2, 1.6, 3.0), (0, -0.1, 0), fov=40.0)
    shell = rm.sphere(1.0).shell(0.004) - rm.box((2.2, 2.2, 2.2)).translate((0.9, 0.9, 0.9))
    plain = rm.Quality(tracer="auto_relaxed")
    low = rm.Camera((0, 0.4, 3.0), (0, 0.38, 0), fov=40.0)
    floor = rm.plane() | rm.sphere(0.3).translate((0, 0.3, 0))
    return [
        Pair(
            1,
            "thin shell",
            rm.Scene(shell, above, quality=plain),
            "march/loop",
            "if (z > at.r + abs(next)) {",
            "if (false) {",
        ),
        Pair(
            29,
            "secondary rays",
            rm.Scene(rm.torus(0.8, 0.3) | rm.plane(offset=-0.5), above, sun),
            "light/leaving",
            "2.0 *",
            "0.0 *",
        ),
        Pair(
            58,
            "infinite plane at the horizon",
            rm.Scene(floor, low, quality=rm.Quality(max_steps=48, tracer="plain")),
            "march/exhausted",
            "hit.residual < u_pixel * hit.t",
            "false",
        ),
    ]


def drawn(pair: Pair) -> tuple[Image.Image, Image.Image]:
    """The picture without what mends the case, and with it."""
    lines = glsl.load(pair.module).lines
    line = next(i for i, text in enumerate(lines) if pair.code in text and not text.startswith("//"))
    load = spoil(pair.module, line, lines[line].replace(pair.code, pair.without))
    try:
        without = rm.render(pair.scene, SIZE)
    finally:
        glsl.load = load
    return without, rm.render(pair.scene, SIZE)


def file_of(pair: Pair) -> str:
    return f"hard-{pair.name.replace(' ', '-')}.png"


def section() -> list[str]:
    """The part of the page."""
    lines = [
        "## What it looks like",
        "",
        "Without what mends it on the left, as it is on the right: `python -m tests.hard.pictures`.",
        "",
    ]
    return lines + [f"{pair.row}. **{pair.name}**: ![{pair.name}](pictures/{file_of(pair)})" for pair in pairs()]


def main() -> None:
    for pair in pairs():
        both = Image.new("RGB", (2 * SIZE[0] + 4, SIZE[1]), "white")
        for i, picture in enumerate(drawn(pair)):
            both.paste(picture, (i * (SIZE[0] + 4), 0))
        both.save(FOLDER / file_of(pair), optimize=True)


if __name__ == "__main__":
    main()
