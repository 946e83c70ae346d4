"""Render all example scenes and the steps of the tutorial: docs/gallery.md, docs/tutorial.md and their pictures.

python docs/gallery.py            # everything, and the contact sheet in the README
python docs/gallery.py NAME ...   # only these examples or steps, and the pages
python docs/gallery.py --counts   # the costs and the plans of all, without their pictures
python docs/gallery.py --text     # only the pages

A picture that is the same to the eye keeps its file.
"""

from __future__ import annotations

import difflib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import raymarch as rm
from raymarch.cost.effects import evaluations_of
from raymarch.plan import plan
from raymarch.scene import load
from raymarch.scene.studio import staged
from raymarch.shader import assemble

HERE = Path(__file__).parent
EXAMPLES, STEPS = HERE.parent / "examples", HERE / "tutorial"
PICTURES = HERE / "pictures" / "gallery"
COUNTS = HERE / "figures" / "gallery.json"
SIZE = (480, 270)
SAMPLES, NOISY, FEW = 16, 256, 4
"""Rays per pixel: without path tracing, with it, and of large scenes."""

COLUMNS = 5
TILE = (192, 108)


SECTIONS = {"Showcase": EXAMPLES / "showcase", "First scenes": EXAMPLES, "From the papers": EXAMPLES / "papers"}
"""The sections of the page, and the folders of their scenes."""


def files() -> list[Path]:
    """The scenes, in the order of the page."""
    return [file for folder in SECTIONS.values() for file in sorted(folder.glob("*.py"))]


def title_of(file: Path) -> str:
    """The heading of a scene."""
    return file.stem.replace("_", " ").capitalize().replace("Csg", "CSG")


def large() -> list[Path]:
    """The scenes of thousands of objects, which have pictures only."""
    return sorted((EXAMPLES / "large").glob("*.py"))


def steps() -> list[Path]:
    """The steps of the tutorial, in order."""
    return sorted(STEPS.glob("*.py"))


def name_of(file: Path) -> str:
    """The name of a scene and of its picture."""
    folder = STEPS.parent if file.is_relative_to(STEPS) else EXAMPLES
    return "-".join(file.relative_to(folder).with_suffix("").parts)


def command(file: Path) -> str:
    """The path of a scene in the commands of a page."""
    return file.relative_to(HERE.parent).as_posix()


def chosen(scene: rm.Scene) -> dict[str, Any]:
    """What the plan of a scene at the size of its picture chooses."""
    made = plan(scene, size=SIZE)
    return {
        "exactness": made.given.node.exactness,
        "operations": made.operations,
        "tracer": made.marching.tracer,
        "passes": [p.name for p in made.passes],
        "used": [feature.name for feature in made.features if feature.used],
        "bytes": len(assemble(made).text().encode()),
    }


def samples_of(scene: rm.Scene) -> int:
    """Rays per pixel of a scene's picture."""
    random = scene.bounces > 0 and scene.quality.integrator == "path"
    return NOISY if random else SAMPLES


def draw(file: Path, renderer: rm.Renderer) -> None:
    """Render a scene's picture."""
    scene = staged(load(file))
    samples = FEW if file in large() else samples_of(scene)
    drawn = scene.replace(quality=scene.quality.replace(samples=samples))
    write(renderer.render(drawn).image(), PICTURES / f"{name_of(file)}.png")


def measure(file: Path, renderer: rm.Renderer) -> dict[str, Any]:
    """The plan of a scene and its cost."""
    scene = staged(load(file))
    once = renderer.render(scene.replace(quality=scene.quality.replace(samples=1)), outputs=("evaluations",))
    return {
        "samples": samples_of(scene),
        "evaluations": round(float(once.evaluations.mean()), 1),
        "all_evaluations": round(evaluations_of(scene, renderer), 1),
        "plan": chosen(scene),
    }


def write(image: Image.Image, file: Path, limit: int = 250_000) -> None:
    """Write a picture, with a palette if its file is over a limit in bytes. Keep a file that looks the same."""
    if file.exists() and _alike(Image.open(file), image):
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    image.save(file, optimize=True)
    if file.stat().st_size > limit:
        whole = image.convert("RGB")
        whole.quantize(palette=whole.quantize(256), dither=Image.Dither.FLOYDSTEINBERG).save(file, optimize=True)


def _alike(before: Image.Image, now: Image.Image) -> bool:
    """True if no block of 6x6 pixels differs by 8 of 255 in its mean, which noise and rounding do not change so far."""
    if before.size != now.size:
        return False
    small = (now.width // 6, now.height // 6)
    first, second = (np.asarray(p.convert("RGB").resize(small, Image.Resampling.BOX), float) for p in (before, now))
    return bool(np.abs(first - second).max() < 8)


def docstring(file: Path) -> tuple[str, str]:
    """The docstring of a scene's file, and the code after it."""
    text = file.read_text(encoding="utf-8")
    if not text.startswith('"""'):
        return "", text
    words, _, code = text[3:].partition('"""\n\n')
    return words.strip(), code


def caption(file: Path) -> str:
    """The first paragraph of the docstring of a scene's file."""
    words = docstring(file)[0] or "The first scene: a hollowed rounded box, a sphere blended with a torus, and a plane."
    return " ".join(words.split("\n\n")[0].split())


def cost(count: dict[str, Any]) -> str:
    """What a scene costs, as one sentence."""
    primary, every = count["evaluations"], count["all_evaluations"]
    word = "evaluation" if primary == 1 else "evaluations"
    return f"{primary:g} {word} per pixel for camera rays, {every:g} with shading and all other rays"


def page(counts: dict[str, dict[str, Any]]) -> str:
    """The text of docs/gallery.md."""
    text = [
        "# Gallery",
        "",
        "After this page you can choose an example to start from, and know what it costs. It shows the scenes of",
        "`examples/`, drawn by `python docs/gallery.py`. [Scenes of thousands of objects](#large-scenes) are at the",
        "end.",
        "",
        "- **Plan** is what `raymarch explain` chooses and prints with reasons: the exactness of the field, the",
        "  [tracer](marching.md#tracers), the [cones](marching.md#cones), the passes, the effects in the shader.",
        "- **Cost** is counted by the shader and is the same on every machine: evaluations of the field, and of its",
        "  gradient, per pixel at one ray per pixel and without cones, for camera rays and in all. An evaluation takes",
        "  the given number of arithmetic operations. [cost.md](cost.md) shows how to measure errors and times.",
    ]
    sections = {folder: title for title, folder in SECTIONS.items()}
    for file in files():
        name, path = name_of(file), command(file)
        count = counts[name]
        if file.parent in sections:
            text += ["", f"## {sections.pop(file.parent)}"]
        chose = count["plan"]
        passes = " and ".join(f"`{each}`" for each in chose["passes"])
        text += [
            "",
            f"### {title_of(file)}",
            "",
            f"![{caption(file).rstrip('.')}](pictures/gallery/{name}.png)",
            "",
            caption(file),
            "",
            f"- **Plan**: {chose['exactness']}; tracer `{chose['tracer']}`; "
            f"pass{'es' if len(chose['passes']) > 1 else ''} {passes}; {', '.join(chose['used'])}.",
            f"- **Cost**: {cost(count)}; {chose['operations']:,} operations per evaluation; "
            f"{chose['bytes'] / 1000:.0f} kB of shader.",
            f"- **Draw it**: `raymarch render {path} --size {SIZE[0]}x{SIZE[1]} --samples {count['samples']:g}`",
            f"- **Browser**: `raymarch export {path} -o {name}.html`",
            "",
            "<details>",
            f"<summary>Code: {path}</summary>",
            "",
            "```python",
            file.read_text(encoding="utf-8").rstrip(),
            "```",
            "",
            "</details>",
        ]
    text += [
        "",
        "## Large scenes",
        "",
        "Their objects are rows of a texture, found through a grid of cells, or many lights: see [scale](scale.md).",
    ]
    for file in large():
        text += [
            "",
            f"### {title_of(file)}",
            "",
            f"![{caption(file).rstrip('.')}](pictures/gallery/{name_of(file)}.png)",
            "",
            caption(file),
            "",
            f"- **Draw it**: `raymarch render {command(file)} --size {SIZE[0]}x{SIZE[1]} --samples {FEW}`",
        ]
    return "\n".join(text) + "\n"


def changed(before: str, after: str) -> str:
    """The lines of a step that differ from those of the step before, with one line around them."""
    lines = difflib.unified_diff(before.strip().splitlines(), after.strip().splitlines(), n=1, lineterm="")
    return "\n".join("..." if line.startswith("@@") else line for line in list(lines)[2:]).removeprefix("...\n")


def tutorial(counts: dict[str, dict[str, Any]]) -> str:
    """The text of docs/tutorial.md."""
    text = [
        "# Tutorial: from a sphere to glass on a carpet",
        "",
        "After this page you can write a scene with solids of your own, materials, lights, a sky, parameters, data and",
        "glass. Each of the ten steps is a complete file of `docs/tutorial`; after the first, the page shows the lines",
        "that change, with `+` and `-`. Keep one open in the window while you read, and edit it: the window reloads",
        "the file when you save it.",
        "",
        "```sh",
        "raymarch view docs/tutorial/01_sphere.py",
        "```",
        "",
        "Below each picture is its cost: the evaluations of the field per pixel, counted by the shader.",
    ]
    before = ""
    for number, file in enumerate(steps(), 1):
        words, code = docstring(file)
        title, _, rest = words.partition("\n\n")
        count = counts[name_of(file)]
        text += [
            "",
            f"## {number}. {title}",
            "",
            rest.strip(),
            "",
            f"```python\n{code.rstrip()}\n```" if not before else f"```diff\n{changed(before, code)}\n```",
            "",
            f"![step {number}: {title[0].lower()}{title[1:]}](pictures/gallery/{name_of(file)}.png)",
            "",
            f"`{command(file)}`: {cost(count)}; {count['plan']['bytes'] / 1000:.0f} kB of shader.",
        ]
        before = code
    text += [
        "",
        "## Next",
        "",
        "- [All nodes](nodes.md): every shape and operator with its picture.",
        "- [Materials, lights and skies](light.md), [cameras](camera.md), [large scenes](scale.md).",
        "- [Export](export.md): the scene as a film, a mesh, a shader or a page for browsers.",
        "- [What accuracy costs](cost.md): choose a quality by its error or its time.",
        "- [Your own shapes](extending.md).",
    ]
    return "\n".join(text) + "\n"


def sheet() -> Image.Image:
    """The contact sheet: a square of pictures, those of the papers last."""
    papers = EXAMPLES / "papers"
    shown = sorted([*files(), *large()], key=lambda file: file.parent == papers)[: COLUMNS**2]
    made = Image.new("RGB", (COLUMNS * TILE[0], COLUMNS * TILE[1]), "white")
    for i, file in enumerate(shown):
        picture = Image.open(PICTURES / f"{name_of(file)}.png").convert("RGB").resize(TILE, Image.Resampling.BOX)
        made.paste(picture, (i % COLUMNS * TILE[0], i // COLUMNS * TILE[1]))
    return made


def first(renderer: rm.Renderer) -> Image.Image:
    """The picture of the first code on docs/start.md."""
    code = (HERE / "start.md").read_text(encoding="utf-8").partition("```python\n")[2].partition("```")[0]
    values: dict[str, Any] = {}
    exec(code, values)
    return renderer.render(values["scene"].replace(quality=rm.Quality(samples=SAMPLES))).image()


def main(arguments: list[str]) -> None:
    counts = json.loads(COUNTS.read_text()) if COUNTS.exists() else {}
    scenes = [*files(), *steps()]
    names = [argument for argument in arguments if not argument.startswith("--")]
    if "--text" not in arguments:
        with rm.Renderer(SIZE) as renderer:
            for file in large():
                if name_of(file) in names or not arguments:
                    draw(file, renderer)
            for file in scenes:
                if not names or name_of(file) in names:
                    if "--counts" not in arguments:
                        draw(file, renderer)
                    counts[name_of(file)] = measure(file, renderer)
                    print(f"{name_of(file)}: {cost(counts[name_of(file)])}", flush=True)
            write(first(renderer), HERE / "pictures" / "start.png")
        counts = {name_of(file): counts[name_of(file)] for file in scenes}
        COUNTS.write_text(json.dumps(counts, indent=1) + "\n")
        write(sheet(), HERE / "pictures" / "gallery.png", limit=700_000)
    (HERE / "gallery.md").write_text(page(counts), encoding="utf-8")
    (HERE / "tutorial.md").write_text(tutorial(counts), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
