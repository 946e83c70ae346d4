"""PNG files: all pixels and texts as Pillow reads them, and about as large as Pillow's."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from raymarch.export import png

PICTURES = Path(__file__).parents[2] / "docs" / "pictures" / "gallery"


def pictures() -> dict[str, Image.Image]:
    random = np.random.default_rng(5)
    shapes = {"L": (40, 60), "RGB": (33, 51, 3), "RGBA": (1, 7, 4), "RGB column": (9, 1, 3)}
    return {name: Image.fromarray(random.integers(0, 256, shape, np.uint8)) for name, shape in shapes.items()}


@pytest.mark.parametrize("level", [png.STILL, png.FRAME, png.DRAFT])
@pytest.mark.parametrize("name", pictures())
def test_a_picture_is_read_as_it_was_written(name: str, level: int) -> None:
    picture = pictures()[name]
    made = png.encode(picture, {"raymarch": "a key", "umlaut": "\xe4"}, level)
    with Image.open(io.BytesIO(made)) as found:
        found.load()
        assert found.mode == picture.mode and found.text == {"raymarch": "a key", "umlaut": "\xe4"}  # type: ignore[attr-defined]
        np.testing.assert_array_equal(np.asarray(found), np.asarray(picture))
    assert png.encode(picture, {"raymarch": "a key", "umlaut": "\xe4"}, level) == made


def test_files_are_about_as_large_as_those_of_pillow() -> None:
    ratios = []
    for file in sorted(PICTURES.rglob("*.png"))[:8]:
        with Image.open(file) as opened:
            picture = opened.convert("RGB")
        buffer = io.BytesIO()
        picture.save(buffer, "PNG")
        ratios.append(len(png.encode(picture, {})) / len(buffer.getvalue()))
        assert len(png.encode(picture, {}, png.FRAME)) < 1.25 * len(buffer.getvalue())
        assert len(png.encode(picture, {}, png.DRAFT)) < 0.9 * 3 * picture.width * picture.height
    assert len(ratios) == 8 and max(ratios) < 1.08 and np.mean(ratios) < 1.03
