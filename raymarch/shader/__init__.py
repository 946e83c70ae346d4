"""Link a plan to one GLSL text, and map its lines back to the user's lines."""

from raymarch.shader.assemble import Shader, assemble

__all__ = ["Shader", "assemble"]
