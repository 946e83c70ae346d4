"""From a plan to one GLSL text, and from a line of that text back to the user's own line."""

from raymarch.shader.assemble import VERTEX, Shader, assemble

__all__ = ["VERTEX", "Shader", "assemble"]
