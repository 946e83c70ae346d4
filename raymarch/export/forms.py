"""The forms of export, each by the suffix of its file."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from os import PathLike
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

import numpy as np

from raymarch.errors import Location, RaymarchError, SceneError, warn
from raymarch.expr.calls import checked
from raymarch.expr.convert import file_path, integer, numbers, real, short, switch
from raymarch.files import check_apart, import_optional, written
from raymarch.scene.parameter import ParamValue, Values, set_values
from raymarch.scene.scene import Scene, as_scene
from raymarch.scene.studio import staged
from raymarch.sdf.node import Node

if TYPE_CHECKING:
    from raymarch.export.surface import Surface  # takes time to import, and few forms need it

Progress = Callable[[float], None]
Corner = Sequence[float]

SHADERTOY = "shadertoy"
"""The form of `shadertoy=True`; its files end as those of GLSL."""

TEXTS = {
    f".{found.name}": found.name
    for found in iter_modules([str(Path(__file__).parent / "text")])
    if found.name != SHADERTOY
} | {".frag": "glsl", ".htm": "html"}
"""The modules of `raymarch.export.text` by the suffixes of their files."""

GLSL = tuple(suffix for suffix, name in TEXTS.items() if name == "glsl")
MESHES = (".stl", ".obj", ".ply", ".glb", ".3mf")
SUFFIXES = (*TEXTS, *MESHES)
"""Suffixes that `export` writes."""

TEXTURES = ".textures.npz"
"""Suffix of the file with the textures of a .glsl file."""

STEP = "a field has no edges and faces for a CAD file, see docs/export.md"

CELLS = 128
"""Default number of cells of a mesh along the longest edge of its box."""


@checked
def export(
    scene: Scene | Node,
    path: str | PathLike[str],
    *,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    shadertoy: bool = False,
    cells: int | None = None,
    tolerance: float | None = None,
    box: tuple[Corner, Corner] | None = None,
    progress: Progress | None = None,
) -> Surface | None:
    """Write a scene to a file for other programs. The suffix selects the form.

    Parameters
    ----------
    scene : a Scene, or a node, which is wrapped in one; a page shows it in a studio.
    path : file to write. It is written whole or not at all.
        .glsl, .frag: one fragment shader, GLSL 330 core, with the scene's values as initial values of its uniforms.
            Textures that are too large for constants are arrays of a second file, which ends in .textures.npz. It
            replaces that of an earlier export, and no other file.
        .gdshader, .hlsl, .js: that shader for Godot 4.4, for Direct3D, and as a module for three.js, without textures.
        .wgsl: the functions of the scene for WebGPU: field, gradient, materials, lights, BSDFs.
        .html: a page that draws the scene by WebGL 2, with a slider for each Param, and without a network.
        .stl, .obj, .ply, .glb: a closed triangle mesh; all but .stl with normals, vertex colours and shared vertices.
        .3mf: the same for printers, scene units as millimetres, with vertex colours.
    time, params : values for meshes; initial values of shaders and pages.
    shadertoy : .glsl only. True writes a shader for Shadertoy: the tab Image, or the tabs Buffer A and Image if a still
        scene takes several samples.
    cells : meshes only. Cells along the longest edge of the box, 2 to 2048; None is 128, or up to 512 if no point of
        that grid lies inside the solid. The mesh is at most half the diagonal of a cell away from the surface, and has
        sharp edges and corners. It may lack parts and gaps thinner than a cell, of which a SceneWarning tells.
    tolerance : meshes only. Largest distance of the mesh from the surface, > 0, at up to 20,000 vertices and as many
        middles of triangles. From `cells` on, 32 if that is None, more are tried, up to 512, also where parts or
        gaps thinner than a cell are missing. None does not check.
    box : meshes only. Corners (lower, upper), to which the solid is clipped. None is the bounds of the solid.
    progress : called with the fraction done, 0 to 1.

    Returns
    -------
    Surface | None
        The mesh of a mesh file, as `triangulate` does; None for other forms.

    Raises
    ------
    SceneError : an unknown suffix, an option that the form does not have, an unbounded solid without a box, a file that
        cannot be written or that this program has read as a mesh, picture or font, a missing package.
    PlanError : the form cannot hold an effect of the scene.
    """
    scene = as_scene("export", scene)
    _check_progress("export", progress)
    file = Path(file_path("export: path", path, "a file to write"))
    suffix = file.suffix.lower()
    check_options(
        suffix, file, shadertoy=switch("export: shadertoy", shadertoy), cells=cells, tolerance=tolerance, box=box
    )
    values = set_values(scene.parameters, params, time, scene.where)
    check_apart(None, (file, file.with_suffix(TEXTURES)))
    if suffix in MESHES:
        from raymarch.export import mesh_files

        if suffix in (".stl", ".obj", ".ply"):
            import_optional(f"a {suffix} file", "trimesh", "mesh")
        made = _mesh("export", scene, values, cells, tolerance, box, progress)
        with written(file) as unfinished:
            mesh_files.WRITERS[suffix](unfinished, made)
        return made
    form = SHADERTOY if shadertoy else TEXTS[suffix]
    scene = staged(scene) if form == "html" else scene
    module = import_module(f"raymarch.export.text.{form}")
    text = module.text_of(scene, values, **({"still": _still(scene, values)} if form == "html" else {}))
    with written(file) as unfinished:
        unfinished.write_text(text.text, encoding="utf-8")
        if text.arrays:
            _write_textures(file, text.arrays)
    return None


def _still(scene: Scene, values: Values) -> bytes:
    """A small picture for a page, for browsers that cannot draw; none without a device or for a scene that fails."""
    from raymarch.export.live import SMALL, jpeg
    from raymarch.gpu.renderer import Renderer

    with suppress(RaymarchError), Renderer(SMALL) as renderer:  # whose frames do not warn of noise
        return jpeg(renderer.render(scene, values.time, values.params).image())
    return b""


def _write_textures(file: Path, arrays: Mapping[str, Any]) -> None:
    """The second file of a .glsl file. It replaces that of an earlier export of the same name, and no other file."""
    beside, mark = file.with_suffix(TEXTURES), f"textures of {file.name}".encode(errors="surrogateescape")
    if os.path.lexists(beside):
        found = b""
        with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(beside) as before:
            found = before.comment
        if found != mark:
            raise SceneError(
                f"export: the textures of '{file}' belong into '{beside}', which is another file",
                legal="another name, or move that file",
            )
    with written(beside) as unfinished:
        with unfinished.open("wb") as out:
            np.savez_compressed(out, **arrays)
        with zipfile.ZipFile(unfinished, "a") as archive:
            archive.comment = mark


@checked
def triangulate(
    scene: Scene | Node,
    *,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    cells: int | None = None,
    tolerance: float | None = None,
    box: tuple[Corner, Corner] | None = None,
    progress: Progress | None = None,
) -> Surface:
    """The surface of a solid as a closed triangle mesh, with its volume, area, centroid and bounds.

    Parameters
    ----------
    scene : a Scene or a node.
    time, params, cells, tolerance, box, progress : see `export`, whose errors it raises. It needs no package.

    Returns
    -------
    Surface
        A Surface: `vertices` (N, 3) float64, `faces` (M, 3), `normals`, `colors`; `volume`, `area`, `centroid`,
        `bounds`; and `deviation`, how far triangles were found to be from the surface.

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    All are in scene units, and those of the mesh: with twice the cells, the error of the volume of a smooth solid is
    about a quarter.
    """
    scene = as_scene("triangulate", scene)
    _check_progress("triangulate", progress)
    values = set_values(scene.parameters, params, time, scene.where)
    return _mesh("triangulate", scene, values, cells, tolerance, box, progress)


def _mesh(
    what: str, scene: Scene, values: Values, cells: Any, tolerance: Any, box: Any, progress: Progress | None
) -> Surface:
    from raymarch.export import surface

    most = None if tolerance is None else real(f"{what}: tolerance", tolerance, TINY, legal="a length > 0")
    first = CELLS if most is None else FIRST
    count = first if cells is None else integer(f"{what}: cells", cells, 2, surface.LARGEST)
    corners = None if box is None else _corners(what, box)
    while True:
        made = surface.surface_of(scene, values, count, corners, progress)
        whole, empty = not len(made.missed), not len(made.faces)
        hidden = cells is None and empty and not (whole and scene.node.exactness != "estimate")  # in no cell's corner
        wanted = hidden if most is None else not (empty and whole) and (made.deviation > most or not whole)
        if not wanted or count >= LAST:
            break
        grown = np.clip(made.deviation / most, 1.25, 2.0) if most is not None and whole else 2.0
        count = min(LAST, int(np.ceil(count * grown)))
    _check_mesh(what, made, count, most, scene.node.where)
    return made


def _check_mesh(what: str, made: Surface, cells: int, tolerance: float | None, where: Location | None) -> None:
    """SceneError for an empty mesh or one beyond the tolerance, SceneWarning for one that lacks parts."""
    thin = len(made.missed) > 0
    if not len(made.faces):
        text = f"{what}: the mesh is empty: no point of the grid of {cells} cells lies inside the solid"
        more = f", which is thinner than a cell, {made.cell:.3g}" if thin else ""
        raise SceneError(
            text + more, legal=f"a solid in the box, or {'more cells' if thin else 'a smaller cut'}", where=where
        )
    if thin:
        at = ", ".join(f"{x:.4g}" for x in made.missed[len(made.missed) // 2])
        text = (
            f"{what}: the mesh of {cells} cells lacks parts or gaps thinner than a cell, {made.cell:.3g}, as at ({at})"
        )
        if tolerance is not None:
            raise SceneError(text, legal=f"cells={2 * cells}, or wider parts and gaps", where=where)
        warn(f"{text} (cells={2 * cells}, or a tolerance)", where)
    if tolerance is not None and made.deviation > tolerance:
        raise SceneError(
            f"{what}: the mesh of {cells} cells is off the surface by up to {made.deviation:.3g}, more than the "
            f"tolerance {tolerance:g}",
            legal=f"cells={2 * cells}, or a larger tolerance",
            where=where,
        )


FIRST, LAST, TINY = 32, 512, 1e-18
"""Numbers of cells between which a mesh within a tolerance is sought; the least tolerance."""


def _check_progress(what: str, progress: Any) -> None:
    if progress is not None and not callable(progress):
        raise SceneError(f"{what}: progress = {short(progress)}", legal="a function of the fraction done, or None")


def check_options(suffix: str, file: Path, **given: Any) -> None:
    """SceneError for a suffix that is not known, or an option that its form does not have."""
    if suffix not in SUFFIXES:
        from raymarch.export.film import FILMS  # for the message only
        from raymarch.export.stills import FORMATS, NUMBERS

        other = "`raymarch render` writes it; " if suffix in (*FORMATS, *NUMBERS, *FILMS) else ""
        other = f"{STEP}; " if suffix in (".step", ".stp", ".iges", ".brep") else other
        raise SceneError(f"cannot export '{file}'", legal=f"{other}a file ending in {', '.join(SUFFIXES)}")
    belong = {"shadertoy": GLSL, "cells": MESHES, "tolerance": MESHES, "box": MESHES}
    for name, value in given.items():
        if value is not None and value is not False and suffix not in belong[name]:
            raise SceneError(f"{name} = {short(value)} for a {suffix} file", legal=f"with {', '.join(belong[name])}")


def _corners(what: str, box: Any) -> tuple[Any, Any]:
    legal = "two corners of 3 finite numbers, each number of the first below that of the second"
    found = numbers(f"{what}: box", box, legal)
    if found.shape != (2, 3) or not np.all(np.isfinite(found)) or np.any(found[0] >= found[1]):
        raise SceneError(f"{what}: box = {short(box)}", legal=legal)
    return found[0], found[1]
