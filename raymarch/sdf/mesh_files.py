"""Mesh files: their triangles, and the digests of all files that they consist of.

trimesh reads them, from bytes and through `Beside`. Materials and pictures are not read: a field has none.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections import Counter
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from raymarch.errors import SceneError
from raymarch.files import install, reading

LEGAL = "a mesh file that trimesh reads: STL, OBJ, PLY, GLB, ..."

MOST_BYTES = 1 << 28
"""Maximum size of all files in an archive."""

MOST_COPIES = 1 << 22
"""Maximum number of triangles of a file that places meshes more than once."""

STREAMS = (".gz", ".bz2", ".xz", ".tar", ".tgz", ".binvox")
"""Files whose size is known only after they are decompressed."""


class Beside:
    """The files that a mesh names: those in its folder and below it.

    digests : the digest of each that was read, by its name in the mesh.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.digests: dict[str, str] = {}

    def get(self, name: str) -> bytes:
        """The content of a file. OSError if there is none, ValueError for a file elsewhere."""
        names = [name, unquote(name)]
        paths = [path for each in names if (path := (self.folder / each.strip()).resolve()).is_file()]
        if not paths:
            raise FileNotFoundError(f"it names '{name}', which is no file in its folder")
        if not paths[0].is_relative_to(self.folder):
            raise ValueError(f"it names '{name}', which is not in its folder")
        content = paths[0].read_bytes()
        self.digests[name] = hashlib.sha256(content).hexdigest()
        return content

    __getitem__ = get

    def holds(self, digests: dict[str, str]) -> bool:
        """True if the files of these names still have these digests."""
        try:
            for name in digests:
                self.get(name)
        except (OSError, ValueError):
            return False
        return self.digests == digests


def read_mesh(file: Path, content: bytes, beside: Beside) -> Any:
    """The triangles of a mesh file, a `trimesh.Trimesh`. SceneError if it holds none."""
    trimesh = _trimesh()
    with reading("mesh", file, LEGAL), np.errstate(all="ignore"):
        _check_archive(file, content)
        kind = file.suffix.lower().removeprefix(".")
        loaded: Any = trimesh.load(
            io.BytesIO(content), file_type=kind, resolver=beside, process=False, skip_materials=True
        )
        meshes = loaded.geometry if isinstance(loaded, trimesh.Scene) else {"": loaded}
        meshes = {name: mesh for name, mesh in meshes.items() if isinstance(mesh, trimesh.Trimesh)}
        for mesh in meshes.values():
            if mesh.vertices.shape[1:] != (3,):
                raise ValueError(f"vertices of shape {mesh.vertices.shape}")
            if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
                wrong = mesh.faces.min() if mesh.faces.min() < 0 else mesh.faces.max()
                raise ValueError(f"a triangle has the vertex {wrong} of {len(mesh.vertices)}")
        if not isinstance(loaded, trimesh.Scene):
            found = loaded
        else:
            copies = Counter(loaded.graph[node][1] for node in loaded.graph.nodes_geometry)
            total = sum(count * len(meshes[name].faces) for name, count in copies.items() if name in meshes)
            if max(copies.values(), default=0) > 1 and total > MOST_COPIES:
                raise ValueError(f"it places {total:,} triangles, more than {MOST_COPIES:,}")
            found = loaded.to_mesh() if hasattr(loaded, "to_mesh") else loaded.dump(concatenate=True)
    if not meshes or not len(found.faces):
        raise SceneError(f"mesh: '{file}' holds no triangles", legal="a watertight mesh, which has an inside")
    return found


def of_arrays(vertices: Any, faces: Any) -> Any:
    """The triangles of arrays, a `trimesh.Trimesh`."""
    with np.errstate(all="ignore"):
        return _trimesh().Trimesh(vertices, faces, process=False)


def _trimesh() -> Any:
    try:
        import trimesh
    except ImportError:
        raise SceneError("mesh needs the package trimesh", legal=install("mesh")) from None
    return trimesh


def _check_archive(file: Path, content: bytes) -> None:
    """Refuse archives before they are decompressed if their content is too large, or its size unknown."""
    if file.suffix.lower() in STREAMS:
        raise ValueError(f"a {file.suffix} file: decompress it first")
    if not content.startswith(b"PK"):
        return
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = archive.infolist()
    if (total := sum(each.file_size for each in files)) > MOST_BYTES:
        raise ValueError(f"its files have {total:,} bytes, more than {MOST_BYTES:,}")
    for each in files:
        if Path(each.filename).suffix.lower() in (".zip", ".3mf", ".zae", ".3dxml", *STREAMS):
            raise ValueError(f"it holds another archive, '{each.filename}'")
