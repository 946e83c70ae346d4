"""A scene in a cell of a notebook, as a page whose state Python reads and sets: needs anywidget."""

from __future__ import annotations

import base64
import sys
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any
from uuid import uuid4

from raymarch.errors import SceneError
from raymarch.export.live import Live
from raymarch.export.text.html import text_of
from raymarch.gpu.frame import png
from raymarch.gpu.still import render
from raymarch.scene.parameter import Value, set_values

VIEWS = ("picture", "depth", "evaluations", "normals")


@cache
def widget_class() -> Any:
    """The class of the widget. Raises ImportError if anywidget is not installed."""
    import anywidget  # type: ignore[import-untyped, unused-ignore]
    import traitlets
    from traitlets import Bool, Dict, Enum, Float, List, Unicode

    class SceneWidget(anywidget.AnyWidget):  # type: ignore[misc, unused-ignore]
        """A scene as a live page.

        Attributes
        ----------
        params : values of the scene's parameters by name. An assigned dict replaces the values that it names.
        time : in seconds. playing : whether the time runs.
        view : "picture", "depth", "evaluations" or "normals".
        orbit : turned by (yaw, pitch) in radians about the camera's target, and the logarithm of the distance's factor.
        pan : the camera's shift (right, up), over its distance from the target.

        Each is set from Python and from the page; `observe` calls a function when one changes.
        """

        _esm = files("raymarch.export").joinpath("widget.js").read_text(encoding="utf-8")
        page = Unicode().tag(sync=True)
        still = Unicode().tag(sync=True)
        size = List([0, 0]).tag(sync=True)
        params = Dict().tag(sync=True)
        time = Float().tag(sync=True)
        playing = Bool(None, allow_none=True).tag(sync=True)
        view = Enum(VIEWS, "picture").tag(sync=True)
        orbit = List([0.0, 0.0, 0.0]).tag(sync=True)
        pan = List([0.0, 0.0]).tag(sync=True)

        def __init__(self, shown: Live) -> None:
            self._shown = shown
            self._values = shown.values.params
            page = text_of(shown.scene, shown.values).text
            params = _plain(shown.values.params)
            values = {"size": list(shown.size), "params": params, "time": shown.values.time}
            super().__init__(page=page, still=f"raymarch-{uuid4().hex}", **values)

        @traitlets.validate("params")
        def _check_params(self, proposal: Any) -> dict[str, Any]:
            given = proposal["value"]
            if not isinstance(given, Mapping):
                raise SceneError(f"params = {given!r}", legal="a dict of values by name")
            specs = self._shown.scene.parameters
            self._values = set_values(specs, {**self._values, **given}, where=self._shown.scene.where).params
            return _plain(self._values)

        def render(self, size: tuple[int, int] | None = None) -> Any:
            """The picture of the scene at the present parameters and time, drawn by Python from the scene's camera.

            size : (width, height) in pixels; that of the widget if None. Returns a PIL image.
            """
            return render(self._shown.scene, size or self._shown.size, self.time, self._values)

        def _repr_mimebundle_(self, **options: Any) -> Any:
            found = super()._repr_mimebundle_(**options)
            data, metadata = found if isinstance(found, tuple) else (found or {}, {})
            image = png(self._shown.picture())
            _display_still(self.still, image)
            return {**data, "image/png": image, "text/plain": repr(self)}, metadata

        def __repr__(self) -> str:
            return repr(self._shown)

    return SceneWidget


def _display_still(name: str, image: bytes) -> None:
    """Display a picture before the widget, which hides it: a notebook that was converted to HTML or PDF shows it."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is not None:
        data = base64.b64encode(image).decode()
        text = f'<img class="{name}" alt="a raymarch scene" src="data:image/png;base64,{data}">'
        shell.display_pub.publish({"text/html": text})


def _plain(values: Mapping[str, Value]) -> dict[str, Any]:
    """The values as JSON has them."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
