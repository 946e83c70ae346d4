"""A transparent background, and cameras that frame a solid."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.cli.commands import main
from raymarch.gpu.context import Context

RED = rm.Material((0.8, 0.1, 0.05), specular=0, ambient=1)


def scene_of(samples: int = 1, **parts: Any) -> rm.Scene:
    quality = rm.Quality(samples=samples)
    camera = rm.Camera((0, 0, 4), (0, 0, 0), fov=50)
    return rm.Scene(rm.sphere().material(RED), camera, [rm.Sun((0, 0, 1), intensity=0.5)], quality=quality, **parts)


@pytest.mark.parametrize(("samples", "sky"), [(1, "skyblue"), (16, "skyblue"), (16, "gradient")])
def test_the_sky_is_transparent_and_not_in_the_colours(samples: int, sky: str, egl: Context) -> None:
    given = rm.GradientSky() if sky == "gradient" else sky
    with rm.Renderer((48, 36), context=egl) as renderer:
        frame = renderer.render(scene_of(samples, sky=given))
        alpha, picture = frame.alpha, np.asarray(frame.image(alpha=True))
        bare = renderer.render(scene_of(samples, sky=(0, 0, 0))).color
    assert picture.shape == (36, 48, 4) and alpha.shape == (36, 48) and alpha.dtype == np.float32
    np.testing.assert_array_equal(picture[..., 3], np.rint(255 * alpha))
    steps = np.unique(np.round(alpha * samples, 3))
    assert steps[0] == 0 and steps[-1] == samples and np.all(np.abs(steps - np.rint(steps)) < 0.01)
    assert (samples == 1) == (len(steps) == 2)
    # A ball of radius 1 at distance 4 is a disc of radius 1 / sqrt(15) at distance 1.
    radius = 18 / np.tan(np.radians(25)) / np.sqrt(15)
    assert abs(alpha.sum() - np.pi * radius**2) < (12 if samples == 1 else 3)
    # Over black the picture is that of a black sky, up to the rounding to 8 bits.
    shown = (picture[..., :3] / 255.0) ** 2.2 * alpha[..., None]
    assert np.abs(shown - bare).max() < 0.02
    assert np.all(picture[alpha == 0][:, :3] == 0)


CLOUD = rm.Medium(0.8, ((-1.5, -1, -1), (1.5, 1, 1)), ambient=(0.3, 0.5, 0.2), steps=4)
HAZE = rm.Fog((0.3, 0.4, 0.5), 0.2, falloff=0.5)
LAMP = rm.SphereLight((1.4, 0.2, 0), 0.3, intensity=0.05, visible=True)


@pytest.mark.parametrize("parts", [{"fog": CLOUD}, {"fog": HAZE}, {"lights": [LAMP]}, {"lights": [LAMP], "fog": CLOUD}])
def test_what_hides_the_sky_is_opaque(parts: dict[str, Any], egl: Context) -> None:
    """Laid over another sky, a picture without its sky is the picture of that sky: of smoke, mist and lamps too."""
    blue, red = ((0.1, 0.2, 0.9), (0.7, 0.1, 0.1))
    made = scene_of(4, sky=blue).replace(**parts)
    with rm.Renderer((48, 36), context=egl) as renderer:
        light = renderer.render(made).premultiplied()
        expected = renderer.render(made.replace(sky=rm.Sky(red))).color
    over = light[..., :3] + (1 - light[..., 3:]) * np.array(red)
    assert np.abs(over - expected).max() < 1e-4
    assert np.ptp(light[..., 3]) > 0.3


@pytest.mark.parametrize("samples", [1, 2])
def test_transparency_does_not_restart_the_mean_of_frames(samples: int, egl: Context) -> None:
    quality = rm.Quality(samples=samples, temporal="accumulate")
    scene = scene_of().replace(quality=quality)
    with rm.Renderer((24, 18), context=egl) as renderer:
        expected = [renderer.render(scene).color for _ in range(3)]
        renderer.forget()
        for color in expected:
            frame = renderer.render(scene)
            frame.image(alpha=True)
            np.testing.assert_array_equal(frame.color, color)
    assert np.any(expected[0] != expected[2])


def test_without_a_hit_all_is_transparent(egl: Context) -> None:
    away = scene_of().replace(camera=rm.Camera((0, 0, 4), (0, 0, 8)))
    with rm.Renderer((16, 9), context=egl) as renderer:
        assert not np.any(np.asarray(renderer.render(away).image(alpha=True)))


def test_a_scene_without_alpha_is_drawn_once(egl: Context) -> None:
    with rm.Renderer((16, 9), context=egl) as renderer:
        renderer.render(scene_of()).image()
        assert renderer.compiled == 1


def test_the_command_writes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ball.py").write_text("import raymarch as rm\nscene = rm.sphere()\n")
    for arguments, code in (([], 0), (["-o", "b.jpg"], 2), (["--view", "depth"], 2)):
        with pytest.raises(SystemExit) as stop:
            main(["render", "ball.py", "--alpha", "--size", "16x16", *arguments])
        assert stop.value.code == code
    with Image.open("ball.png") as written:
        assert written.mode == "RGBA"
    assert not Path("b.jpg").exists()
    said = capsys.readouterr().err
    assert "--alpha with the output 'b.jpg' (a file ending in .png" in said and "--alpha with --view depth" in said


# Framing


def in_picture(camera: rm.Camera, node: rm.Node, aspect: float) -> np.ndarray:
    """Coordinates of the corners of a node's box in the picture, -1 to 1, for a camera with a position."""
    pose = rm.Scene(node, camera=camera).pose(rm.scene.parameter.Values({}), aspect)
    corners = np.array(list(itertools.product(*zip(*node.bounds, strict=True))))
    x, y, z = ((corners - pose.position) @ pose.frame).T
    assert np.all(z < 0)
    return np.stack([x / -z / pose.tan_half_fov / aspect, y / -z / pose.tan_half_fov], axis=1)


SOLIDS = {
    "bar": rm.box((4, 0.2, 0.2)),
    "tower": rm.box((0.2, 5, 0.3)).translate((3, 1, -2)),
    "depth": rm.box((0.1, 0.1, 8)),
    "cube": rm.box(2),
    "point": rm.box(1e-3).translate((100, 0, 0)),
}


@pytest.mark.parametrize("aspect", [0.5, 1.0, 16 / 9])
@pytest.mark.parametrize("name", SOLIDS)
def test_a_camera_without_a_position_fits_the_box(name: str, aspect: float) -> None:
    reach = np.abs(in_picture(rm.Camera(), SOLIDS[name], aspect)).max()
    assert reach == pytest.approx(1 / 1.1, rel=1e-6) or (name == "depth" and 0.5 < reach < 1 / 1.1 + 1e-6)


@pytest.mark.parametrize("direction", [(0, 0, 1), (3, 1, 2), (-1, 0.2, 0)])
def test_framing_fits_one_node(direction: tuple[float, ...]) -> None:
    node = rm.box((4, 1, 0.2)).translate((5, 5, 5))
    camera = rm.Camera.framing(node, direction, fov=30, aspect=1.5, margin=1.25)
    assert np.abs(in_picture(camera, node, 1.5)).max() == pytest.approx(1 / 1.25, rel=1e-6)
    assert camera.position is not None and camera.target is not None
    away = camera.position.data - camera.target.data
    np.testing.assert_allclose(np.cross(away, direction), 0, atol=1e-9)
    np.testing.assert_allclose(camera.target.data, (5, 5, 5))


WRONG: list[tuple[Callable[[], Any], str]] = [
    (lambda: rm.Camera.framing(rm.plane()), r"Camera.framing: plane has no finite box \(a part of the scene"),
    (lambda: rm.Camera.framing(rm.sphere() & rm.sphere().translate((9, 0, 0))), "is empty"),
    (lambda: rm.Camera.framing(5), r"Camera.framing: node = 5 \(int\)"),  # type: ignore[arg-type]
    (lambda: rm.Camera.framing(rm.sphere(), (0, 0, 0)), "position = target"),
    (lambda: rm.Camera.framing(rm.sphere(), (0, 1, 0)), "is parallel to the view"),
    (lambda: rm.Camera.framing(rm.sphere(), fov=200), "fov = 200"),
    (lambda: rm.Camera.framing(rm.sphere(), margin=0.5), "margin = 0.5"),
    (lambda: rm.Camera.framing(rm.sphere(), aspect=-1), "aspect = -1"),
]


@pytest.mark.parametrize(("make", "words"), WRONG)
def test_what_cannot_be_framed_is_refused(make: Callable[[], Any], words: str) -> None:
    with pytest.raises(rm.SceneError, match=words):
        make()
