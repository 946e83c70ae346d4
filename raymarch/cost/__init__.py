"""What accuracy costs in time: errors against the truth, settings measured, the front of those worth having."""

from raymarch.cost.search import Found, for_error, for_time

__all__ = ["Found", "for_error", "for_time"]
