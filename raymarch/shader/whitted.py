"""The generated part of shading where both ways of the light are followed, mirrored and bent, without chance.

After the bounded ray tree of Huang, Chen and Cheng, "Signed Distance Field in Real-time Rendering" (2020), section 11:
GLSL has no recursion, so that ways wait in an array until they are followed. The newest is followed first, so that no
more than one way waits for each surface on the present one.
"""

from __future__ import annotations

from raymarch.plan import Plan
from raymarch.scene.material import SMOOTH
from raymarch.shader.chunk import Lines
from raymarch.shader.surface import normal_of, place_of, surface_of


def tree(text: Lines, plan: Plan) -> None:
    """The colour of a hit: what it is lit by, and what its mirrored and bent ways bring from up to n more surfaces."""
    mirrors = any(m.mirrors for m in plan.scene.materials)
    text.add("vec3 shade(Ray ray, Hit hit) {", "sky", "trace_secondary", "spawn_ray", "below_cutoff")
    text.add("    vec3 color = vec3(0.0);")
    text.add("    float first = hit.t;")
    if plan.glass is not None:
        _branches(text, plan, mirrors)
    else:
        _chain(text, plan)
    if plan.scene.fog is not None:
        text.add("    color = apply_fog(color, first);", "apply_fog", by="Scene(fog=...)", where=plan.scene.where)
    text.add("    return color;")
    text.add("}")


def _chain(text: Lines, plan: Plan) -> None:
    """The ways where nothing is bent: one, from mirror to mirror."""
    surface, name = surface_of(plan, "ray", "travelled")
    solid, needs = normal_of(plan)
    for line in (
        "vec3 weight = vec3(1.0);",
        "float travelled = 0.0;",
        f"for (int bounce = 0; bounce <= {plan.scene.bounces}; bounce++) {{",
        "    travelled += hit.t;",
        f"    Surface surface = {surface};",
        "    surface.t = travelled;",
        f"    float followed = bounce < {plan.scene.bounces} ? mirror_weight(surface.material) : 0.0;",
        f"    vec3 onwards = {_share(plan)} * mirror_reflectance(surface);",
        *_dulled(plan, "    ", "bounce"),
        "    color += weight * direct_light(surface, followed);",
        "    weight *= onwards;",
        "    if (below_cutoff(weight)) break;",
        "    vec3 away = reflect(ray.direction, surface.normal);",
        "    float start;",
        f"    ray = spawn_ray(surface.p, {solid}, away, travelled, start);",
        "    hit = trace_secondary(ray, start, travelled, 1.0);",
        "    if (!hit.found) {",
        "        color += weight * sky(ray.direction);",
        "        break;",
        "    }",
        "}",
    ):
        text.add(f"    {line}", name, *needs, "mirror_weight", "mirror_reflectance")


def _branches(text: Lines, plan: Plan, mirrors: bool) -> None:
    """All ways, the newest first."""
    deepest = plan.scene.bounces
    surface, name = surface_of(plan, "at.ray", "at.travelled")
    for line in (
        f"Branch waiting[{deepest + 1}];",
        "int count = 0;",
        "Branch at = Branch(ray, 0.0, vec3(1.0), vec3(0.0), 0.0, 1.0, 0);",
        f"for (int i = 0; i < {2 ** (deepest + 1) - 1}; i++) {{",
        "    if (i > 0) {",
        "        if (count == 0) break;",
        "        at = waiting[--count];",
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
        f"    Glass glass = glass_at({place_of(plan)});",
        "    float through = at.side < 0.0 ? 1.0 : glass.transmission;",
    ):
        text.add(f"    {line}", name, "Branch", "Glass", "glass_at", "fresnel_dielectric")
    followed = f"at.bounce < {deepest} ? mirror_weight(surface.material) : 0.0" if mirrors else "0.0"
    text.add(f"        float followed = {followed};", *({"mirror_weight"} if mirrors else ()))
    if mirrors:
        text.add(f"        vec3 onwards = {_share(plan)} * mirror_reflectance(surface);", "mirror_reflectance")
    for line in _dulled(plan, "        ", "at.bounce"):
        text.add(line)
    if plan.scene.lights:
        text.add("        if (at.side > 0.0) color += at.weight * direct_light(surface, followed, glass, through);")
    else:
        text.add("        if (through < 1.0) color += (1.0 - through) * at.weight * direct_light(surface, followed);")
        if plan.emission is not None:
            own = f"emission_at({place_of(plan)})"
            text.add(f"        if (at.side > 0.0) color += through * at.weight * {own};", "emission_at")
    # What would still come is taken for the sky, lest the ways that glass keeps within end in black.
    text.add(f"        if (at.bounce == {deepest}) {{")
    text.add("            color += through * at.weight * sky(at.ray.direction);")
    text.add("            continue;")
    text.add("        }")
    _parted(text, plan, mirrors)
    text.add("    }")


def _parted(text: Lines, plan: Plan, mirrors: bool) -> None:
    """The two ways that go on from a surface of glass. One that is faint leaves its share to the other."""
    solid, needs = normal_of(plan)
    text.add("        float ratio = at.side > 0.0 ? 1.0 / glass.ior : glass.ior;")
    text.add("        float back = fresnel_dielectric(clamp(dot(surface.normal, surface.view), 0.0, 1.0), ratio);")
    text.add("        if (below_cutoff(back * at.weight)) back = 0.0;")
    text.add("        if (below_cutoff((1.0 - back) * at.weight)) back = 1.0;")
    text.add("        vec3 mirrored = (through * back) * at.weight;", *needs)
    if mirrors:
        text.add("        mirrored += (1.0 - through) * at.weight * onwards;")
    for line in (
        "vec3 bent = (through * (1.0 - back)) * at.weight;",
        "at.bounce++;",
        "float start;",
        "if (!below_cutoff(mirrored)) {",
        "    vec3 away = reflect(at.ray.direction, surface.normal);",
        f"    Ray next = spawn_ray(surface.p, {solid}, away, at.travelled, start);",
        "    waiting[count++] = Branch(next, start, mirrored, at.absorption, at.travelled, at.side, at.bounce);",
        "}",
        "if (!below_cutoff(bent)) {",
        "    vec3 away = refract(at.ray.direction, surface.normal, ratio);",
        f"    Ray next = spawn_ray(surface.p, -{solid}, away, at.travelled, start);",
        "    waiting[count++] = Branch(next, start, bent, glass.absorption, at.travelled, -at.side, at.bounce);",
        "}",
    ):
        text.add(f"        {line}")


def _dulled(plan: Plan, indent: str, bounce: str) -> list[str]:
    """Seen in a mirror, a light in another one would be a speck far below a pixel; it is spread a little."""
    if not plan.scene.lights or plan.model == "phong":
        return []
    rough = "surface.material.roughness"
    return [f"{indent}if ({bounce} > 0) {rough} = max({rough}, {2.0 * SMOOTH});"]


def _share(plan: Plan) -> str:
    """The share of a surface whose reflection is followed."""
    return "followed * surface.material.physical" if plan.model == "mixed" else "followed"
