"""A frame held against the proof of its hits and hard shadows: what intervals contradict, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from unittest.mock import patch

import numpy as np

import raymarch as rm
from raymarch.proof import search
from raymarch.proof.search import CONTRADICTED

TOLERANCE = "0.1px"
"""Of the promise about what a ray may pass, in docs/marching.md."""

EFFORT = 500
"""Evaluations for a ray, a tenth of the usual: pixels that stay open are no fault here."""


def contradicted(
    scene: rm.Scene, frame: Any, params: Mapping[str, float] | None = None, time: float = 0.0, shadows: bool = False
) -> list[str]:
    """What a proof says against the hits of a frame, and against the hard shadows of its scene; nothing about
    estimates, of which a march promises nothing."""
    if scene.node.exactness == "estimate":
        return []
    with patch.object(search, "MOST", EFFORT):
        found = rm.prove(scene, frame, tolerance=TOLERANCE, params=params, time=time, shadows=shadows)
    said = []
    if found.contradicted:
        rows, columns = np.nonzero(found.state == CONTRADICTED)
        first = f"the first in row {rows[0]}, column {columns[0]}"
        said += [f"{found.contradicted} hits are contradicted by intervals, {first}"]
        said += [f"wrong fact: {fact}" for fact in found.wrong_facts]
    for each in found.shadows:
        count = each.count(CONTRADICTED)
        said += [f"{count} hard shadows of light {each.light} are contradicted by intervals"] if count else []
    return said
