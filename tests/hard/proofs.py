"""A frame held against the proof of its hits and hard shadows: what intervals contradict, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from unittest.mock import patch

import numpy as np

import raymarch as rm
from raymarch.proof import search
from raymarch.proof.search import CONTRADICTED
from raymarch.sdf.levels import flatness

TOLERANCE = "0.1px"
"""Of the promise about what a ray may pass, in docs/marching.md."""

FLAT = 2.0
"""Flatness from which a field may have a valley off its surface that is lower than a contact."""

EFFORT = 500
"""Evaluations for a ray, a tenth of the usual: pixels that stay open are no fault here."""


def contradicted(
    scene: rm.Scene, frame: Any, params: Mapping[str, float] | None = None, time: float = 0.0, shadows: bool = False
) -> list[str]:
    """What a proof says against the hits of a frame, and against the hard shadows of its scene.

    Nothing about estimates, of which a march promises nothing; nor about hits before a surface of a flat field: it may
    have a valley off its surface, lower than the contact, and a ray may end there.
    """
    if scene.node.exactness == "estimate":
        return []
    with patch.object(search, "MOST", EFFORT):
        found = rm.prove(scene, frame, tolerance=TOLERANCE, params=params, time=time, shadows=shadows)
    said = []
    wrong = found.state == CONTRADICTED
    if flatness(scene.node) > FLAT:
        wrong &= found.high < found.depth - found.within
    if wrong.any():
        rows, columns = np.nonzero(wrong)
        first = f"the first in row {rows[0]}, column {columns[0]}"
        said += [f"{len(rows)} hits are contradicted by intervals, {first}"]
        said += [f"wrong fact: {fact}" for fact in found.wrong_facts]
    for each in found.shadows:
        count = each.count(CONTRADICTED)
        said += [f"{count} hard shadows of light {each.light} are contradicted by intervals"] if count else []
    return said
