"""Pictures that share a texture, so that one look-up reads any of them.

An atlas has one mip level. It holds all levels of each of its pictures: level 0, and the others in a row above a wide
picture, or in a column to the right of a high one. Level k starts s - s / 2^(k - 1) texels from the first end of that
row or column, where s is the longer edge of level 0: s / 2^k texels are left for it, which it has at most. The GLSL
fetches texels and interpolates itself, so pictures of different sizes and wraps lie side by side without an influence
on each other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from weakref import WeakValueDictionary

import numpy as np

from raymarch.expr.data import digest
from raymarch.expr.texels import Texels

EDGE = 8192
"""Largest edge of an atlas in texels; drivers and browsers have textures of this size."""
WRAPS = {"clamp": 0, "repeat": 1, "mirror": 2}


class Atlas(Texels):
    """A texture of one level with several pictures of equally many channels.

    pictures : what it holds. places : the lower left corner of each picture's cell, in texels.
    """

    __slots__ = ("__weakref__", "pictures", "places")

    def __init__(self, pictures: Sequence[Texels], places: Sequence[tuple[int, int]]) -> None:
        ends = [(x + w, y + h) for (x, y), (w, h) in zip(places, map(_cell, pictures), strict=True)]
        size = max(y for _, y in ends), max(x for x, _ in ends), pictures[0].channels
        texels = np.zeros(size, np.float16)
        for picture, (x, y) in zip(pictures, places, strict=True):
            for (right, up), level in zip(_offsets(picture), picture.levels, strict=True):
                h, w = level.shape[:2]
                texels[y + up : y + up + h, x + right : x + right + w] = level
        texels.setflags(write=False)
        self.levels = (texels,)
        self.wrap = "clamp"
        self.label = f"an atlas of {len(pictures)} pictures"
        self.key = digest(" ".join(p.key for p in pictures).encode())
        self.pictures = tuple(pictures)
        self.places = tuple(places)

    @classmethod
    def of(cls, pictures: Sequence[Texels], places: Sequence[tuple[int, int]]) -> Atlas:
        """The atlas of some pictures. One that is still in use is not made again."""
        found = _made.get(tuple(p.key for p in pictures))
        if found is None:
            found = _made[tuple(p.key for p in pictures)] = cls(pictures, places)
        return found


_made: WeakValueDictionary[tuple[str, ...], Atlas] = WeakValueDictionary()


@dataclass(frozen=True, slots=True)
class Place:
    """A picture in an atlas; `arguments` are those of the GLSL function before the coordinates."""

    atlas: Atlas
    corner: tuple[int, int]
    picture: Texels

    @property
    def kind(self) -> tuple[int, int]:
        """Its wrap and its last level."""
        return WRAPS[self.picture.wrap], len(self.picture.levels) - 1

    @property
    def arguments(self) -> str:
        (x, y), (w, h) = self.corner, self.picture.size
        return f"{self.atlas.name}, ivec4({x}, {y}, {w}, {h}), ivec2({', '.join(map(str, self.kind))})"


def packed(pictures: Iterable[Texels], saved: int) -> dict[str, Place]:
    """Places for the smallest pictures, by their names, so that at least `saved` fewer textures are read.

    Pictures of different numbers of channels are in different atlases. {} if there are too few pictures.
    """
    ordered = sorted(pictures, key=lambda p: (p.nbytes, p.key))
    for count in range(saved + 1, len(ordered) + 1):
        pages = _pages(ordered[:count])
        if count - len(pages) >= saved:
            return _places(pages)
    return {}


def shelved(pictures: Iterable[Texels]) -> dict[str, Place]:
    """Places for all pictures that share an atlas with another one, by their names."""
    ordered = sorted(pictures, key=lambda p: (p.nbytes, p.key))
    return _places([page for page in _pages(ordered) if len(page) > 1])


def _places(pages: Sequence[Sequence[tuple[Texels, tuple[int, int]]]]) -> dict[str, Place]:
    found: dict[str, Place] = {}
    for page in pages:
        atlas = Atlas.of([p for p, _ in page], [corner for _, corner in page])
        found.update((p.name, Place(atlas, corner, p)) for p, corner in page)
    return found


def _cell(picture: Texels) -> tuple[int, int]:
    """Width and height of all levels of a picture."""
    ends = [
        (x + level.shape[1], y + level.shape[0])
        for (x, y), level in zip(_offsets(picture), picture.levels, strict=True)
    ]
    return max(x for x, _ in ends), max(y for _, y in ends)


def _offsets(picture: Texels) -> list[tuple[int, int]]:
    """The lower left corner of each level in the cell of a picture."""
    width, height = picture.size
    starts = [max(width, height) - (max(width, height) >> k) for k in range(len(picture.levels) - 1)]
    return [(0, 0), *((start, height) if width > height else (width, start) for start in starts)]


def _pages(pictures: Sequence[Texels]) -> list[list[tuple[Texels, tuple[int, int]]]]:
    """The pictures of each atlas with their corners: rows of cells, highest cells first."""
    pages: list[list[tuple[Texels, tuple[int, int]]]] = []
    for channels in sorted({p.channels for p in pictures}):
        x = y = row = EDGE  # a new page begins
        for picture in sorted((p for p in pictures if p.channels == channels), key=lambda p: (-_cell(p)[1], p.key)):
            width, height = _cell(picture)
            if x + width > EDGE:
                x, y = 0, y + row
            if y + height > EDGE:
                pages.append([])
                x = y = 0
            row = height if x == 0 else row
            pages[-1].append((picture, (x, y)))
            x += width
    return pages


HELPER = """vec4 atlas_level(sampler2D image, ivec4 place, int wrap, vec2 at, int level) {
    // one mip level of a picture in an atlas, interpolated linearly; place: corner and size; wrap: repeat 1, mirror 2
    ivec2 corner = place.xy, size = place.zw;
    if (level > 0) {
        int edge = max(size.x, size.y), start = edge - (edge >> (level - 1));
        corner += size.x > size.y ? ivec2(start, size.y) : ivec2(size.x, start);
        size = max(size >> level, ivec2(1));
    }
    if (wrap == 1) at = fract(at);
    if (wrap == 2) at = 1.0 - abs(mod(at, 2.0) - 1.0);
    vec2 p = at * vec2(size) - 0.5;
    vec2 cell = floor(clamp(p, vec2(-1.0), vec2(size)));
    vec2 w = clamp(p - cell, 0.0, 1.0);
    ivec2 low = ivec2(cell), high = low + 1;
    low = corner + (wrap == 1 ? (low + size) % size : clamp(low, ivec2(0), size - 1));
    high = corner + (wrap == 1 ? high % size : clamp(high, ivec2(0), size - 1));
    vec4 a = texelFetch(image, low, 0), b = texelFetch(image, ivec2(high.x, low.y), 0);
    vec4 c = texelFetch(image, ivec2(low.x, high.y), 0), d = texelFetch(image, high, 0);
    return mix(mix(a, b, w.x), mix(c, d, w.x), w.y);
}

vec4 atlas_texel(sampler2D image, ivec4 place, ivec2 kind, vec2 at, float level) {
    // linear interpolation between mip levels; kind: the wrap and the last level
    level = clamp(level, 0.0, float(kind.y));
    int low = int(level);
    vec4 found = atlas_level(image, place, kind.x, at, low);
    float w = level - float(low);
    return w > 0.0 ? mix(found, atlas_level(image, place, kind.x, at, low + 1), w) : found;
}"""
