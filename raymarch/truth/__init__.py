"""The float64 reference renderer on the CPU. It uses nothing of the shader or the GPU."""

from raymarch.truth.edges import silhouettes
from raymarch.truth.floor import floor_evaluations
from raymarch.truth.raycast import Hits, raycast
from raymarch.truth.tracer import Truth, truth

__all__ = ["Hits", "Truth", "floor_evaluations", "raycast", "silhouettes", "truth"]
