"""A film of the pictures that the window has saved."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from raymarch.errors import SceneError
from raymarch.export.film import write_film
from raymarch.files import written


def filmed(folder: Path, file: Path, fps: float) -> SceneError | None:
    """Write the pictures of a folder as a film, as `raymarch render` does, and remove the folder. Returns the error if
    that failed: then the pictures stay. An odd last row or column is cut."""

    def pictures() -> Iterator[Image.Image]:
        for name in sorted(folder.iterdir()):
            with Image.open(name) as picture:
                width, height = picture.size
                yield picture.convert("RGB").crop((0, 0, width // 2 * 2, height // 2 * 2))

    try:
        with written(file) as partial:
            write_film(partial, file.suffix, pictures(), fps)
    except SceneError as fault:
        return fault
    except OSError as fault:
        return SceneError(f"cannot write '{file}': {fault}")
    shutil.rmtree(folder)
    return None
