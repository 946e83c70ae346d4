"""How exact the picture shall be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from raymarch.errors import SceneError

TRACERS = ("plain",)
NORMALS = ("analytic", "tetrahedron", "central", "forward")


@dataclass(frozen=True, slots=True)
class Quality:
    """Choices between accuracy and time.

    Parameters
    ----------
    tracer : "plain" sphere tracing.
    max_steps : field evaluations that a ray may take, 1 to 60,000 (software renderers end loops at 65,535).
    epsilon : a ray hits where the field falls below this many pixel widths at that distance, 0.001 to 10.
    normals : "analytic" gradients of the definitions; or finite differences, to compare: "tetrahedron" (4
        evaluations, error of first order in the step), "central" (6, second order), "forward" (4, first order).
    """

    tracer: Literal["plain"] = "plain"
    max_steps: int = 512
    epsilon: float = 0.1
    normals: Literal["analytic", "tetrahedron", "central", "forward"] = "analytic"

    def __post_init__(self) -> None:
        if self.tracer not in TRACERS:
            raise SceneError(f"Quality: tracer = {self.tracer!r}", legal=", ".join(map(repr, TRACERS)))
        if self.normals not in NORMALS:
            raise SceneError(f"Quality: normals = {self.normals!r}", legal=", ".join(map(repr, NORMALS)))
        steps = self.max_steps
        if isinstance(steps, bool) or not isinstance(steps, int) or not 1 <= steps <= 60000:
            raise SceneError(f"Quality: max_steps = {steps!r}", legal="an integer from 1 to 60000")
        epsilon = self.epsilon
        if isinstance(epsilon, bool) or not isinstance(epsilon, int | float) or not 1e-3 <= epsilon <= 10:
            raise SceneError(f"Quality: epsilon = {epsilon!r}", legal="pixel widths from 0.001 to 10")
