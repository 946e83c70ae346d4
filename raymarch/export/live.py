"""A scene as a page in a cell of a notebook."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from io import BytesIO
from typing import Any

from PIL.Image import Image

from raymarch.errors import PlanError, UnknownNameError
from raymarch.files import install
from raymarch.gpu import frame
from raymarch.gpu.still import render
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene, in_notebook

SMALL = (240, 135)
"""Largest width and height of the picture in a page."""


def jpeg(picture: Image) -> bytes:
    """A small copy of a picture as a JPEG file."""
    small, file = picture.convert("RGB"), BytesIO()
    small.thumbnail(SMALL)
    small.save(file, "JPEG", quality=60)
    return file.getvalue()


@dataclass(frozen=True, slots=True)
class Live:
    """A scene as a page in a cell of a notebook. Where no page can be shown, it is a picture."""

    scene: Scene
    values: Values
    size: tuple[int, int]

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        from raymarch.export.text.html import text_of  # for the time of a start

        image = self.picture()
        found: dict[str, Any] = {"image/png": frame.png(image), "text/plain": repr(self)}
        try:
            page = escape(text_of(self.scene, self.values, jpeg(image)).text, quote=True)
        except PlanError:
            return found
        width, height = self.size
        style = f"width: 100%; max-width: {width}px; height: {height}px; border: 0"
        found["text/html"] = f'<iframe srcdoc="{page}" style="{style}" allow="fullscreen"></iframe>'
        return found

    def picture(self) -> Image:
        """The picture of the scene, of its size."""
        return render(self.scene, self.size, self.values.time, self.values.params)

    def __getattr__(self, name: str) -> Any:
        if name in ("params", "time", "playing", "view", "orbit", "pan", "observe", "render"):
            why = "needs the package anywidget" if in_notebook() else "is that of a widget in a notebook; this is none"
            legal = f"{install('jupyter')}, or rm.render(scene, params=...)"
            raise UnknownNameError(f"show: {name} {why}", legal=legal)
        raise AttributeError(name)  # what Python and its tools look for

    def __repr__(self) -> str:
        return f"<raymarch scene, {self.size[0]}x{self.size[1]}>"
