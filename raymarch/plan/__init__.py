"""The plan of a scene: its facts, features, passes and GLSL modules, each with a reason."""

from raymarch.plan import explain, lights, marching
from raymarch.plan.passes import OUTPUTS, Pass
from raymarch.plan.plan import Plan, marched_otherwise, plan, relit
from raymarch.plan.shading import Feature

__all__ = ["OUTPUTS", "Feature", "Pass", "Plan", "explain", "lights", "marched_otherwise", "marching", "plan", "relit"]
