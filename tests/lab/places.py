"""The shader of each example, loaded from many places, pickled, sent and made in other processes: one text.

    python -m tests.lab.places [EXAMPLE.py ...]

Prints the examples whose text differs, and the number of texts that were compared. Each example is copied with its
folder. `cluster` stands for what a worker does: another process makes the scene of its files in a temporary folder.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path

from raymarch.cluster.source import of_file, of_scene
from raymarch.plan import plan
from raymarch.scene.file import load
from raymarch.scene.scene import Scene
from raymarch.shader import assemble

EXAMPLES = Path(__file__).parents[2] / "examples"


def text_of(scene: Scene) -> str:
    """A hash of the shader."""
    return hashlib.sha256(assemble(plan(scene)).text().encode()).hexdigest()[:16]


def texts(file: Path, root: Path) -> Iterator[tuple[str, str]]:
    """The ways to the scene of a file, and the text of each."""
    shutil.copytree(file.parent, root / "two words" / "ex", dirs_exist_ok=True)
    (root / "other").mkdir(exist_ok=True)
    (root / "linked").symlink_to(root / "two words")
    here = root / "two words" / "ex" / file.name
    (root / "other" / "link.py").symlink_to(here)
    with chdir(here.parent):
        yield "relative", text_of(load(file.name))
    with chdir(root / "other"):
        yield "absolute", text_of(load(here))
        yield "from another folder", text_of(load(Path("..", "two words", "ex", file.name)))
        yield "linked folder", text_of(load(root / "linked" / "ex" / file.name))
        sources = {
            "absolute on a worker": of_file(here),
            "linked folder on a worker": of_file(Path("..", "linked", "ex", file.name)),
        }
        if "__file__" not in here.read_text():  # which Python does not resolve
            yield "linked file", text_of(load("link.py"))
            sources["linked file on a worker"] = of_file("link.py")
        found = sources["absolute on a worker"][1]
    yield "pickled", text_of(pickle.loads(pickle.dumps(found)))
    shutil.rmtree(root / "two words")
    sent = [source for source, _ in sources.values()] + [of_scene(found)]
    for seed in "12":
        made = subprocess.run(
            [sys.executable, "-m", "tests.lab.places", "--worker"],
            input=pickle.dumps(sent),
            stdout=subprocess.PIPE,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        )
        for way, text in zip([*sources, "pickled on a worker"], made.stdout.decode().split(), strict=True):
            yield f"{way}, hashes {seed}", text


def main() -> None:
    warnings.simplefilter("ignore")
    if sys.argv[1:] == ["--worker"]:
        for source in pickle.load(sys.stdin.buffer):
            print(text_of(source.scene()))
        return
    compared = 0
    for name in sys.argv[1:] or sorted(EXAMPLES.rglob("*.py")):
        with tempfile.TemporaryDirectory() as root:
            found = list(texts(Path(name).resolve(), Path(root)))
        compared += len(found)
        for way, text in found[1:]:
            if text != found[0][1]:
                print(f"{name}: {way} differs from {found[0][0]}")
    print(f"{compared} texts compared")


if __name__ == "__main__":
    main()
