"""Cost of accuracy: errors against the reference, measured settings, the Pareto front."""

from raymarch.cost.compare import compare
from raymarch.cost.errors import Errors
from raymarch.cost.search import Found, for_error, for_time

__all__ = ["Errors", "Found", "compare", "for_error", "for_time"]
