"""Lights that come and go: the text that draws some of them also draws others, so that no program is compiled."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

from raymarch.errors import RaymarchError
from raymarch.expr.node import Expr, const
from raymarch.expr.walk import find, substitute
from raymarch.plan import lights
from raymarch.prices import STANDARD, Prices
from raymarch.scene.light import Light
from raymarch.scene.scene import Scene

KNOWN = 8
"""Number of scenes whose lights are remembered."""


@dataclass(frozen=True, slots=True)
class LiveLights:
    """The lights of a scene are rows of a texture, however few, and the text draws further lights.

    kept : a light for each signature that the text covers and the scene has not, without parameters and time.
    cells : whether a grid of cells finds the lights of a surface.
    """

    kept: tuple[Light, ...] = ()
    cells: bool = False

    def covered(self, given: Sequence[Light]) -> frozenset[lights.Signature]:
        """The signatures that the text of some lights covers."""
        return frozenset(map(lights.signature, (*given, *self.kept)))


@dataclass(frozen=True, slots=True)
class _Seen:
    """What a scene had so far: the number of its lights in the last version, and a light for each signature; and
    whether they are live, in cells."""

    count: int
    lights: dict[lights.Signature, Light | None]
    live: bool
    cells: bool


class LightMemory:
    """The lights that the last versions of some scenes had.

    Few lights are written as code with their numbers, which draws faster. When their number changes for the first time,
    and is not 1, they become rows of a texture. Lights then come and go without another program.
    """

    def __init__(self) -> None:
        self._known: OrderedDict[Hashable, _Seen] = OrderedDict()

    def fit(self, scene: Scene, of: Hashable = None, prices: Prices = STANDARD) -> LiveLights | None:
        """How to draw the lights of the next version of a scene. None to draw them as those of any scene.

        of : what identifies the scene: the same for all versions that differ in lights. prices : of the device.
        """
        if not scene.lights or lights.in_fog(scene):
            return None
        own = {lights.signature(light): light for light in scene.lights}
        before = self._known.pop(of, None)
        count, many = len(scene.lights), lights.as_data(scene, prices)
        if before is None:
            seen = _Seen(count, {}, False, many and lights.in_cells(scene, prices))
        else:
            live = before.live or (before.count != count and count > 1)
            seen = _Seen(count, before.lights, live, before.cells or (many and lights.in_cells(scene, prices)))
        known = {**seen.lights, **{of: _fixed(light) for of, light in own.items() if of not in seen.lights}}
        self._known[of] = _Seen(seen.count, known, seen.live, seen.cells)
        while len(self._known) > KNOWN:
            self._known.popitem(last=False)
        return _rows(scene, self._known[of]) if seen.live else None

    def next_rows(self, scene: Scene, of: Hashable = None, prices: Prices = STANDARD) -> LiveLights | None:
        """How the lights of the version that was fitted last would be drawn as rows, as those of a version with
        another number of them are. None if they are rows already, or there are none.

        of, prices : as for `fit`.
        """
        seen = self._known.get(of)
        if seen is None or seen.live or not scene.lights or lights.in_fog(scene) or lights.as_data(scene, prices):
            return None
        return _rows(scene, seen)


def _rows(scene: Scene, seen: _Seen) -> LiveLights:
    """Rows for the lights of a scene, and for those that it had."""
    own = set(map(lights.signature, scene.lights))
    kept = tuple(light for of, light in seen.lights.items() if light is not None and of not in own)
    return LiveLights(kept, seen.cells)


def _fixed(light: Light) -> Light | None:
    """A light of the same signature whose values are constants. None if there is none, as of a light whose softness is
    0 at first."""
    changes: dict[str, Any] = {}
    for name, value in light.arguments().items():
        if isinstance(value, Expr) and not value.is_constant:
            numbers: dict[Expr, Expr] = {each: const(each.data.value) for each in find([value], "param")}
            numbers |= {each: const(0.0) for each in find([value], "time")}
            changes[name] = substitute([value], numbers)[0]
    try:
        made = light.replace(**changes) if changes else light
        same = lights.signature(made) == lights.signature(light)
    except RaymarchError:
        return None
    constant = all(value.is_constant for value in made.expressions)
    return made if same and constant else None
