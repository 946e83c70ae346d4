"""The contact sheet of docs/ports.md, and a check of its numbers of lines. `python docs/ports.py [--check]`."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from PIL import Image

PAGE = Path(__file__).with_name("ports.md")
COLUMNS, SIZE = 5, (240, 135)


def pieces() -> dict[str, str]:
    """The code of each piece, by its name."""
    found = re.findall(r"^### (.+?)\n\n```python\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(dict(found)) == len(found), "two pieces of one name"
    return dict(found)


def lines(code: str) -> int:
    """Lines of code, without blank ones, comments and imports."""
    return sum(1 for line in code.splitlines() if line.strip() and not re.match(r"\s*#|import ", line))


def stated() -> dict[str, tuple[int | None, int]]:
    """The lines there, None for a dash, and here, by the name of the piece."""
    rows = re.findall(r"^\| .+?: (.+?) \| (\d+|–) \| (\d+) \|", PAGE.read_text(), re.MULTILINE)
    return {name: (None if there == "–" else int(there), int(here)) for name, there, here in rows}


def main(target: Path) -> None:
    import raymarch as rm

    codes = pieces()
    sheet = Image.new("RGB", (COLUMNS * SIZE[0], -(-len(codes) // COLUMNS) * SIZE[1]), "white")
    for i, (name, code) in enumerate(codes.items()):
        space: dict[str, Any] = {}
        exec(compile(code, name, "exec"), space)
        picture = rm.render(space["scene"], size=SIZE)
        sheet.paste(picture.convert("RGB"), (i % COLUMNS * SIZE[0], i // COLUMNS * SIZE[1]))
        print(name, flush=True)
    sheet.save(target, optimize=True)


if __name__ == "__main__":
    assert {name: here for name, (_, here) in stated().items()} == {n: lines(code) for n, code in pieces().items()}
    if "--check" not in sys.argv:
        main(PAGE.parent / "pictures" / "ports.png")
