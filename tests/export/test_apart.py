"""Outputs that would replace a file which the scene reads are refused, and the file keeps its bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raymarch as rm

READ = r"cannot write '.*': this (program|command) reads it \(another name\)"


def test_an_export_does_not_replace_its_mesh_nor_its_picture(tmp_path: Path) -> None:
    first, second = tmp_path / "ball.obj", tmp_path / "again.obj"
    rm.export(rm.sphere(), first, cells=8)
    first.rename(second)  # a file of another program
    content = second.read_bytes()
    solid = rm.mesh(second, resolution=8)
    with pytest.raises(rm.SceneError, match=READ):
        rm.export(solid.offset(0.1), second, cells=8)
    link = tmp_path / "link.obj"
    link.symlink_to(second)
    with pytest.raises(rm.SceneError, match=READ):
        rm.export(solid, link, cells=8)
    assert second.read_bytes() == content
    rm.export(solid, first, cells=8)
    rm.mesh(first, resolution=8)
    rm.export(solid, first, cells=8)  # a file that this program wrote may be written again


def test_frames_do_not_replace_the_pictures_of_their_scene(tmp_path: Path) -> None:
    picture = tmp_path / "frame_1.png"
    Image.fromarray(np.full((4, 4, 3), 99, np.uint8)).save(picture)
    content = picture.read_bytes()
    scene = rm.Scene(rm.sphere(), sky=rm.ImageSky(picture))
    with pytest.raises(rm.SceneError, match=READ):
        rm.render_frames(scene, [0, 1], size=(8, 8), out=tmp_path / "frame_{}.png")
    file = tmp_path / "scene.py"
    file.write_text(f"import raymarch as rm\nscene = rm.Scene(rm.sphere(), sky=rm.ImageSky({str(picture)!r}))\n")
    with pytest.raises(rm.SceneError, match=READ):
        rm.render_frames(file, [0, 1], size=(8, 8), out=tmp_path / "frame_{}.png")
    assert picture.read_bytes() == content and not (tmp_path / "frame_0.png").exists()
