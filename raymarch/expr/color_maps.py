"""Colour maps: colours as a function of a number.

Three of matplotlib's maps, as every fifth of their 256 colours: "viridis" and "inferno" are perceptually uniform: equal
steps of the value look equally large, also in grey (Smith and van der Walt 2015). "coolwarm" diverges from a neutral
middle (Moreland 2009).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from raymarch.expr.function import Function
from raymarch.expr.node import var
from raymarch.expr.tables import Table, fetch
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import floor, min, mix, where

MAPS = {
    "viridis": """
        440154 46085c 471063 481769 481d6f 482475 472a7a 46307e 453781 433d84 414287 3f4889 3d4e8a 3a538b 38598c 355e8d
        33638d 31688e 2e6d8e 2c718e 2a768e 297b8e 27808e 25848e 23898e 218e8d 20928c 1f978b 1e9c89 1fa188 21a585 24aa83
        28ae80 2eb37c 35b779 3dbc74 46c06f 50c46a 5ac864 65cb5e 70cf57 7cd250 89d548 95d840 a2da37 b0dd2f bddf26 cae11f
        d8e219 e5e419 f1e51d fde725
    """,
    "inferno": """
        000004 02020c 050417 0a0722 10092d 160b39 1e0c45 260c51 2f0a5b 380962 400a67 490b6a 510e6c 59106e 61136e 69166e
        71196e 781c6d 801f6c 88226a 902568 982766 a02a63 a82e5f b0315b b73557 bf3952 c63d4d cc4248 d34743 d94d3d df5337
        e45a31 e9612b ed6925 f1711f f47918 f78212 f98b0b fa9407 fb9d07 fca60c fcb014 fbba1f fac42a f8cd37 f6d746 f4e156
        f2ea69 f2f27d f5f992 fcffa4
    """,
    "coolwarm": """
        3b4cc0 4055c8 465ecf 4c66d6 536edd 5977e3 5f7fe8 6687ed 6c8ff1 7396f5 7a9df8 81a4fb 88abfd 8fb1fe 96b7ff 9dbdff
        a3c2fe aac7fd b1cbfc b7cff9 bed2f6 c4d5f3 cad8ef cfdaea d5dbe5 dadce0 dfdbd9 e4d9d2 e9d5cb edd2c3 f0cdbb f2c9b4
        f5c4ac f6bea4 f7b89c f7b194 f7aa8c f6a385 f59c7d f39475 f08b6e ed8366 e97a5f e57058 e16751 dc5d4a d65244 d0473d
        ca3b37 c32e31 bb1b2c b40426
    """,
}
"""Colours from the lowest to the highest value, evenly spaced, as RRGGBB in hexadecimal."""


SHARE = var("share", FLOAT)


@cache
def color_map(name: str) -> Function:
    """A map as a function of a number, which is clamped to [0, 1], NaN to 0: sRGB in [0, 1], in NumPy and in GLSL.

    name : a key of `MAPS`. Within 2/255 of matplotlib's map.
    """
    return interpolated(encoded(name), name)


def encoded(name: str) -> list[list[float]]:
    """The colours of a map, sRGB in [0, 1]."""
    return [[int(color[i : i + 2], 16) / 255.0 for i in (0, 2, 4)] for color in MAPS[name].split()]


def interpolated(colors: Sequence[Sequence[float]], name: str) -> Function:
    """The linear interpolation of two or more colours at equal steps of a number, which is clamped to [0, 1], NaN to 0.

    name : of the function in GLSL.
    """
    table = Table([[*color, 1.0] for color in colors], name)
    at = where(SHARE > 0.0, min(SHARE, 1.0), 0.0) * float(len(colors) - 1)
    low = min(floor(at), float(len(colors) - 2))
    return Function(name, (SHARE,), mix(fetch(table, low).xyz, fetch(table, low + 1.0).xyz, at - low))
