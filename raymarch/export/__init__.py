"""A scene as a file for other programs: a shader, a page, a triangle mesh."""

from raymarch.export.annotated import figure
from raymarch.export.forms import export, triangulate
from raymarch.export.measures import Measures, measure

__all__ = ["Measures", "export", "figure", "measure", "triangulate"]
