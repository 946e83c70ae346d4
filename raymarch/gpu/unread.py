"""Arrays of a frame that are still on the device. They are read on first access, or before their texture changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any

from numpy.typing import NDArray

from raymarch.gpu.program import in_pass
from raymarch.gpu.targets import Target
from raymarch.plan import Pass


class Unread:
    """The arrays that a pass has drawn into a target.

    Whatever changes or frees the texture calls `read_all` first, while a frame refers to this object; see
    `Context.unread`.
    """

    def __init__(self, chosen: Pass, target: Target) -> None:
        self.chosen = chosen
        self.target: Target | None = target
        """Where the arrays are; None once all are read."""
        self._read: dict[str, NDArray[Any]] = {}
        target.context.unread.add(self)

    def array(self, name: str) -> NDArray[Any]:
        """An array of the pass. Only the channels that it needs are read, and those of flags in the same texture."""
        target = self.target
        if name not in self._read and target is not None:
            with in_pass(self.chosen.name), target.context.bound():  # no other thread draws now
                if self.target is not None and name not in self._read:
                    self._read |= self._with_flags(name, target)
        return self._read[name]

    def _with_flags(self, name: str, target: Target) -> dict[str, NDArray[Any]]:
        own = self.chosen.outputs[name]
        flags = {n: o for n, o in self.chosen.outputs.items() if o.type == "?" and o.texture == own.texture}
        wanted = {name: own, **flags}
        texels = target.channels(own.texture, max(output.needed for output in wanted.values()))
        return {n: output.read(lambda *_: texels) for n, output in wanted.items()}

    @contextmanager
    def texture(self) -> Iterator[Target | None]:
        """The target, which nothing changes during the block; None if all arrays are read."""
        target = self.target
        with target.context.bound() if target is not None else nullcontext():
            yield self.target

    def read_all(self) -> None:
        if self.target is not None:
            for name in self.chosen.outputs:
                self.array(name)
            self.target = None


def unread_of(drawn: Mapping[str, tuple[Pass, Target]]) -> dict[str, Unread]:
    """What draws into targets leave there, by the names of the arrays."""
    found = [Unread(chosen, target) for chosen, target in drawn.values() if chosen.outputs]
    return {name: unread for unread in found for name in unread.chosen.outputs}
