"""What a shader reads from a texture."""

from __future__ import annotations

import hashlib

from raymarch.errors import printable
from raymarch.expr.types import Type, vector


class Data:
    """Numbers in a texture. Data of one class with equal keys are equal.

    key : a digest of the content. label : name in messages and in comments of shaders, without control characters.
    dimension : of the GLSL sampler, 2 or 3. channels : numbers in each texel.
    """

    __slots__ = ("_label", "key")

    key: str
    _label: str
    kind: str
    """The word for it in GLSL names."""
    dimension: int = 2
    channels: int

    @property
    def label(self) -> str:
        return self._label

    @label.setter
    def label(self, label: str) -> None:
        self._label = printable(label).rstrip("\\")  # at the end of a line, a comment would go on in the next

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.label})"

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def name(self) -> str:
        """The GLSL name of the texture."""
        return f"u_{self.kind}_{self.key}"

    @property
    def type(self) -> Type:
        """Type of one texel."""
        return vector(self.channels)


def digest(*parts: bytes) -> str:
    """A key of some content."""
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]
