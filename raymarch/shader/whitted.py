"""Generated code of Whitted ray tracing: both the reflected and the refracted ray are traced, without randomness.

After the bounded ray tree of Huang, Chen and Cheng, "Signed Distance Field in Real-time Rendering" (2020), section 11:
GLSL has no recursion, so rays wait in an array (a stack) until they are traced. The newest is traced first, so at most
one ray waits for each surface on the current path.
"""

from __future__ import annotations

import numpy as np

from raymarch.expr.glsl import constant
from raymarch.expr.node import const
from raymarch.plan import Plan
from raymarch.scene.bsdf import fresnel_dielectric
from raymarch.scene.material import SMOOTH
from raymarch.shader.bsdf import Reflection
from raymarch.shader.chunk import Lines, Values
from raymarch.shader.fog import begin_shade, end_shade
from raymarch.shader.kinds import set_kind
from raymarch.shader.surface import geometric_normal_of, material_arguments, surface_interaction_call


def tree(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """The colour of a hit: direct light, and the light of reflected and refracted rays over up to n bounces."""
    mirrors = any(m.mirrors for m in plan.scene.materials)
    begin_shade(text, plan.scene, bounces=True)
    if plan.glass is not None:
        values.functions.append(fresnel_dielectric)
        _branches(text, plan, mirrors, reflection)
    else:
        _chain(text, plan, reflection)
    for line in set_kind(plan, "camera", "    "):  # of the next sample
        text.add(line)
    end_shade(text, plan.scene, "first")


def _chain(text: Lines, plan: Plan, reflection: Reflection) -> None:
    """The ray without glass: a single chain from mirror to mirror."""
    surface = surface_interaction_call(plan, "ray", "travelled")
    solid, none = geometric_normal_of(plan), constant(const(np.zeros(reflection.per_lobe.shape)))
    for line in (
        "vec3 weight = vec3(1.0);",
        "float travelled = 0.0;",
        f"for (int bounce = 0; bounce <= {plan.scene.bounces}; bounce++) {{",
        "    travelled += hit.t;",
        f"    Surface surface = {surface};",
        "    surface.t = travelled;",
        f"    {reflection.per_lobe} traced = bounce < {plan.scene.bounces} ? {reflection.traced()} : {none};",
        f"    vec3 reflection = {reflection.mirrored()};",
        *_regularized(plan, "    ", "bounce"),
        "    color += weight * direct_light(surface, traced);",
        "    weight *= reflection;",
        "    if (below_cutoff(weight)) break;",
        "    vec3 direction = reflect(ray.direction, surface.normal);",
        "    float start;",
        f"    ray = spawn_ray(surface.p, {solid}, direction, travelled, start);",
        *set_kind(plan, "reflection", "    "),
        "    hit = trace_secondary(ray, start, travelled, 1.0);",
        "    if (!hit.found) {",
        "        color += weight * sky(ray.direction);",
        "        break;",
        "    }",
        "}",
    ):
        text.add(f"    {line}")


def _branches(text: Lines, plan: Plan, mirrors: bool, reflection: Reflection) -> None:
    """All rays of the tree, the newest first."""
    deepest = plan.scene.bounces
    surface = surface_interaction_call(plan, "at.ray", "at.travelled")
    for line in (
        f"Branch waiting[{deepest + 1}];",
        "int count = 0;",
        "Branch at = Branch(ray, 0.0, vec3(1.0), vec3(0.0), 0.0, 1.0, 0);",
        f"for (int i = 0; i < {2 ** (deepest + 1) - 1}; i++) {{",
        "    if (i > 0) {",
        "        if (count == 0) break;",
        "        at = waiting[--count];",
        *set_kind(plan, "reflection", "        "),
        "        hit = trace_secondary(at.ray, at.start, at.travelled, at.side);",
        "        if (!hit.found) {",
        "            if (at.side > 0.0) color += at.weight * sky(at.ray.direction);",
        "            continue;",
        "        }",
        "    }",
        "    at.travelled += hit.t;",
        "    if (at.side < 0.0) at.weight *= exp(-hit.t * at.absorption);",
        f"    Surface surface = {surface};",
        "    surface.t = at.travelled;",
        "    surface.normal *= at.side;",
        f"    Glass glass = glass_at({material_arguments(plan)});",
        "    float transmission = at.side < 0.0 ? 1.0 : glass.transmission;",
    ):
        text.add(f"    {line}")
    none = constant(const(np.zeros(reflection.per_lobe.shape)))
    traced = f"at.bounce < {deepest} ? {reflection.traced()} : {none}" if mirrors else none
    text.add(f"        {reflection.per_lobe} traced = {traced};")
    if mirrors:
        text.add(f"        vec3 reflection = {reflection.mirrored()};")
    for line in _regularized(plan, "        ", "at.bounce"):
        text.add(line)
    if plan.scene.lights:
        text.add("        if (at.side > 0.0) color += at.weight * direct_light(surface, traced, glass, transmission);")
    else:
        line = "if (transmission < 1.0) color += (1.0 - transmission) * at.weight * direct_light(surface, traced);"
        text.add(f"        {line}")
        if plan.emission is not None:
            own = f"emission_at({material_arguments(plan)})"
            text.add(f"        if (at.side > 0.0) color += transmission * at.weight * {own};")
    # Rays that are still inside glass at the last bounce return the sky's radiance, so that they do not turn black.
    text.add(f"        if (at.bounce == {deepest}) {{")
    text.add("            color += transmission * at.weight * sky(at.ray.direction);")
    text.add("            continue;")
    text.add("        }")
    _split(text, plan, mirrors)
    text.add("    }")


def _split(text: Lines, plan: Plan, mirrors: bool) -> None:
    """The reflected and the refracted ray at glass. If one is below the cutoff, the other takes its weight."""
    solid = geometric_normal_of(plan)
    text.add("        float ratio = at.side > 0.0 ? 1.0 / glass.ior : glass.ior;")
    text.add(
        "        float reflectance = fresnel_dielectric(clamp(dot(surface.normal, surface.view), 0.0, 1.0), ratio);"
    )
    text.add("        if (below_cutoff(reflectance * at.weight)) reflectance = 0.0;")
    text.add("        if (below_cutoff((1.0 - reflectance) * at.weight)) reflectance = 1.0;")
    text.add("        vec3 reflected = (transmission * reflectance) * at.weight;")
    if mirrors:
        text.add("        reflected += (1.0 - transmission) * at.weight * reflection;")
    for line in (
        "vec3 refracted = (transmission * (1.0 - reflectance)) * at.weight;",
        "at.bounce++;",
        "float start;",
        "if (!below_cutoff(reflected)) {",
        "    vec3 direction = reflect(at.ray.direction, surface.normal);",
        f"    Ray next = spawn_ray(surface.p, {solid}, direction, at.travelled, start);",
        "    waiting[count++] = Branch(next, start, reflected, at.absorption, at.travelled, at.side, at.bounce);",
        "}",
        "if (!below_cutoff(refracted)) {",
        "    vec3 direction = refract(at.ray.direction, surface.normal, ratio);",
        f"    Ray next = spawn_ray(surface.p, -{solid}, direction, at.travelled, start);",
        "    waiting[count++] = Branch(next, start, refracted, glass.absorption, at.travelled, -at.side, at.bounce);",
        "}",
    ):
        text.add(f"        {line}")


def _regularized(plan: Plan, indent: str, bounce: str) -> list[str]:
    """A light reflected by two mirrors would be a highlight far below a pixel. A larger roughness widens it."""
    if not plan.scene.lights or plan.model == "phong":
        return []
    rough = [f"surface.material.{name}" for name in plan.bsdf.rough]
    return [f"{indent}if ({bounce} > 0) {name} = max({name}, {2.0 * SMOOTH});" for name in rough]
