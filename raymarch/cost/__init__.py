"""Cost of accuracy: errors against the reference, measured settings, the Pareto front."""

from raymarch.cost.search import Found, for_error, for_time

__all__ = ["Found", "for_error", "for_time"]
