"""Cost of accuracy: errors against the reference, measured settings, the Pareto front."""

from raymarch.cost.compare import compare
from raymarch.cost.errors import Errors
from raymarch.cost.ray import RaySamples, plot_ray, ray_samples
from raymarch.cost.search import Found, for_error, for_time

__all__ = ["Errors", "Found", "RaySamples", "compare", "for_error", "for_time", "plot_ray", "ray_samples"]
