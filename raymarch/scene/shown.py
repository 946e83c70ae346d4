"""What a picture shows: what its depths depend on."""

from __future__ import annotations

from dataclasses import dataclass

from raymarch.scene.camera import Pose
from raymarch.scene.legal import solid_at
from raymarch.scene.parameter import Values
from raymarch.sdf.labels import rows_of
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node, children_first


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """The solid, the values of parameters and time, and the camera of a picture.

    whole : (width, height) of the picture of which this one is a part; None if it is whole.
    """

    node: Node
    values: Values
    pose: Pose
    whole: tuple[int, int] | None = None

    def differs(self, other: Shown) -> str:
        """In what respect another picture certainly shows something else, in words; "" for none that is known.

        Solids that are written otherwise count as others, with other materials as the same. Of objects as data nothing
        is known.
        """
        if self.whole != other.whole:
            return f"is a part of one of {self.whole or other.whole}"
        if not self.pose.same(other.pose):
            return "shows another camera"
        ours, theirs = (solid_at(each.node, each.values) for each in (self, other))
        if ours._same is theirs._same or any(
            rows_of(node) is not None for root in (ours, theirs) for node in children_first(root)
        ):
            return ""
        if Lowering(rays="camera").field(ours).body is Lowering(rays="camera").field(theirs).body:
            return ""
        if self.node is not other.node:
            return "shows another solid"
        return f"shows the solid at time = {self.values.time:g} with {dict(self.values.params)}"
