"""Generated code of path tracing: one random path per sample."""

from __future__ import annotations

from raymarch.expr.glsl import filled
from raymarch.plan import Plan
from raymarch.scene.bsdf import fresnel_dielectric, sample_rough_dielectric
from raymarch.shader.bsdf import Reflection
from raymarch.shader.chunk import Lines, Values
from raymarch.shader.fog import begin_shade, end_shade
from raymarch.shader.kinds import set_kind
from raymarch.shader.surface import geometric_normal_of, material_arguments, surface_interaction_call


def path_tracing(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """The colour of a hit: a random path over up to n bounces, with direct light at each surface."""
    scene, add, glass = plan.scene, text.add, plan.glass is not None
    shines = bool(scene.lights) and plan.model != "phong"
    begin_shade(text, scene, bounces=True)
    add("    vec3 weight = vec3(1.0);")
    add("    float travelled = 0.0;")
    if shines:
        # Path regularisation (Kaplanyan 2013): highlights on mirrors seen from rough surfaces are too rarely sampled.
        add("    float min_roughness = 0.0;  // smallest roughness for highlights of lights")
    if glass:
        add("    float side = 1.0;  // -1 inside glass")
        add("    vec3 absorption = vec3(0.0);")
        add("    vec3 before = ray.origin;  // previous vertex of the path")
    side = "side" if glass else "1.0"
    add(f"    for (int bounce = 0; bounce <= {scene.bounces}; bounce++) {{")
    add("        travelled += hit.t;")
    call = surface_interaction_call(plan, "ray", "travelled")
    add(f"        Surface surface = {call};")
    add("        surface.t = travelled;")
    if glass:
        add("        if (side < 0.0) weight *= exp(-absorption * distance(before, surface.p));")
        add("        before = surface.p;")
        add("        surface.normal *= side;")
    add("        int dimension = 16 + 8 * bounce;")
    add("        vec3 direction;")
    indent = "        "
    if glass:
        _into_glass(text, plan)
    if shines:
        add(f"{indent}Surface regularized = surface;")
        for name in plan.bsdf.rough:
            add(f"{indent}regularized.material.{name} = max(surface.material.{name}, min_roughness);")
    shaded = "regularized" if shines else "surface"
    if glass and shines:
        add(f"{indent}if (side > 0.0) color += weight * direct_light({shaded}, glass, enters ? 1.0 : 0.0);")
    else:
        add(f"{indent}{'if (!enters) ' if glass else ''}color += weight * direct_light({shaded});")
        if glass and plan.emission is not None:
            add(
                f"{indent}else if (side > 0.0) color += weight * emission_at({material_arguments(plan)});",
            )
    if glass:
        _glass(text, plan, shines, values)
        indent += "    "
    last = f"bounce == {scene.bounces}"
    add(f"{indent}if ({last}) break;")
    for line in filled(f"{indent}BsdfSample found = {reflection.sample()};", indent):
        add(line)
    add(f"{indent}if (found.weight == vec3(0.0)) break;")
    add(f"{indent}weight *= found.weight;")
    add(f"{indent}direction = found.direction;")
    if shines:
        add(f"{indent}float least = surface.material.metalness < 1.0 ? 0.4 : 0.0;")
        add(f"{indent}min_roughness = max(min_roughness, max(surface.material.roughness, least));")
    if glass:
        add("        }")
    add("        float start;")
    solid = geometric_normal_of(plan)
    add(f"        vec3 side_normal = dot(direction, surface.normal) < 0.0 ? -{solid} : {solid};")
    add("        ray = spawn_ray(surface.p, side_normal, direction, travelled, start);")
    for line in set_kind(plan, "reflection", "        "):
        add(line)
    add(f"        hit = trace_secondary(ray, start, travelled, {side});")
    add("        if (!hit.found) {")
    add(f"            {'if (side > 0.0) ' if glass else ''}color += weight * sky(direction);")
    add("            break;")
    add("        }")
    add("    }")
    for line in set_kind(plan, "camera", "    "):  # of the next sample
        add(line)
    end_shade(text, scene, "first")


def _into_glass(text: Lines, plan: Plan) -> None:
    """Whether a path meets the glass or the opaque part of a material, chosen by transmission."""
    text.add(f"        Glass glass = glass_at({material_arguments(plan)});")
    text.add("        bool enters = side < 0.0 || random_of_pixel(dimension + 3) < glass.transmission;")


def _glass(text: Lines, plan: Plan, shines: bool, values: Values) -> None:
    """The next direction of a path that meets glass, up to the opening brace of the other case."""
    frosted = any(material.frosted for material in plan.scene.materials)
    values.functions.append(sample_rough_dielectric if frosted else fresnel_dielectric)
    for line in (
        "if (enters) {",
        f"    if (bounce == {plan.scene.bounces}) {{",  # the sky's radiance, so that glass does not turn black
        "        color += weight * sky(ray.direction);",
        "        break;",
        "    }",
        *(f"    {line}" for line in (FROSTED if frosted else CLEAR)),
        *(["    min_roughness = max(min_roughness, surface.material.roughness);"] if frosted and shines else []),
        "} else {",
    ):
        text.add(f"        {line}")


CLEAR = (
    "float ratio = side > 0.0 ? 1.0 / glass.ior : glass.ior;",
    "float cosine = clamp(dot(surface.normal, surface.view), 0.0, 1.0);",
    "if (random_of_pixel(dimension + 4) < fresnel_dielectric(cosine, ratio)) {",
    "    direction = reflect(ray.direction, surface.normal);",
    "} else {",
    "    direction = refract(ray.direction, surface.normal, ratio);",
    "    side = -side;",
    "    absorption = glass.absorption;",
    "}",
)
"""The next direction at smooth glass."""

FROSTED = (
    "vec2 u = vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2));",
    "float choice = random_of_pixel(dimension + 4);",
    "float roughness = surface.material.roughness;",
    "BsdfSample found =",
    "    sample_rough_dielectric(surface.normal, surface.view, glass.ior, side, roughness, u, choice);",
    "if (found.weight == vec3(0.0)) break;",
    "weight *= found.weight;",
    "direction = found.direction;",
    "if (dot(direction, surface.normal) < 0.0) {",
    "    side = -side;",
    "    absorption = glass.absorption;",
    "}",
)
"""The next direction if some glass is rough."""
