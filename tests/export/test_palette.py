"""The colours of a .gif: the nearest ones, the same from picture to picture, others when they do not fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from raymarch.export import film as film_module
from raymarch.export.film import write_film
from raymarch.export.palette import ALLOWED, SAMPLED, WORSE, Palette, packed

SIZE = (64, 48)


def gradient(tint: tuple[int, int, int], shift: int = 0) -> Image.Image:
    """A picture of some thousand colours, moved to the left."""
    x, y = np.meshgrid(np.arange(SIZE[0]) + shift, np.arange(SIZE[1]))
    share = np.stack([x / 80, (x + y) / 130, y / 60], axis=-1)
    return Image.fromarray(np.clip(share * tint, 0, 255).astype(np.uint8))


def shown(palette: Palette, indices: NDArray[np.uint8]) -> NDArray[np.int64]:
    return np.asarray(palette.image(indices).convert("RGB")).astype(int)


def test_each_pixel_has_the_nearest_colour() -> None:
    picture = gradient((250, 200, 180))
    palette = Palette(picture)
    for other in (picture, gradient((250, 200, 180), 3)):
        indices = palette.indices(packed(other))
        assert indices is not None
        pixels = np.asarray(other).astype(int)
        table = shown(palette, np.arange(256, dtype=np.uint8)[None])[0]
        nearest = ((pixels[:, :, None] - table) ** 2).sum(axis=-1).min(axis=-1)
        assert np.array_equal(((pixels - shown(palette, indices)) ** 2).sum(axis=-1), nearest)


def test_colours_that_do_not_fit_are_refused() -> None:
    palette = Palette(gradient((250, 200, 180)))
    assert palette.indices(packed(gradient((60, 90, 250)))) is None
    wrong = np.asarray(gradient((250, 200, 180))).copy()
    wrong.reshape(-1, 3)[::SAMPLED] = (0, 255, 0)  # the pixels that are asked
    assert palette.indices(packed(Image.fromarray(wrong))) is None


def test_a_film_has_new_colours_where_the_old_ones_do_not_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    boxes: list[tuple[int, ...]] = []
    real = film_module._gif_block
    monkeypatch.setattr(film_module, "_gif_block", lambda p, at: boxes.append((*at, *p.size)) or real(p, at))
    pictures = [gradient((250, 200, 180), k) for k in range(3)] + [gradient((60, 90, 250), k) for k in range(3)]
    still = np.asarray(pictures[1]).copy()
    still[10:20, 30:33] = still[40, 60]
    pictures.insert(2, Image.fromarray(still))
    write_film(tmp_path / "a.gif", ".gif", pictures, 10)
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == len(pictures)
        errors = []
        for frame, picture in zip(ImageSequence.Iterator(film), pictures, strict=True):
            apart = np.asarray(frame.convert("RGB")).astype(int) - np.asarray(picture)
            errors.append(np.sqrt(np.mean(apart**2)))
    assert max(errors) <= WORSE * errors[0] + ALLOWED
    assert boxes[2] == (30, 10, 3, 10), "only what changed is written"
    assert boxes[4] == (0, 0, *SIZE)
