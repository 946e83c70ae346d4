"""Colours as strings: a name of CSS or hexadecimal digits, which are encoded in sRGB."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import short
from raymarch.expr.node import called_by_expressions

LEGAL = "linear RGB such as (1, 0.25, 0); or in sRGB, \"#ff8800\" or a name of CSS such as 'orange'"


@called_by_expressions
def linear_color(what: str, value: Any, legal: str = LEGAL) -> Any:
    """Linear RGB of a string, as a tuple; other values unchanged.

    A string is "#rgb", "#rrggbb", "rgb(255, 136, 0)", "hsl(32, 100%, 50%)" or one of the 148 names of CSS Color 4.
    Its values are encoded in sRGB (IEC 61966-2-1). legal : for the message about a string that is no colour.
    """
    if not isinstance(value, str):
        return value
    from PIL import ImageColor  # these are imported when a colour is first given as a string, for the time of a start

    from raymarch.expr.srgb import srgb_to_linear

    try:
        encoded: Sequence[int] = ImageColor.getrgb(value.strip())
    except ValueError:
        close = get_close_matches(value.strip().lower(), ImageColor.colormap, 1)
        hint = f"did you mean '{close[0]}'? " if close else ""
        raise SceneError(f"{what} = {short(value)}", legal=f"{hint}{legal}") from None
    if len(encoded) != 3:
        raise SceneError(f"{what} = {short(value)} has an opacity", legal=LEGAL)
    return tuple(srgb_to_linear(np.array(encoded) / 255.0).tolist())
