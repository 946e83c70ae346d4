"""From a plan to one GLSL text, and from a line of that text back to the user's own line."""

from raymarch.shader.assemble import Shader, assemble

__all__ = ["Shader", "assemble"]
