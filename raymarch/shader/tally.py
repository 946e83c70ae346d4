"""Counts of evaluations in a shader that counts them: each function of the field adds its calls."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.shader.chunk import Mapped

EVALUATIONS = frozenset(
    "field marched_field field_advance field_gradient undivided_field undivided_advance part_at".split()
)
"""The functions whose calls are evaluations of the field or its gradient."""

COUNT = "count_evaluation"
"""The function that counts one, of the kind of the present ray; see view/tally_of_kinds.glsl."""


def tallied(lines: Sequence[Mapped]) -> list[Mapped]:
    """The lines of a text that is complete otherwise, with the counts. What nothing reads is left out before, because
    a call that counts changes more than what it returns."""
    count = Mapped(f"    {COUNT}();", "counts of evaluations")
    return [each for line in lines for each in (line, count)[: 1 + line.tallied]]
