"""Files of data that may hold anything: refused by their headers, named in every message, and read anew if changed."""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import raymarch as rm
from raymarch import cache
from raymarch.errors import SceneError
from raymarch.sdf import mesh_files
from raymarch.sdf.meshes import mesh
from tests.lab import data_files


def gltf(folder: Path, box: tuple[float, float, float]) -> Path:
    """A box as a .gltf, whose vertices are in a file beside it."""
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(trimesh.creation.box(box))).items():
        (folder / name).write_bytes(content)
    return folder / "model.gltf"


def test_a_mesh_is_read_anew_if_a_file_that_it_names_has_changed(tmp_path: Path) -> None:
    file = gltf(tmp_path, (1, 2, 1))
    above = np.array([0.0, 0.75, 0.0])
    assert mesh(file, resolution=12, cache=tmp_path / "kept").distance(above) < 0.0
    main = file.read_bytes()
    gltf(tmp_path, (1, 1, 1))
    file.write_bytes(main)  # bounds in it are those of the first box; the vertices are not
    changed = mesh(file, resolution=12, cache=tmp_path / "kept")
    assert changed.distance(above) > 0.0
    (kept,) = (tmp_path / "kept").iterdir()
    before = kept.stat().st_mtime_ns
    assert mesh(file, resolution=12, cache=tmp_path / "kept").distance(above) == changed.distance(above)
    assert kept.stat().st_mtime_ns == before  # read, not made


@pytest.mark.parametrize("uri", ["/dev/zero", "../secret.bin", "missing.bin"])
def test_a_mesh_reads_only_files_of_its_folder(uri: str, tmp_path: Path) -> None:
    (tmp_path / "secret.bin").write_bytes(b"1234")
    (tmp_path / "inner").mkdir()
    file = gltf(tmp_path / "inner", (1, 1, 1))
    tree = json.loads(file.read_text())
    for buffer in tree["buffers"]:
        buffer["uri"] = uri
    file.write_text(json.dumps(tree))
    with pytest.raises(SceneError, match=rf"cannot read '{file}': it names '{uri}', which is (no file|not) in its"):
        mesh(file, cache=tmp_path / "kept")


def blank_png(side: int) -> bytes:
    """A grey picture whose pixels follow as few bytes."""

    def chunk(name: bytes, content: bytes) -> bytes:
        check = zlib.crc32(name + content)
        return len(content).to_bytes(4, "big") + name + content + check.to_bytes(4, "big")

    head = side.to_bytes(4, "big") * 2 + bytes([8, 0, 0, 0, 0])
    pixels = zlib.compress(bytes(1 << 16))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


READERS: list[Callable[[Any], object]] = [
    rm.triplanar, rm.planar, rm.ImageSky, rm.image, rm.heightmap, rm.sphere(1).displace_by_image,
]  # fmt: skip


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__name__)
def test_a_picture_is_refused_by_its_header(reader: Callable[[Any], object], tmp_path: Path) -> None:
    file = tmp_path / "large.png"
    file.write_bytes(blank_png(13_300))
    with pytest.raises(SceneError, match=r"large\.png' has 13300 x 13300 pixels \(.* to \d+ x \d+ pixels"):
        reader(file)
    file.write_bytes(blank_png(40_000))  # beyond the limit of Pillow
    with pytest.raises(SceneError, match=r"large\.png'.* pixels"):
        reader(file)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 13300 +X 13300\nabc"),
        ("a.pic", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999999999999999 +X 1\nabc"),
    ],
)
def test_a_radiance_picture_is_refused_by_its_header(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    for reader in (rm.triplanar, rm.ImageSky):
        with pytest.raises(SceneError, match=rf"{name}' has \d+ x \d+ pixels \(a picture of 1 x 1 to \d+ x"):
            reader(tmp_path / name)


def test_an_openexr_picture_is_refused_by_its_header(tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    file = tmp_path / "a.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.zeros((2, 4097, 3), np.float16)}) as made:
        made.write(str(file))
    with pytest.raises(SceneError, match=r"a\.exr' has 4097 x 2 pixels"):
        rm.triplanar(file)


def test_a_broken_openexr_picture_writes_nothing_to_the_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("OpenEXR")
    file = data_files.exr(tmp_path)
    file.write_bytes(file.read_bytes()[:600])
    with pytest.raises(SceneError, match=r"cannot read '.*a\.exr'"):
        rm.triplanar(file)
    assert capsys.readouterr().out == ""


def test_text_is_drawn_anew_if_its_font_has_changed(tmp_path: Path) -> None:
    file = data_files.font(tmp_path)
    before = rm.text("A", font=file, resolution=8)
    narrow = file.read_bytes()
    file.write_bytes(narrow[: len(narrow) // 3])
    os.utime(file, ns=(0, 0))
    with pytest.raises(SceneError, match=r"a\.ttf"):
        rm.text("A", font=file, resolution=8)
    file.write_bytes(narrow)
    again = rm.text("A", font=file, resolution=8)
    assert again.distance([0.1, 0.2]) == before.distance([0.1, 0.2])


def test_too_many_lines_of_text_are_named() -> None:
    with pytest.raises(SceneError, match="has 2,001 lines in 96 samples"):
        rm.text("A\n" * 2000)


@pytest.mark.parametrize("kind", data_files.KINDS)
def test_mutated_files_are_read_or_refused_with_their_name(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A few of `python -m tests.lab.data_files`, without its limits."""
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    assert {n: fault for n, fault in data_files.tried(kind, tmp_path, iter(range(6)), 1) if fault} == {}


def test_pictures_of_a_mesh_are_not_opened(tmp_path: Path) -> None:
    file = tmp_path / "box.obj"
    trimesh.creation.box((1, 2, 1)).export(file)
    file.write_text("mtllib box.mtl\nusemtl a\n" + file.read_text())
    (tmp_path / "box.mtl").write_text("newmtl a\nmap_Kd large.png\n")
    (tmp_path / "large.png").write_bytes(blank_png(13_300))
    from raymarch.files import recorded

    with recorded() as names:
        mesh(file, resolution=12, cache=tmp_path)
    assert str(file) in names and str(tmp_path / "large.png") not in names


def test_archives_are_refused_before_they_are_decompressed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_files, "MOST_BYTES", 1 << 20)
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.stl", bytes(1 << 20))
        archive.writestr("b.stl", b"1")
    with pytest.raises(SceneError, match=r"bomb\.zip': its files have 1,048,577 bytes, more than 1,048,576"):
        mesh(tmp_path / "bomb.zip")
    with zipfile.ZipFile(tmp_path / "nested.zip", "w") as archive:
        archive.writestr("b.3mf", "")
    with pytest.raises(SceneError, match=r"it holds another archive, 'b\.3mf'"):
        mesh(tmp_path / "nested.zip")
    (tmp_path / "a.tar.gz").write_bytes(b"")
    with pytest.raises(SceneError, match=r"a\.tar\.gz': a \.gz file: decompress it first"):
        mesh(tmp_path / "a.tar.gz")


@pytest.mark.parametrize("index", [-1, 4])
def test_an_index_beyond_the_vertices_is_refused(index: int, tmp_path: Path) -> None:
    corners = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    faces = f"3 0 2 1\n3 0 1 {3 if index > 0 else index}\n3 1 2 {index}\n3 2 0 {3 if index > 0 else index}\n"
    header = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
    text = f"ply\nformat ascii 1.0\n{header}property list uchar int vertex_indices\nend_header\n{corners}{faces}"
    (tmp_path / "a.ply").write_text(text)
    with pytest.raises(SceneError, match=rf"a\.ply': a triangle has the vertex {index} of 4"):
        mesh(tmp_path / "a.ply", cache=tmp_path)


def test_an_edited_archive_of_the_cache_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    arrays = {"x": np.arange(6.0), "n": np.array(["one", "two"])}
    assert not cache.save(file, arrays)
    stored = cache.load(file)
    assert stored is not None and all(np.array_equal(stored[name], value) for name, value in arrays.items())
    with np.load(file) as plain:  # it is an archive as NumPy's
        assert sorted(plain.files) == ["n", "x"]
    whole = file.read_bytes()
    for at in range(0, len(whole), 97):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert cache.load(file) is None
    np.savez(file, x=np.arange(6.0)[::-1], n=arrays["n"])
    assert cache.load(file) is None
    (tmp_path / "b.npz").write_bytes(whole)  # that of other content
    assert cache.load(tmp_path / "b.npz") is None
    file.write_bytes(whole)
    assert cache.load(file) is not None


def test_the_cache_may_be_in_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv(cache.VARIABLE, "~/x")
    assert cache.folder() == tmp_path / "x"
