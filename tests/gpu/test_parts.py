"""Parts of a picture have the bits of the whole picture."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.gpu.part import PicturePart, covering
from raymarch.gpu.tiles import split
from raymarch.plan.marching import SCHEDULES

SIZE = (70, 53)
SCENE = rm.Scene(
    rm.union(rm.sphere(0.6).translate((rm.time, 0.2, 0)), rm.box((1, 0.6, 1)), k=0.2).material(
        rm.Material(color=rm.noise((1, 0.4, 0.1), (0.1, 0.2, 0.9)))
    )
)


@pytest.mark.parametrize(
    ("quality", "names"),
    [
        ({"samples": 2, "schedule": "cones"}, ("color", "alpha")),
        ({"step_variation": 0.3}, ("color", "depth", "normal", "evaluations")),  # random numbers of a pixel
        ({"steps_per_pass": 8, "max_steps": 64}, ("color",)),
    ],
)
def test_parts_have_the_bits_of_the_whole(quality: dict[str, object], names: tuple[str, ...], egl: Context) -> None:
    scene = SCENE.replace(quality=SCENE.quality.replace(**quality))
    outputs = tuple(name for name in names if name != "alpha")
    with rm.Renderer(SIZE, context=egl) as renderer:
        frame = renderer.render(scene, 0.3, outputs=outputs)
        whole = {name: frame.alpha if name == "alpha" else frame.array(name) for name in names}
        for (x, y), size in split(SIZE, 32):
            renderer.resize(size)
            part = renderer.render(scene, 0.3, outputs=outputs, part=PicturePart(SIZE, (x, y)))
            for name, array in whole.items():
                found = part.alpha if name == "alpha" else part.array(name)
                assert np.array_equal(found, array[y : y + size[1], x : x + size[0]]), (name, x, y)


def test_shares_of_the_samples_are_those_of_the_whole(egl: Context) -> None:
    scene = SCENE.replace(quality=SCENE.quality.replace(samples=5))
    with rm.Renderer(SIZE, context=egl) as renderer:
        whole = renderer.render(scene).color
        first = renderer.render(scene, part=PicturePart(SIZE, samples=(0, 2))).color
        last = renderer.render(scene, part=PicturePart(SIZE, samples=(2, 5))).color
    assert np.abs((2.0 * first + 3.0 * last) / 5.0 - whole).max() < 1e-6
    assert np.abs(first - last).max() > 1e-3


def test_a_part_must_lie_in_its_picture(egl: Context) -> None:
    with rm.Renderer((16, 16), context=egl) as renderer:
        with pytest.raises(rm.DeviceError, match=r"a part of 16x16 at \(60, 0\) of a picture of 70x53"):
            renderer.render(SCENE, part=PicturePart(SIZE, (60, 0)))
        moving = SCENE.replace(quality=rm.Quality(temporal="accumulate"))
        with pytest.raises(rm.SceneError, match="a part of a picture with temporal='accumulate'"):
            renderer.render(moving, part=PicturePart(SIZE))


def test_cells_of_a_part_lie_in_their_level_and_cover_the_finer_one() -> None:
    levels = SCHEDULES["cones"].levels
    for corner, size in split(SIZE, 32):
        box = PicturePart(SIZE, corner).box(size)
        for level, (x, y, width, height) in zip(levels, covering(box, SIZE, levels), strict=True):
            across, up = level.size(SIZE)
            assert x >= 0 and y >= 0 and x + width <= across and y + height <= up
            assert x * SIZE[0] / across <= box[0] and (x + width) * SIZE[0] / across >= box[0] + box[2]
            assert y * SIZE[1] / up <= box[1] and (y + height) * SIZE[1] / up >= box[1] + box[3]


def test_parts_have_the_points_of_the_lens_of_the_whole(egl: Context) -> None:
    scene = SCENE.replace(camera=rm.Camera((1, 1, 4), (0, 0, 0), aperture=0.3), quality=rm.Quality(samples=2))
    with rm.Renderer(SIZE, context=egl) as renderer:
        whole = renderer.render(scene).color
        renderer.resize((32, 21))
        assert np.array_equal(renderer.render(scene, part=PicturePart(SIZE, (9, 11))).color, whole[11:32, 9:41])
