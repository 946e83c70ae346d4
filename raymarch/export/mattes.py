"""Mattes of materials and objects by their names: Cryptomatte 1.2, the channels and metadata of an OpenEXR file.

References: Friedman and Jones 2015, "Fully automatic ID mattes with support for motion blur and transparency", and the
specification of Cryptomatte 1.2.
"""

from __future__ import annotations

import ast
import json
import linecache
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location
from raymarch.gpu.part import PicturePart
from raymarch.gpu.renderer import Renderer
from raymarch.scene.material import Material
from raymarch.scene.parameter import ParamValue
from raymarch.scene.quality import SINGLE_PASS
from raymarch.scene.scene import Scene
from raymarch.sdf.labels import rows_of
from raymarch.sdf.node import Node, replaced
from raymarch.sdf.placing import with_label

KINDS = ("crypto_object", "crypto_material")
"""The names of the mattes: layers of the file, see the specification."""

RANKS = 6
"""Names of a pixel, those that cover most of it: two in each layer of four channels."""

BAND = 1 << 20
"""Most rays that are drawn together."""

Names = tuple[str, str]
"""Of an object and of a material."""


def murmur3(text: str) -> int:
    """The 32-bit hash of a text in UTF-8: MurmurHash3_x86_32 with the seed 0 (Appleby 2011)."""
    data, most = text.encode(errors="surrogatepass"), 0xFFFFFFFF

    def mixed(k: int) -> int:
        k = (k * 0xCC9E2D51) & most
        return (((k << 15) | (k >> 17)) * 0x1B873593) & most

    h, whole = 0, len(data) & ~3
    for at in range(0, whole, 4):
        h ^= mixed(int.from_bytes(data[at : at + 4], "little"))
        h = (((h << 13) | (h >> 19)) * 5 + 0xE6546B64) & most
    h ^= mixed(int.from_bytes(data[whole:], "little")) ^ len(data)
    h = ((h ^ (h >> 16)) * 0x85EBCA6B) & most
    h = ((h ^ (h >> 13)) * 0xC2B2AE35) & most
    return h ^ (h >> 16)


def identity(name: str) -> int:
    """The bits of the float32 that stands for a name: its hash, with an exponent that is neither 0 nor 255."""
    h = murmur3(name)
    return h ^ (1 << 23) if (h >> 23) & 255 in (0, 255) else h


def metadata(kind: str, names: Sequence[str]) -> dict[str, str]:
    """The attributes of a header that describe a matte. names : that the manifest lists."""
    key = f"cryptomatte/{murmur3(kind):08x}"[: len("cryptomatte/") + 7]
    listed = {name: f"{identity(name):08x}" for name in sorted(set(names))}
    manifest = json.dumps(listed, ensure_ascii=False, separators=(",", ":"))
    found = {"name": kind, "hash": "MurmurHash3_32", "conversion": "uint32_to_float32", "manifest": manifest}
    return {f"{key}/{name}": value for name, value in found.items()}


@lru_cache(64)
def _statements(file: str, _lines: int) -> list[ast.Assign | ast.AnnAssign]:
    """The assignments of a file; none if it cannot be read."""
    try:
        tree = ast.parse("".join(linecache.getlines(file)))
    except (SyntaxError, ValueError):
        return []
    return [node for node in ast.walk(tree) if isinstance(node, ast.Assign | ast.AnnAssign) and node.value]


def variable(where: Location | None) -> str:
    """The variable to which the statement at a user's line assigns; "" if there is none."""
    if where is None:
        return ""
    line, column = where.line, where.columns[0] if where.columns else 0
    found = ""
    for statement in _statements(where.file, len(linecache.getlines(where.file))):
        if not statement.lineno <= line <= (statement.end_lineno or 0):
            continue
        target = statement.targets[-1] if isinstance(statement, ast.Assign) else statement.target
        value = statement.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
            begun = [k for k, e in enumerate(value.elts) if (e.lineno, e.col_offset) <= (line, column)]
            target = target.elts[begun[-1]] if begun else target
        found = target.id if isinstance(target, ast.Name) else found
    return found


def _material_names(scene: Scene) -> dict[Material, str]:
    """A name of each material, all different: of its variable, or its number."""
    default, *given = scene.materials
    found = {default: "default", **{material: variable(material.where) or "material" for material in given}}
    counts: Counter[str] = Counter()
    for material, name in found.items():
        counts[name] += 1
        found[material] = name if counts[name] == 1 else f"{name}.{counts[name]}"
    return found


def _shapes(root: Node) -> Iterator[Node]:
    """The shapes of a solid."""
    pending, seen = [root], {id(root)}
    while pending:
        node = pending.pop()
        if not node.children:
            yield node
        for child in reversed(node.children):
            if id(child) not in seen:
                seen.add(id(child))
                pending.append(child)


def _object_names(root: Node) -> Callable[[Node], str]:
    """The name of a shape's object: its variable, or the shape where there is none or one for all shapes."""
    variables = {variable(node.where) for node in _shapes(root)}

    def name(node: Node) -> str:
        own = variable(node.where)
        return own if own and len(variables) > 1 else node.name

    return name


class Named:
    """A scene whose materials are numbers: each stands for the names of an object and of a material.

    scene : has the same solid, for the array "material". names : of each index of its materials; None of the first.
    """

    def __init__(self, scene: Scene) -> None:
        self._materials, self._object = _material_names(scene), _object_names(scene.node)
        self._default = scene.materials[0]
        self._labels: dict[Names, Material] = {}
        node = self._labelled(scene.node)
        plain = scene.quality.replace(**SINGLE_PASS, rays="computed")
        self.scene = scene.replace(node=node, post=(), quality=plain)
        by_label = {label: names for names, label in self._labels.items()}
        self.names = [by_label.get(material) for material in self.scene.materials]

    def of(self, kind: str) -> list[str | None]:
        """The names of one kind, for each index of the materials."""
        return [None if names is None else names[KINDS.index(kind)] for names in self.names]

    def _label(self, shape: Node, material: Material | None) -> Material:
        given = self._default if material is None else material
        names = self._object(shape), self._materials.get(given, "default")
        if names not in self._labels:
            number = len(self._labels) + 1
            self._labels[names] = Material.unlit((number / 4096.0, 0.5, 0.25))
        return self._labels[names]

    def _labelled(self, root: Node) -> Node:
        """The solid with a label of each shape, in place of the materials. What a shape cuts keeps its own label."""
        made: dict[tuple[int, Material | None], Node] = {}
        pending: list[tuple[Node, Material | None]] = [(root, None)]
        while pending:
            node, material = pending[-1]
            inner = [(child, node.label or material) for child in self._seen(node)]
            waiting = [(child, own) for child, own in inner if (id(child), own) not in made]
            if waiting:
                pending += waiting
                continue
            pending.pop()
            made[id(node), material] = self._of(node, material, {id(c): made[id(c), own] for c, own in inner})
        return made[id(root), None]

    @staticmethod
    def _seen(node: Node) -> Sequence[Node]:
        """The children whose surfaces are those of an object."""
        if not node.definition.cuts:
            return node.children
        return [node.children[0], *(child for child in node.children[1:] if child.labelled)]

    def _of(self, node: Node, material: Material | None, made: Mapping[int, Node]) -> Node:
        if node.label is not None:
            return made[id(node.children[0])]
        rows = rows_of(node)
        if rows is not None and rows.labelled:
            return replaced(node, (), {"rows": rows.relabelled(lambda m: self._label(node, m or material))})
        if not node.children:
            return with_label(node, self._label(node, material))
        return replaced(node, tuple(made.get(id(child), child) for child in node.children))


class Mattes:
    """Draws mattes by a renderer of their own, which keeps its programs from frame to frame."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._named: tuple[Scene, Named] | None = None

    def channels(
        self, scene: Scene, size: tuple[int, int], time: float, params: Mapping[str, ParamValue]
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, str]]:
        """The channels of both mattes by name, each (H, W), and the attributes of the header.

        size : (width, height) of the picture in pixels. Each pixel is the mean of at least as many rays as the quality
        takes, on a square grid.
        """
        if self._named is None or self._named[0] is not scene:
            self._named = scene, Named(scene)
        named, edge = self._named[1], math.isqrt(max(1, scene.quality.samples) - 1) + 1
        bands = list(self._bands(named.scene, size, edge, time, params))
        channels: dict[str, NDArray[np.float32]] = {}
        header: dict[str, str] = {}
        for kind in KINDS:
            names = named.of(kind)
            parts = [ranked(band, names) for band in bands]
            ids, cover = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
            for layer in range(RANKS // 2):
                for k, letter in enumerate("RGBA"):
                    values = (ids, cover)[k % 2][..., 2 * layer + k // 2]
                    channels[f"{kind}{layer:02d}.{letter}"] = values
            header |= metadata(kind, [name for name in names if name is not None])
        return channels, header

    def _bands(
        self, scene: Scene, size: tuple[int, int], edge: int, time: float, params: Mapping[str, ParamValue]
    ) -> Iterator[NDArray[np.int32]]:
        """The numbers of materials of all rays of some rows of pixels, (rows, W, rays); -1 for a miss."""
        width, height = size
        whole, step = (edge * width, edge * height), max(1, BAND // (edge * edge * width))
        for row in range(0, height, step):
            rows = min(step, height - row)
            band = (edge * width, edge * rows)
            if self._renderer.size != band:
                self._renderer.resize(band)
            part = PicturePart(whole, (0, edge * row))
            found = self._renderer.render(scene, time, params, outputs=("material",), part=part).material
            yield found.reshape(rows, edge, width, edge).swapaxes(1, 2).reshape(rows, width, edge * edge)


def ranked(rays: NDArray[np.int32], names: Sequence[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Identities and coverage of the names that cover most of each pixel, in this order, each (H, W, RANKS).

    rays : (H, W, N), an index of `names` for each ray; -1 for a miss. A rank that no name takes has 0 in both.
    """
    listed = sorted({name for name in names if name is not None})
    numbers = np.array([-1 if name is None else listed.index(name) for name in names] + [-1], np.int64)
    height, width, count = rays.shape
    found = np.sort(numbers[rays], axis=-1).reshape(-1, count)
    pixel = np.repeat(np.arange(len(found)), count)
    flat = found.reshape(-1)
    begins = np.flatnonzero(np.r_[True, (np.diff(flat) != 0) | (np.diff(pixel) != 0)])
    lengths = np.diff(np.r_[begins, len(flat)])
    kept = flat[begins] >= 0
    begins, lengths = begins[kept], lengths[kept]
    owner, number = pixel[begins], flat[begins]
    order = np.lexsort((number, -lengths, owner))
    owner, number, lengths = owner[order], number[order], lengths[order]
    rank = np.arange(len(owner)) - np.searchsorted(owner, owner)
    kept = rank < RANKS
    bits = np.array([identity(name) for name in listed] or [0], np.uint32)
    ids, cover = np.zeros((height * width, RANKS), np.uint32), np.zeros((height * width, RANKS), np.float32)
    ids[owner[kept], rank[kept]] = bits[number[kept]]
    cover[owner[kept], rank[kept]] = lengths[kept] / np.float32(count)
    shape = (height, width, RANKS)
    return ids.view(np.float32).reshape(shape), cover.reshape(shape)
