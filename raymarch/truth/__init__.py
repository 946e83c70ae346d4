"""The float64 reference renderer on the CPU. It shares no code with the shader."""

from raymarch.truth.compare import Comparison, compare, silhouettes
from raymarch.truth.tracer import Truth, truth

__all__ = ["Comparison", "Truth", "compare", "silhouettes", "truth"]
