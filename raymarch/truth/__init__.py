"""The reference: what a scene looks like in float64, traced on the CPU, with nothing of the shader's in it."""

from raymarch.truth.compare import Comparison, compare, silhouettes
from raymarch.truth.tracer import Truth, truth

__all__ = ["Comparison", "Truth", "compare", "silhouettes", "truth"]
