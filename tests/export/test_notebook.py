"""Scenes, nodes and frames show themselves in notebooks; frames as files of all arrays."""

from __future__ import annotations

import pickle
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu import Renderer
from raymarch.scene import load
from tests.export.test_shaders import EXAMPLES, SCENES
from tests.support.commands import files, run


def opened(png: bytes) -> Image.Image:
    return Image.open(BytesIO(png))


@pytest.mark.parametrize(
    "shown", [rm.torus(), rm.star(), rm.Scene(rm.box(1), sky=(1, 0, 0))], ids=["solid", "flat", "scene"]
)
def test_nodes_and_scenes_are_pictures(shown: Any) -> None:
    image = opened(shown._repr_png_())
    assert image.size == (400, 300) and np.asarray(image).std() > 10


def test_a_frame_is_its_picture(renderer: Renderer) -> None:
    frame = renderer.render(SCENES["framed"])
    np.testing.assert_array_equal(np.asarray(opened(frame._repr_png_())), np.asarray(frame.image()))


def test_show_is_a_page_or_a_picture() -> None:
    live = rm.show(SCENES["parameters"], size=(64, 48), params={"size": 1.5})
    bundle = live._repr_mimebundle_()
    assert bundle["text/html"].startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')
    assert "&quot;value&quot;:1.5" in bundle["text/html"] and opened(bundle["image/png"]).size == (64, 48)
    lights = [rm.PointLight((rm.time, i, 3)) for i in range(9)]
    bundle = rm.show(rm.Scene(rm.sphere(), lights=lights), size=(32, 24))._repr_mimebundle_()
    assert "text/html" not in bundle and opened(bundle["image/png"]).size == (32, 24)
    assert repr(rm.show(rm.star(), (32, 24))) == bundle["text/plain"] == "<raymarch scene, 32x24>"


@pytest.mark.parametrize("options", [{"size": 3}, {"size": (0, 4)}, {"size": (4, 4, 4)}, {"params": {"x": 1}}])
def test_what_cannot_be_shown_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(RaymarchError):
        rm.show(rm.sphere(), **options)


def test_a_page_without_a_widget_says_so() -> None:
    shown = rm.show(rm.sphere(rm.Param("size", 1.0, 0.5, 2.0)))
    with pytest.raises(rm.SceneError, match=r"show: params is that of a widget.*\(pip install anywidget"):
        shown.params  # noqa: B018
    assert not hasattr(shown, "nothing") and pickle.loads(pickle.dumps(shown)) == shown


def test_all_arrays_of_a_frame_in_one_file(tmp_path: Path, renderer: Renderer) -> None:
    openexr = pytest.importorskip("OpenEXR")
    scene = str(EXAMPLES / "csg.py")
    assert run("render", scene, "-o", str(tmp_path / "all.npz"), "--size", "64x48") == 0
    assert run("render", scene, "-o", str(tmp_path / "all.exr"), "--size", "64x48", "--layers") == 0
    renderer.forget()
    frame = renderer.render(load(scene))
    assert frame.pose is not None
    with np.load(tmp_path / "all.npz") as arrays:
        for name in ("color", "depth", "normal", "material", "evaluations", "done"):
            np.testing.assert_array_equal(arrays[name], frame.array(name))
        np.testing.assert_array_equal(arrays["camera_position"], frame.pose.position)
    with openexr.File(str(tmp_path / "all.exr"), separate_channels=True) as found:
        channels = found.channels()
        np.testing.assert_array_equal(channels["depth.Y"].pixels, frame.depth)
        np.testing.assert_array_equal(channels["normal.Y"].pixels, frame.normal[..., 1])
        np.testing.assert_array_equal(channels["G"].pixels, frame.color[..., 1])
        np.testing.assert_array_equal(channels["material.Y"].pixels, frame.material.astype(np.float32))


def test_layers_need_their_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, target = str(EXAMPLES / "csg.py"), str(tmp_path / "made")
    assert run("render", scene, "-o", f"{target}.png", "--layers") == 2
    assert "--layers with the output" in capsys.readouterr().err
    assert run("render", scene, "-o", f"{target}.npz", "--view", "depth") == 2
    assert "--view depth with all arrays" in capsys.readouterr().err and not files(tmp_path)
