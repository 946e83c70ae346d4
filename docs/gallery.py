"""Render all example scenes: docs/gallery.md, its pictures, and their contact sheet in the README.

python docs/gallery.py            # everything
python docs/gallery.py NAME ...   # only the pictures of these, and the page
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image

import raymarch as rm
from raymarch.scene import load

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"
PICTURES = HERE / "pictures" / "gallery"
COUNTS = HERE / "figures" / "gallery.json"
SIZE = (480, 270)
SAMPLES, NOISY = 16, 256
"""Rays per pixel: without and with path tracing."""

COLUMNS = 4
TILE = (240, 135)


def files() -> list[Path]:
    """The scenes, in the order of the page."""
    return [
        *sorted(EXAMPLES.glob("*.py")),
        *(f for n in ("showcase", "papers") for f in sorted((EXAMPLES / n).glob("*.py"))),
    ]


def name_of(file: Path) -> str:
    """The name of a scene and of its picture."""
    return "-".join(file.relative_to(EXAMPLES).with_suffix("").parts)


def draw(file: Path, renderer: rm.Renderer) -> dict[str, float]:
    """Render a scene's picture; return its rays per pixel and evaluations per pixel."""
    scene = load(file)
    random = scene.bounces > 0 and scene.quality.integrator == "path"
    scene = scene.replace(quality=scene.quality.replace(samples=NOISY if random else SAMPLES))
    frame = renderer.render(scene)
    frame.image().save(PICTURES / f"{name_of(file)}.png", optimize=True)
    scene = scene.replace(quality=scene.quality.replace(samples=1))
    once = renderer.render(scene, outputs=("evaluations",))
    return {"samples": NOISY if random else SAMPLES, "evaluations": round(float(once.evaluations.mean()), 1)}


def caption(file: Path) -> str:
    """The first paragraph of the docstring of a scene's file."""
    text = file.read_text(encoding="utf-8")
    if not text.startswith('"""'):
        return "The first scene: a hollowed rounded box, a sphere blended with a torus, and a plane."
    return " ".join(text[3:].split('"""')[0].split("\n\n")[0].split())


def page(counts: dict[str, dict[str, float]]) -> str:
    """The text of docs/gallery.md."""
    text = [
        "# Gallery",
        "",
        "After this page you can choose an example to start from. It shows all scenes of `examples/`, rendered by",
        "`python docs/gallery.py`. Evaluations of the field are those of the primary ray of a pixel, at one ray per",
        "pixel; shadows and bounces add to them.",
    ]
    for file in files():
        name, path = name_of(file), file.relative_to(HERE.parent).as_posix()
        count = counts[name]
        text += [
            "",
            f"## {name}",
            "",
            f"![{name}](pictures/gallery/{name}.png)",
            "",
            f"{caption(file)} {count['evaluations']:g} evaluations per pixel.",
            "",
            f"`raymarch render {path} --size {SIZE[0]}x{SIZE[1]} --samples {count['samples']:g}`",
        ]
    return "\n".join(text) + "\n"


def sheet() -> Image.Image:
    """The contact sheet of all pictures."""
    names = [name_of(file) for file in files()]
    rows = -(-len(names) // COLUMNS)
    made = Image.new("RGB", (COLUMNS * TILE[0], rows * TILE[1]), "white")
    for i, name in enumerate(names):
        picture = Image.open(PICTURES / f"{name}.png").convert("RGB").resize(TILE, Image.Resampling.BOX)
        made.paste(picture, (i % COLUMNS * TILE[0], i // COLUMNS * TILE[1]))
    return made


def main() -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    counts = json.loads(COUNTS.read_text()) if COUNTS.exists() else {}
    wanted = sys.argv[1:]
    with rm.Renderer(SIZE) as renderer:
        for file in files():
            if not wanted or name_of(file) in wanted:
                counts[name_of(file)] = draw(file, renderer)
    counts = {name_of(file): counts[name_of(file)] for file in files()}
    COUNTS.write_text(json.dumps(counts, indent=1) + "\n")
    (HERE / "gallery.md").write_text(page(counts), encoding="utf-8")
    sheet().save(HERE / "pictures" / "gallery.png", optimize=True)


if __name__ == "__main__":
    main()
