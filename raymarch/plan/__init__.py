"""What this scene calls for: facts, features, passes and modules, each with its reason."""

from raymarch.plan import explain, lights
from raymarch.plan.feature import Feature
from raymarch.plan.plan import OUTPUTS, Pass, Plan, plan

__all__ = ["OUTPUTS", "Feature", "Pass", "Plan", "explain", "lights", "plan"]
