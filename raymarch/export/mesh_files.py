"""Triangle meshes as files: STL, OBJ, PLY, GLB and 3MF.

trimesh writes the first three. A GLB is written here, because glTF has linear vertex colours, of which trimesh stores
8 bits. So is a 3MF, which trimesh writes without colours.
"""

from __future__ import annotations

import json
import struct
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.export.surface import Surface
from raymarch.expr.srgb import linear_to_srgb

Array = NDArray[Any]


def write_stl(file: Path, surface: Surface) -> None:
    """Binary STL: triangles alone, in float32."""
    _trimesh(surface, colored=False).export(file, file_type="stl")


def write_obj(file: Path, surface: Surface) -> None:
    """OBJ with normals, and sRGB vertex colours after the coordinates, which most programs read."""
    made = _trimesh(surface)
    file.write_text(made.export(file_type="obj", include_normals=True, include_color=True, header="raymarch"))


def write_ply(file: Path, surface: Surface) -> None:
    """Binary PLY with normals and 8-bit sRGB vertex colours."""
    _trimesh(surface).export(file, file_type="ply", vertex_normal=True)


def write_glb(file: Path, surface: Surface) -> None:
    """Binary glTF 2.0: one mesh with normals and linear vertex colours in 16 bits, in scene units as metres."""
    positions = np.ascontiguousarray(surface.vertices, "<f4")
    normals = np.ascontiguousarray(surface.normals, "<f4")
    colors = np.full((len(positions), 4), 65535, "<u2")
    colors[:, :3] = np.rint(65535 * surface.colors)
    indices = np.ascontiguousarray(surface.faces, "<u4").ravel()
    parts = [positions.tobytes(), normals.tobytes(), colors.tobytes(), indices.tobytes()]
    starts = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).tolist()
    views = [
        {"buffer": 0, "byteOffset": start, "byteLength": len(part), "target": target}
        for start, part, target in zip(starts, parts, (34962, 34962, 34962, 34963), strict=False)
    ]
    count = len(positions)
    ends = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", **ends},
        {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3"},
        {"bufferView": 2, "componentType": 5123, "normalized": True, "count": count, "type": "VEC4"},
        {"bufferView": 3, "componentType": 5125, "count": len(indices), "type": "SCALAR"},
    ]
    attributes = {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}
    document = {
        "asset": {"version": "2.0", "generator": "raymarch"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.5}}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": starts[-1]}],
    }
    head = json.dumps(document, separators=(",", ":")).encode()
    head += b" " * (-len(head) % 4)
    total = 12 + 8 + len(head) + 8 + starts[-1]
    if total >= 2**32:
        raise SceneError(f"a .glb file of {total} bytes", legal="up to 4 GiB: fewer cells, or .ply")
    with file.open("wb") as out:
        out.write(struct.pack("<4sII", b"glTF", 2, total))
        out.write(struct.pack("<I4s", len(head), b"JSON") + head)
        out.write(struct.pack("<I4s", starts[-1], b"BIN\0"))
        for part in parts:
            out.write(part)


TYPES = (
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="model" '
    'Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)
MODEL = (
    '<model unit="millimeter" xml:lang="en" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
    'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"><metadata name="Application">raymarch'
    "</metadata><resources>"
)
"""The parts of a 3MF package, by the core specification 1.3 and the materials extension 1.2."""


def write_3mf(file: Path, surface: Surface) -> None:
    """3MF: one object with sRGB colours of its vertices, in scene units as millimetres. Printers have z up."""
    codes = np.rint(255 * linear_to_srgb(surface.colors)).astype(np.uint8)
    colors, own = np.unique(codes, axis=0, return_inverse=True)
    own = own.reshape(-1)
    points = "".join([f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in surface.vertices.tolist()])
    faces = [
        f'<triangle v1="{a}" v2="{b}" v3="{c}" p1="{own[a]}" p2="{own[b]}" p3="{own[c]}"/>'
        for a, b, c in surface.faces.tolist()
    ]
    group = "".join([f'<m:color color="#{r:02X}{g:02X}{b:02X}"/>' for r, g, b in colors.tolist()])
    body = (
        f'<m:colorgroup id="2">{group}</m:colorgroup><object id="1" type="model" pid="2" pindex="0"><mesh>'
        f"<vertices>{points}</vertices><triangles>{''.join(faces)}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        for name, text in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            ("3D/3dmodel.model", MODEL + body),
        ):
            made.writestr(name, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}')


WRITERS: Mapping[str, Callable[[Path, Surface], None]] = {
    ".stl": write_stl,
    ".obj": write_obj,
    ".ply": write_ply,
    ".glb": write_glb,
    ".3mf": write_3mf,
}
"""The writer of each suffix."""


def _trimesh(surface: Surface, colored: bool = True) -> Any:
    import trimesh

    colors = np.rint(255 * linear_to_srgb(surface.colors)).astype(np.uint8) if colored else None
    return trimesh.Trimesh(
        surface.vertices, surface.faces, vertex_normals=surface.normals, vertex_colors=colors, process=False
    )
