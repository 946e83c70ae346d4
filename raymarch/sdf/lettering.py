"""Flat shapes from pictures: letters of a font, and masks.

A picture gives the coverage of each pixel. The outline is the contour on which the coverage, interpolated between pixel
centres, is one half; it locates edges to a small part of a pixel (marching squares). The exact distance to the outline
is sampled on a grid and interpolated.
"""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import subprocess
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import described, file_path, input_file, integer, numbers, optional, places_of, switch
from raymarch.expr.images import opened
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.vocabulary import clamp, length, max, min, vec2
from raymarch.files import reading
from raymarch.sdf.definition import cube, shape
from raymarch.sdf.domain import Data, Positive, Scalar, domain_of
from raymarch.sdf.node import Node

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont as Font

__all__ = ["image", "text"]

Array = NDArray[np.float64]

PIXELS = 2
"""Pixels of a picture for each sample along an axis."""
LARGEST = 8192
"""Maximum number of pixels of a picture along an edge."""
MARGIN = 4
"""Samples around the outline's box."""


# The field


def _solid_box(data: Samples) -> tuple[Array, Array]:
    """The box of the solid, in texels.

    Across a cell the interpolated value is linear along each axis, so the solid reaches farthest on a line of samples.
    """
    low, high = [], []
    for values in (data.values, data.values.T):  # along x, along y
        ahead = _first_crossing(values.astype(np.float64))
        behind = _first_crossing(values[:, ::-1].astype(np.float64))
        low.append(ahead.min())
        high.append(values.shape[1] - 1 - behind.min())
    return np.array(low), np.array(high)


def _first_crossing(rows: Array) -> Array:
    """Where each row first falls to 0; infinite where it does not."""
    inside = rows <= 0.0
    found = inside.any(axis=1)
    index = np.argmax(inside, axis=1)
    each = np.arange(len(rows))
    here, before = rows[each, index], rows[each, np.maximum(index - 1, 0)]
    back = np.where(index > 0, here / np.where(index > 0, here - before, 1.0), 0.0)
    return np.where(found, index - back, np.inf)


def _middle(data: Samples) -> Array:
    low, high = _solid_box(data)
    return 0.5 * (low + high)


def _steepness(data: Samples) -> float:
    return float(np.maximum(data.steepest, 1.0))


def _spread(data: Samples, cell: Any) -> float:
    """How far beyond the box a value lies, at most: on the grid by looking, around it by the triangle's inequality."""
    low, high = _solid_box(data)
    y, x = np.indices(data.values.shape)
    beyond = np.maximum(np.maximum(low[0] - x, x - high[0]), np.maximum(low[1] - y, y - high[1]))
    outside = (beyond > 0.0) & (data.values > 0.0)
    farthest = np.max(beyond[outside] / data.values[outside], initial=1.0)
    return float(np.hypot(farthest * _steepness(data), 1.0))


def _some_ring() -> Samples:
    """A ring, in cells: the specimen."""
    axis = np.arange(24) - 11.5
    return Samples(np.abs(np.hypot(*np.meshgrid(axis, axis)) - 6.0) - 2.5)


_SPECIMEN = _some_ring()


def _box(data: Samples, cell: Any) -> tuple[Expr, Expr]:
    return cube(0.5 * cell * expr(np.subtract(*_solid_box(data)[::-1])))


@shape(exactness="bound", bounds=_box, spread=_spread, dimension=2, called="image")
def sampled_outline(p: Expr, data: Data = _SPECIMEN, cell: Positive = 0.08) -> Expr:
    """A flat shape from distances on a square grid, about the middle of its box.

    data : distances in cells, none of them negative at the edge. cell : length between two samples, > 0.

    A bound: the samples are divided by their steepest slope. Outside the grid, that distance and the one to the grid
    are at right angles or more.
    """
    return _interpolation(p, data, cell)


@shape(exactness="bound", bounds=_box, spread=_spread, dimension=2, called="text")
def sampled_letters(p: Expr, data: Data = _SPECIMEN, cell: Positive = 0.08) -> Expr:
    """Letters from distances on a square grid, about the middle of their box."""
    return _interpolation(p, data, cell)


def _interpolation(p: Expr, data: Data, cell: Positive) -> Expr:
    at = p / cell + _middle(data)
    inside = clamp(at, 0.0, tuple(float(n - 1) for n in data.size))
    value = sample(data, at) / _steepness(data)
    # With c the nearest point of the convex grid, |p - x|^2 >= |p - c|^2 + |c - x|^2 for every x of the solid.
    return cell * (length(vec2(length(at - inside), max(value, 0.0))) + min(value, 0.0))


# From coverage to distances


def _outline(coverage: Array) -> tuple[Array, Array]:
    """Start and end points of the pieces of line on which the coverage is one half, in pixels; shapes (n, 2)."""
    over = coverage - 0.5
    corners = [over[:-1, :-1], over[:-1, 1:], over[1:, 1:], over[1:, :-1]]  # around each cell of four pixel centres
    places = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    code = sum((corner > 0).astype(int) << i for i, corner in enumerate(corners))
    saddle = (np.sum(corners, axis=0) > 0) & ((code == 5) | (code == 10))
    code = np.where(saddle, 15 - code, code)
    starts, ends = [np.empty((0, 2))], [np.empty((0, 2))]
    for kind, lines in _LINES.items():
        y, x = np.nonzero(code == kind)
        for line in lines:
            for edge, found in zip(line, (starts, ends), strict=True):
                i, j = edge, (edge + 1) % 4
                a, b = corners[i][y, x], corners[j][y, x]
                fraction = (a / (a - b))[:, None]
                found.append(np.stack([x, y], axis=-1) + places[i] + fraction * (places[j] - places[i]))
    return np.concatenate(starts), np.concatenate(ends)


_LINES: Mapping[int, tuple[tuple[int, int], ...]] = {
    1: ((3, 0),),
    2: ((0, 1),),
    3: ((3, 1),),
    4: ((1, 2),),
    5: ((3, 0), (1, 2)),
    6: ((0, 2),),
    7: ((3, 2),),
    8: ((2, 3),),
    9: ((2, 0),),
    10: ((0, 1), (2, 3)),
    11: ((2, 1),),
    12: ((1, 3),),
    13: ((1, 0),),
    14: ((0, 3),),
}
"""Which edges of a cell the outline joins, by the corners that are covered (bits 0 to 3)."""


def _nearest(x: Array, y: Array, starts: Array, ends: Array) -> Array:
    """Distance from each point of a grid to the nearest piece of line; shape (y, x).

    Points are taken in blocks. A piece can be nearest to one of them only if it is no farther from the block's
    middle than the nearest piece is, by twice the block's radius.
    """
    middles, halves = 0.5 * (starts + ends), 0.5 * np.linalg.norm(ends - starts, axis=1)
    result = np.empty((len(y), len(x)))
    for j in range(0, len(y), 8):
        for i in range(0, len(x), 8):
            points = np.stack(np.meshgrid(x[i : i + 8], y[j : j + 8]), axis=-1)
            flat = points.reshape(-1, 2)
            centre = flat.mean(axis=0)
            reach = np.linalg.norm(middles - centre, axis=1)
            radius = np.linalg.norm(flat - centre, axis=1).max()
            near = reach - halves <= (reach + halves).min() + 2.0 * radius
            a, along = starts[near], (ends - starts)[near]
            w = flat[:, None] - a
            squared = np.maximum((along * along).sum(axis=-1), np.finfo(np.float64).tiny)
            t = np.clip((w * along).sum(axis=-1) / squared, 0.0, 1.0)
            gap = w - t[..., None] * along
            nearest = np.sqrt((gap * gap).sum(axis=-1).min(axis=1))
            result[j : j + 8, i : i + 8] = nearest.reshape(points.shape[:2])
    return result


def _interpolated(values: Array, x: Array, y: Array) -> Array:
    """Bilinear interpolation at the points of a grid; the edge's value outside."""
    columns = [np.interp(x, np.arange(values.shape[1]), row) for row in values]
    rows = [np.interp(y, np.arange(values.shape[0]), column) for column in np.array(columns).T]
    return np.array(rows).T


def _distances(coverage: Array, what: str) -> Samples:
    """Signed distances in cells, row 0 at the bottom; the outline's box stands `MARGIN` cells from the edges."""
    padded = np.pad(coverage, 1)[::-1]
    starts, ends = _outline(padded)
    if not len(starts):
        raise SceneError(f"{what} shows nothing", legal="something that is at least half covered, and a background")
    low, high = starts.min(axis=0), starts.max(axis=0)
    middle, steps = 0.5 * (low + high), np.ceil((high - low) / PIXELS).astype(int)
    x, y = (m + PIXELS * (np.arange(n + 2 * MARGIN + 1) - 0.5 * n - MARGIN) for m, n in zip(middle, steps, strict=True))
    values = _nearest(x, y, starts, ends) * np.where(_interpolated(padded, x, y) > 0.5, -1.0, 1.0) / PIXELS
    rounded = values.astype(np.float32)
    rounded = np.where(rounded < values, np.nextafter(rounded, np.float32(np.inf)), rounded)
    if not np.any(rounded < 0):
        raise SceneError(f"{what} is too fine", legal="a larger resolution, or bolder strokes")
    return Samples(rounded)


def _standing(made: Callable[..., Node], data: Samples, height: Expr) -> Node:
    """The shape of this height."""
    low, high = _solid_box(data)
    return made(data, height / float(high[1] - low[1]))


def _checked(name: str, height: Scalar, resolution: int) -> tuple[Expr, int]:
    """The height as an expression, and the resolution; SceneError for what is not legal."""
    count = integer(f"{name}: resolution", resolution, 8, 512)
    accepted: Expr = domain_of(Positive, None).accept(name, "height", height)
    return accepted, count


# Text


@checked
def text(
    string: str, font: str | os.PathLike[str] | None = None, height: Scalar = 1.0, *, resolution: int = 96
) -> Node:
    """Text as a flat shape, centred at the middle of its box.

    Parameters
    ----------
    string : the text. "\\n" starts a new line; lines are centred.
    font : a TrueType or OpenType file, or the family of an installed font, such as "DejaVu Serif". None is the font of
        Pillow, or for a text with letters that it lacks, an installed DejaVu Sans, Noto Sans or Arial that has all.
    height : full height of the letters as drawn, from the lowest point to the highest, a length > 0.
    resolution : samples along that height, 8 to 512; fewer if the text would be wider than 2048 samples.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : letters that the font lacks.

    Notes
    -----
    A bound: sampled and interpolated linearly. Details below a sample are rounded off.
    """
    if not isinstance(string, str):
        raise SceneError(f"text: string = {described(string)}", legal="a string")
    full, resolution = _checked("text", height, resolution)
    file = optional(file_path, "text: font", font, "a TrueType or OpenType file, or a name that the system knows")
    letters = unicodedata.normalize("NFC", str(string).replace("\r\n", "\n"))
    found = None if file is None else next(filter(os.path.isfile, places_of(file)), None)
    if found is None:
        return _standing(sampled_letters, _written(letters, file, "", resolution), full)
    with reading("text: font", found, "a TrueType or OpenType file"):  # also while letters are drawn
        content = hashlib.sha256(Path(found).read_bytes()).hexdigest()
        return _standing(sampled_letters, _written(letters, found, content, resolution), full)


def _shown(string: str) -> str:
    return repr(string if len(string) <= 40 else string[:37] + "...")


def _font(file: str | None, size: float) -> Font:
    legal = "a TrueType or OpenType file, or the family of an installed font, such as 'DejaVu Sans'"
    from PIL import ImageFont  # takes time, and few scenes have letters

    try:
        found = ImageFont.load_default(size) if file is None else ImageFont.truetype(_file_of(file), size)
    except OSError as fault:
        raise SceneError(f"text: no font '{file}': {fault}", legal=legal) from None
    assert isinstance(found, ImageFont.FreeTypeFont)  # of a size
    return found


@functools.lru_cache(maxsize=64)
def _file_of(font: str) -> str:
    """The file of an installed font family, by fontconfig or matplotlib; else the name itself."""
    if Path(font).suffix or Path(font).exists():  # Pillow finds files of the system by their names
        return font
    if fontconfig := shutil.which("fc-match"):
        found = subprocess.run([fontconfig, "-f", "%{family}\n%{file}", font], capture_output=True, text=True)
        families, _, file = found.stdout.partition("\n")
        if font.casefold() in (family.strip().casefold() for family in families.split(",")):  # else it is another font
            return file
    try:
        from matplotlib.font_manager import findfont
    except ImportError:
        return font
    try:
        return str(findfont(font, fallback_to_default=False))
    except ValueError:
        return font


ABSENT = "\uffff"
"""No character, by Unicode: every font shows its sign for a missing letter."""

WIDE = ("DejaVuSans.ttf", "DejaVu Sans", "NotoSans-Regular.ttf", "Noto Sans", "Arial.ttf", "arial.ttf")
"""Names of fonts with many letters, one of which most systems have."""


def _glyph(font: Font, letter: str) -> tuple[object, ...]:
    """The image of a letter: size, pixels and advance."""
    mask = font.getmask(letter)
    return mask.size, bytes(mask), font.getlength(letter)


def _lacking(string: str, font: Font) -> list[str]:
    """The letters of a string that a font lacks: their image is that of the sign for missing letters."""
    from PIL import ImageFont

    font = font.font_variant(layout_engine=ImageFont.Layout.BASIC)  # one letter, one glyph
    sign = _glyph(font, ABSENT)
    blank = not any(bytes(font.getmask(ABSENT)))
    found = []
    for letter in dict.fromkeys(string):
        if letter == "\n" or (blank and letter.isspace()):
            continue
        if unicodedata.category(letter) == "Cs" or _glyph(font, letter) == sign:
            found.append(letter)
    return found


def _able(string: str, file: str | None) -> str | None:
    """The font that has all letters of a string: the given one, or in place of Pillow's own an installed one."""
    font = _font(file, 32.0)
    lacking = _lacking(string, font)
    if not lacking:
        return file
    others = [other for other in WIDE if _has(other, "")] if file is None else []
    for other in others:
        if not (missing := _lacking(string, _font(other, 32.0))):
            return other
        if len(missing) < len(lacking):  # of the two fonts, this one is worth naming
            file, lacking = other, missing
    name = f"the font '{file}'" if file is not None else f"Pillow's own font, {font.getname()[0]},"
    known = next((other for other in WIDE if other != file and _has(other, lacking)), None)
    legal = "letters that the font has, or font= of one that has them" + (f", such as '{known}'" if known else "")
    shown = ", ".join(map(repr, lacking[:8])) + (", ..." if len(lacking) > 8 else "")
    raise SceneError(f"text: {name} lacks {shown} of {_shown(string)}", legal=legal)


def _has(file: str, letters: Iterable[str]) -> bool:
    """True if there is such a font, and it has all of some letters."""
    from PIL import ImageFont

    try:
        return not _lacking("".join(letters), ImageFont.truetype(_file_of(file), 32.0))
    except OSError:
        return False


@functools.lru_cache(maxsize=64)
def _written(string: str, file: str | None, content: str, resolution: int) -> Samples:
    """The letters. content : a hash of the file of the user's own font, which may change under its name."""
    from PIL import ImageDraw

    named = f"text: {_shown(string)}" + (f" in the font '{file}'" if file is not None else "")
    file = _able(string, file)
    draw = ImageDraw.Draw(Image.new("L", (1, 1)))
    trial = 100.0
    left, top, right, bottom = draw.multiline_textbbox((0, 0), string, font=_font(file, trial), align="center")
    if right <= left or bottom <= top:
        raise SceneError(f"{named} shows nothing", legal="letters that the font has")
    widest = (2048 - 2 * MARGIN - 4) * (bottom - top) / (right - left)
    samples = float(np.minimum(resolution, widest))
    if samples < 8:
        wide = (right - left) / (bottom - top)
        raise SceneError(f"{named} is {wide:.0f} times as wide as high", legal="250 times or less")
    size = trial * PIXELS * samples / (bottom - top)
    if size < 1.0:  # the least of FreeType
        lines = 1 + string.count("\n")
        what = f"{named} has {lines:,} lines in {samples:.0f} samples"
        raise SceneError(what, legal="half a sample or more for each line: fewer lines, or resolution= up to 512")
    font = _font(file, size)
    left, top, right, bottom = draw.multiline_textbbox((0, 0), string, font=font, align="center")
    page = Image.new("L", (int(right - left) + 8, int(bottom - top) + 8))
    ImageDraw.Draw(page).multiline_text((4 - left, 4 - top), string, fill=255, font=font, align="center")
    return _distances(np.asarray(page, np.float64) / 255.0, named)


# Masks


@checked
def image(
    source: str | os.PathLike[str] | ArrayLike, height: Scalar = 1.0, *, invert: bool = False, resolution: int = 192
) -> Node:
    """A flat shape from a picture: its opaque pixels, or its bright ones if there is no alpha channel.

    Parameters
    ----------
    source : an image file of up to 8192 pixels along an edge, whose alpha channel is used if it has one, else the
        luminance; or an array of coverage, shape (rows, columns), row 0 at the top: bool, 0 to 255 for integers, else 0
        to 1.
    height : full height of the shape, from the lowest covered point to the highest, a length > 0.
    invert : use the transparent or dark pixels instead.
    resolution : samples along the longer side of the picture, 8 to 512, but no more than it has pixels.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: sampled and interpolated linearly. The edge is where the coverage is one half. Shapes that the border of
    the picture cuts are closed there.
    """
    full, resolution = _checked("image", height, resolution)
    coverage = _coverage(source)
    if switch("image: invert", invert):
        coverage = 1.0 - coverage
    shrink = PIXELS * resolution / np.max(coverage.shape)
    rows, columns = (int(np.maximum(np.ceil(n * np.minimum(shrink, PIXELS)), 2)) for n in coverage.shape)
    page = Image.fromarray(coverage.astype(np.float32))
    method = Image.Resampling.BOX if shrink < 1.0 else Image.Resampling.BILINEAR
    resized = np.asarray(page.resize((columns, rows), method), np.float64)
    named = f"'{os.fspath(source)}'" if isinstance(source, str | os.PathLike) else "the picture"
    return _standing(sampled_outline, _distances(resized, f"image: {named}"), full)


def _coverage(source: str | os.PathLike[str] | ArrayLike) -> NDArray[Any]:
    """How far each pixel is covered, from 0 to 1."""
    if isinstance(source, str | os.PathLike):
        source = input_file("image: source", source, "an image file")
        with opened("image", source, LARGEST) as picture:
            if "A" in picture.getbands() or "transparency" in picture.info:
                return np.asarray(picture.convert("RGBA").getchannel("A"), np.float32) / np.float32(255.0)
            deep = np.float32(65535.0 if "16" in picture.mode else 255.0)
            return np.asarray(picture.convert("F"), np.float32) / deep
    legal = "an image file, or an array (rows, columns) of numbers"
    numbers("image: source", source, legal)
    array = np.asarray(source)
    if array.ndim != 2 or array.size == 0 or array.dtype.kind not in "biuf":
        raise SceneError(f"image: an array of shape {array.shape}, {array.dtype}", legal="(rows, columns) of numbers")
    values = array.astype(np.float64) / (255.0 if array.dtype.kind in "iu" else 1.0)
    if not np.all((values >= 0.0) & (values <= 1.0)):
        what = f"image: values from {array.min()} to {array.max()}"
        raise SceneError(what, legal="0 to 255 for integers, else 0 to 1")
    return values
