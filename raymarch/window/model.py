"""The model of the window: all that it knows and may show. Plain data, which needs neither a display nor OpenGL.

Commands change it, views draw it. What a command cannot do itself, because it takes the window or its context, it
leaves as a request, which the main loop carries out.
"""

from __future__ import annotations

import json
import time as clock_time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO, TypeAlias

from raymarch.errors import SceneError
from raymarch.gpu.prepare import Prepared
from raymarch.plan import Plan
from raymarch.scene.parameter import Value
from raymarch.window.accuracy import Stop, preset_stops
from raymarch.window.edits import Edits
from raymarch.window.news import Fault, Loaded
from raymarch.window.pick import Pick
from raymarch.window.shot import Shot
from raymarch.window.source import Draft
from raymarch.window.state import State

NOTICED = 4.0
"""Duration of a notice in seconds."""

FRAMES = 120
"""Number of frames whose times are kept."""

PANEL, NARROW = 300, 200
"""Widths of the panel at display scale 1, in pixels."""

SIDES = ("off", "exact", "truth")
"""What the right side of a split picture shows: the most exact setting, or the float64 reference."""


OVER = ("off", "errors", "proof")
"""What lies over the picture: errors against the reference, or the proof of each hit."""

SAVED_SIZES = ("as shown", "2 x", "4 x", "1920x1080", "3840x2160")
"""Sizes of saved pictures: multiples of the picture in the window, or pixels."""


class Log:
    """Writes the window's events as lines of JSON, for scripts, and flushes each; without a file it writes nothing.

    Each event has its name, and `when` it was: in seconds of Unix time.
    """

    def __init__(self, file: Path | None) -> None:
        self._out: TextIO | None = None
        if file is not None:
            try:
                self._out = file.open("w", encoding="utf-8", buffering=1)
            except OSError as fault:
                raise SceneError(f"cannot write '{file}': {fault.strerror}", legal="a writable file") from None

    def say(self, event: str, **facts: Any) -> None:
        if self._out is not None:
            self._out.write(
                json.dumps({"event": event, "when": round(clock_time.time(), 4), **facts}, default=str) + "\n"
            )

    def close(self) -> None:
        if self._out is not None:
            self._out.close()


@dataclass(frozen=True, slots=True)
class Show:
    """Draw another content, and replace the visible one if that succeeds. `loaded` is the reload that it comes from;
    None is an edit."""

    state: State
    loaded: Loaded | None = None
    prepared: Prepared | None = None
    changes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Inspect:
    """Find what the pixel at a cursor position shows; `focus` makes it the target of the camera."""

    x: float
    y: float
    focus: bool = False


@dataclass(frozen=True, slots=True)
class SavePicture:
    """Save the complete picture at a time to a file; of a size in pixels, by default that of the window's picture.
    The notice of it ends with `word`."""

    file: Path
    time: float
    size: tuple[int, int] | None = None
    word: str = ""


@dataclass(frozen=True, slots=True)
class WriteFilm:
    """Write the pictures of a folder as a film, and remove them."""

    folder: Path
    file: Path
    fps: float


@dataclass(frozen=True, slots=True)
class Copy:
    """Put text on the clipboard."""

    text: str


@dataclass(frozen=True, slots=True)
class Open:
    """Reload the scene file, or another one."""

    file: Path | None = None


@dataclass(frozen=True, slots=True)
class Edit:
    """Open a file in the user's editor at a line."""

    file: Path
    line: int


@dataclass(frozen=True, slots=True)
class FullScreen:
    """Fill the screen, or return to the window."""


@dataclass(frozen=True, slots=True)
class Interrupt:
    """Stop the running trial of a scene file."""


@dataclass(frozen=True, slots=True)
class Measure:
    """Measure the mean evaluations per pixel of the visible picture."""


@dataclass(frozen=True, slots=True)
class Close:
    """Close the window."""


Request: TypeAlias = (
    Show | Inspect | SavePicture | WriteFilm | Copy | Open | Edit | FullScreen | Interrupt | Measure | Close
)


@dataclass(slots=True)
class Series:
    """A sequence of pictures, one of which is saved per turn of the main loop: `count` pictures in `folder` from time
    `first` on, `done` of them so far. `film` is the file that they are written to at the end."""

    folder: Path
    first: float
    count: int
    fps: float
    done: int = 0
    film: Path | None = None


@dataclass(slots=True)
class Compare:
    """What the picture is compared with: the right side of the split picture, one of `SIDES`; the divider as a fraction
    of the picture's width; what lies over the picture, one of `OVER`."""

    side: str = "off"
    divider: float = 0.5
    over: str = "off"

    @property
    def reference(self) -> bool:
        """True if the float64 reference is needed."""
        return self.side == "truth" or self.over == "errors"


@dataclass(frozen=True, slots=True)
class Verdicts:
    """How many hits of the picture are proved, contradicted and open so far, of all pixels."""

    proved: int
    contradicted: int
    open: int
    pixels: int

    @property
    def words(self) -> str:
        judged = self.proved + self.contradicted + self.open
        share = 100.0 * self.proved / max(judged, 1)
        text = f"proved: {share:.2f} %"  # never 100 % with an open pixel
        if self.proved < judged:
            text = f"proved: {min(share, 99.99):.2f} %"
        text += f", {self.contradicted:,} contradicted, {self.open:,} open"
        return text if judged == self.pixels else f"{text}; {100 * judged // max(self.pixels, 1)} % judged"


@dataclass(frozen=True, slots=True)
class Remembered:
    """Values of parameters and edits, to return to."""

    params: dict[str, Value]
    edits: Edits


@dataclass(slots=True)
class Drawn:
    """The last step of the picture: milliseconds, drawn size, whether the picture is complete, whether it moves,
    milliseconds of compiling, complete samples per pixel at full size of `wanted`, the drawn fraction of all of them,
    and the number of samples of light of a picture that lacks some, and of all."""

    milliseconds: float = 0.0
    size: tuple[int, int] = (0, 0)
    whole: bool = False
    moving: bool = True
    compile: float = 0.0
    samples: int = 0
    wanted: int = 1
    share: float = 0.0
    lights: tuple[int, int] | None = None


@dataclass(slots=True)
class Model:
    """The state of the window.

    state : what is shown.
    saved_size : of saved pictures, one of `SAVED_SIZES`.
    budget, samples : milliseconds of a frame while something moves; rays per pixel of a still picture.
    stops : the settings between fast and exact.
    size, density : of the window in pixels, and its display scale.
    panel : whether the panel is visible; None if its extra is not installed.
    narrow : whether the panel is narrow. opened : whether sections of the panel are open, by name.
    compare : what the picture is compared with. known : the fraction of the reference that is computed.
    verdicts : how far the proof of the picture is; None if it is not asked for.
    help, fault, pick : messages. notice_text, notice_until : the last notice, and when it ends.
    listed_at : time of the last change of a selected parameter, whose list fades.
    full_screen, rate : whether the window fills the screen, and its frames per second.
    hint : time until which the window says how to get help.
    closed : whether Esc closed the message of the fault.
    draft : changes of the scene file that are shown before they are saved.
    trial : file and start of the running trial of a changed scene file.
    sequence : the sequence that is being saved.
    drawn, frame, plan, evaluations, frames, driver, compiled : what the views report: the last step; ms of the
        last complete sample; the plan; mean evaluations per pixel of a shot; the times of
        the last frames (scene, window, compile); the driver; the number of compiled programs.
    preview : whether the picture is a preview, until the programs of the scene are compiled.
    undone, redone : values of parameters and edits to return to, the latest last; `remembered` is what changed last.
    requests : what commands leave to the main loop.
    changed_at : time of the last change of the picture, which is refined after it.
    """

    state: State
    budget: float = 33.0
    samples: int = 16
    stops: tuple[Stop, ...] = field(default_factory=preset_stops)
    log: Log = field(default_factory=lambda: Log(None))
    size: tuple[int, int] = (960, 540)
    density: float = 1.0
    panel: bool | None = None
    narrow: bool = False
    opened: dict[str, bool] = field(default_factory=dict)
    compare: Compare = field(default_factory=Compare)
    saved_size: str = "as shown"
    known: float = 0.0
    verdicts: Verdicts | None = None
    help: bool = False
    notice_text: str = ""
    notice_until: float = 0.0
    listed_at: float = 0.0
    full_screen: bool = False
    rate: float = 0.0
    hint: float = 0.0
    fault: Fault | None = None
    closed: bool = False
    draft: Draft | None = None
    pick: Pick | None = None
    trial: tuple[Path, float] | None = None
    sequence: Series | None = None
    drawn: Drawn = field(default_factory=Drawn)
    frame: float | None = None
    plan: Plan | None = None
    evaluations: tuple[Shot, float] | None = None
    frames: deque[tuple[float, float, float]] = field(default_factory=lambda: deque([(0.0, 0.0, 0.0)] * FRAMES, FRAMES))
    driver: str = ""
    compiled: int = 0
    preview: bool = False
    undone: list[Remembered] = field(default_factory=list)
    redone: list[Remembered] = field(default_factory=list)
    remembered: tuple[str, float] = ("", 0.0)
    requests: deque[Request] = field(default_factory=deque)
    changed_at: float = field(default_factory=clock_time.perf_counter)

    @property
    def panel_width(self) -> int:
        """Width of the panel in pixels; 0 while it is hidden. A wide one takes up to two fifths of a small window, and
        becomes narrow for that."""
        narrow = NARROW * self.density
        width = narrow if self.narrow else min(PANEL * self.density, max(0.4 * self.size[0], narrow))
        width = round(min(width, 0.6 * self.size[0]))
        return max(min(width, self.size[0] - 1), 0) if self.panel else 0

    @property
    def area(self) -> tuple[int, int]:
        """(width, height) of the picture in pixels: what the panel leaves free of the window."""
        return max(1, self.size[0] - self.panel_width), max(1, self.size[1])

    @property
    def saved_pixels(self) -> tuple[int, int]:
        """(width, height) of saved pictures in pixels."""
        (width, height), chosen = self.area, self.saved_size
        if "x" in chosen and chosen.replace("x", "").isdigit():
            wide, high = map(int, chosen.split("x"))
            return wide, high
        factor = int(chosen.split()[0]) if chosen.endswith(" x") else 1
        return factor * width, factor * height

    @property
    def frame_budget(self) -> float:
        """Milliseconds of a frame for each of the pictures that are drawn while something moves."""
        return self.budget / 2 if self.compare.side == "exact" else self.budget

    @property
    def divider(self) -> int:
        """Column of the divider of a split picture, from the left of the window."""
        width, _ = self.area
        return self.panel_width + round(self.compare.divider * width)

    def request(self, *requests: Request) -> None:
        """Leave requests to the main loop."""
        self.requests.extend(requests)

    def notice(self, text: str) -> None:
        """Show a notice for a few seconds, in place of the one before."""
        self.notice_text, self.notice_until = text, clock_time.perf_counter() + NOTICED
        self.log.say("notice", text=text)

    def say(self, event: str, **facts: Any) -> None:
        self.log.say(event, **facts)


def next_of(values: Sequence[str], now: str, step: int) -> str:
    """The value `step` places on from the current one, cyclically."""
    return values[(values.index(now) + step) % len(values)]
