"""Contexts, programs, textures, clocks, and the renderer that runs passes. The only package that imports moderngl."""

from raymarch.gpu.context import open_context
from raymarch.gpu.frame import Frame
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.still import render

__all__ = ["Frame", "Renderer", "open_context", "render"]
