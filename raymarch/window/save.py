"""Saving from the window: a picture, a sequence of pictures, settings. Files go to the current folder."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import Image

from raymarch.gpu.views import VIEWS
from raymarch.gpu.views import picture as picture_of

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer

SECONDS = 2.0
"""Length of a sequence in seconds if no loop is set."""


@dataclass(slots=True)
class Sequence:
    """A sequence of pictures over a time span; one is written per turn of the window's loop.

    Attributes
    ----------
    folder : output folder; files are frame-0000.png and so on.
    first : time of the first picture, in seconds. count : number of pictures. fps : pictures per second.
    done : number of pictures written so far.
    """

    folder: Path
    first: float
    count: int
    fps: float
    done: int = 0

    def step(self, viewer: Viewer) -> bool:
        """Write the next picture. Returns False at the end or if it cannot be written."""
        time = self.first + self.done / self.fps
        file = self.folder / f"frame-{self.done:04d}.png"
        if not _write(viewer, file, shot(viewer, time)):
            return False
        self.done += 1
        if self.done < self.count:
            return True
        viewer.notice(f"saved {self.count} pictures in {self.folder}")
        viewer.log.say("saved", file=str(self.folder), count=self.count)
        return False


def still(viewer: Viewer) -> None:
    """Save the complete picture at the window's size, without panel and messages."""
    file = _free(viewer.state.file.stem, ".png")
    if _write(viewer, file, shot(viewer, viewer.state.timeline.time)):
        viewer.notice(f"saved {file}")
        viewer.log.say("saved", file=str(file))


def begin(viewer: Viewer) -> None:
    """Start a sequence: the loop if there is one, else some seconds from the current time."""
    timeline = viewer.state.timeline
    first, last = timeline.loop or (timeline.time, timeline.time + SECONDS)
    folder = _free(viewer.state.file.stem, "")
    try:
        folder.mkdir()
    except OSError as fault:
        viewer.notice(f"cannot make the folder {folder}: {fault.strerror}")
        return
    viewer.sequence = Sequence(folder, first, max(1, round((last - first) * timeline.fps)), timeline.fps)
    viewer.notice(f"saving {viewer.sequence.count} pictures in {folder} (Esc stops)")


def settings(viewer: Viewer) -> None:
    """Save the settings for `raymarch view --settings`."""
    file = _free(viewer.state.file.stem, ".view.json")
    try:
        file.write_text(json.dumps(viewer.state.settings(), indent=2) + "\n", encoding="utf-8")
    except OSError as fault:
        viewer.notice(f"cannot write {file}: {fault.strerror}")
        return
    viewer.notice(f"saved {file}")
    viewer.log.say("saved", file=str(file))


def shot(viewer: Viewer, time: float) -> Image.Image:
    """The complete picture at a time, as `raymarch render` would draw it with this camera."""
    state = viewer.state
    renderer = viewer.picture.at(viewer.window.size)
    made = renderer.render(state.scene, time, state.params, VIEWS[state.view], pose=state.pose())
    return picture_of(made, state.view, state.scene)


def _write(viewer: Viewer, file: Path, image: Image.Image) -> bool:
    partial = file.with_name(f".{file.name}.partial")
    try:
        image.save(partial, "PNG")
        partial.replace(file)
    except OSError as fault:
        partial.unlink(missing_ok=True)
        viewer.notice(f"cannot write {file}: {fault.strerror or fault}")
        return False
    return True


def _free(stem: str, ending: str) -> Path:
    """An unused file name in the current folder."""
    names: Any = (Path(f"{stem}-{i}{ending}") for i in count(1))
    return next(name for name in names if not name.exists())
