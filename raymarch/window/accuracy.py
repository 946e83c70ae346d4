"""The settings between fast and exact that the window offers: a measured front, or the presets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from raymarch.errors import SceneError
from raymarch.expr.convert import integer, real, short
from raymarch.scene.quality import NOT_MARCHING, PRESETS, PROMISED, Quality

MARCHING = tuple(f.name for f in fields(Quality) if f.name not in NOT_MARCHING)
"""The fields of `Quality` that a stop sets."""


MEASURED = "a file that raymarch cost --json wrote"


@dataclass(frozen=True, slots=True)
class Stop:
    """A setting of the slider from fast to exact.

    name : what it is called.
    values : every field of `Quality` in `MARCHING`.
    error : 99 % of the hits lie within this many pixels of the reference, measured or promised by the preset.
    milliseconds : measured time of a frame of size `size`; None if it was not measured.
    """

    name: str
    values: Mapping[str, Any]
    error: float
    milliseconds: float | None = None
    size: tuple[int, int] = (0, 0)

    def changes(self, quality: Quality) -> dict[str, Any]:
        """The fields in which the stop differs from a quality."""
        return {name: value for name, value in self.values.items() if value != getattr(quality, name)}

    @property
    def words(self) -> str:
        """Name, error and time."""
        error = f"{self.error:.2g}" if self.error < 100 else f"{self.error:.0f}"
        if self.milliseconds is None:
            return f"{self.name}: error up to {error} px"
        width, height = self.size
        return f"{self.name}: error {error} px, {self.milliseconds:.3g} ms at {width}x{height}"


def preset_stops() -> tuple[Stop, ...]:
    """The presets with the errors that define them."""
    return tuple(
        Stop(name, {n: getattr(Quality.preset(name), n) for n in MARCHING}, PROMISED[name]) for name in PRESETS
    )


def measured_stops(found: Mapping[str, Any]) -> tuple[Stop, ...]:
    """The stops of a measured front; `found` is what `raymarch cost --json` writes. SceneError if it is not that.

    Only settings count that find every hit and differ from the scene's own in the march alone. Each is more exact than
    the faster ones by a tenth at least.
    """
    try:
        base = found["points"][0]
        size = (integer("size", found["size"][0], 1, 1 << 20), integer("size", found["size"][1], 1, 1 << 20))
        usable = [p for p in found["points"] if _is_usable(p, base)]
        points = [
            Stop(
                short(p["preset"] or p["name"])[1:-1],
                {n: getattr(Quality(**p["quality"]), n) for n in MARCHING},
                real("pixels_p99", p["errors"]["pixels_p99"], 0.0),
                real("milliseconds", p["milliseconds"]["median"], 0.0),
                size,
            )
            for p in usable
        ]
    except (LookupError, TypeError, ValueError, AttributeError, SceneError) as fault:
        raise SceneError(f"these measurements cannot be used: {fault}", legal=MEASURED) from None
    stops: list[Stop] = []
    for stop in sorted(points, key=lambda s: (s.milliseconds or 0.0, s.error)):
        if not stops or stop.error <= 0.9 * stops[-1].error:
            stops.append(stop)
    if not stops:
        raise SceneError("no setting of these measurements finds every hit", legal=MEASURED)
    return tuple(stops)


def _is_usable(point: Mapping[str, Any], base: Mapping[str, Any]) -> bool:
    errors, quality = point["errors"], point["quality"]
    kept = (*NOT_MARCHING, "normals")
    alike = all(quality[name] == base["quality"][name] for name in kept)
    plain = point["frames"] == 1 and point["scale"] == 1 and not any(point["variations"].values())
    sound = errors["missed"] == 0 and errors["false"] == 0 and errors["pixels_p99"] is not None
    return bool(alike and plain and sound)


def nearest(stops: Sequence[Stop], quality: Quality) -> int | None:
    """The stop that a quality is; None if it is none of them."""
    return next((i for i, stop in enumerate(stops) if not stop.changes(quality)), None)


def next_stop(stops: Sequence[Stop], quality: Quality, step: int) -> int:
    """The stop `step` places on from a quality; one that is no stop begins at the presets' normal, or in the middle."""
    now = nearest(stops, quality)
    if now is None:
        return len(stops) // 2
    return min(max(now + step, 0), len(stops) - 1)
