"""A scene as a file for other programs: a shader, a page, a triangle mesh."""

from raymarch.export.forms import export, triangulate

__all__ = ["export", "triangulate"]
