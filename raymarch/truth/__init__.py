"""The float64 reference renderer on the CPU. It uses nothing of the shader or the GPU."""

from raymarch.truth.compare import Comparison, compare, silhouettes
from raymarch.truth.tracer import Truth, truth

__all__ = ["Comparison", "Truth", "compare", "silhouettes", "truth"]
