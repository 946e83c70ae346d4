"""A figure of matplotlib that a notebook shows."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure


class NotebookFigure(Figure):
    """A figure that is a picture in a cell, also where pyplot, which registers figures, is not imported."""

    def _repr_png_(self) -> bytes:
        """The picture as a PNG file, with the pixels of the scene one for one."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=self.dpi)
        return file.getvalue()
