"""Generated code of shading: the colour of a hit from emission, sky, lights and fog."""

from __future__ import annotations

from raymarch.expr.function import Function
from raymarch.expr.node import var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import get
from raymarch.plan import Plan, lights
from raymarch.plan.shading import ambient, ambient_sky, occluded, patterned
from raymarch.scene.ambient_occlusion import NORMAL, POINT
from raymarch.shader.bounces import path_tracing, tree
from raymarch.shader.bsdf import Reflection
from raymarch.shader.chunk import Chunk, Lines, Mapped, Values
from raymarch.shader.fog import begin_shade, end_shade, sky_functions
from raymarch.shader.kinds import as_occlusion
from raymarch.shader.lights import all_lights, all_shadows
from raymarch.shader.surface import material_arguments, visible_side


def shading(plan: Plan, values: Values) -> Chunk:
    """The function `shade`: emission, ambient light, each light with its shadow if it casts one, then fog.

    values : collects the scene's values that the code reads by name.
    """
    scene = plan.scene
    text = Lines("the scene's lights")
    if plan.material is not None and (scene.path_traced or scene.whitted):
        reflection = Reflection(plan, values)
        _lit(text, plan, values, reflection)
        if scene.path_traced:
            path_tracing(text, plan, values, reflection)
        else:
            tree(text, plan, values, reflection)
        return _chunk(text, plan, values)
    if plan.lights_split:
        _split(text, plan, values)
        return _chunk(text, plan, values)
    begin_shade(text, plan, values)
    needs_surface = plan.material is not None
    if needs_surface:
        text.add("    Surface surface = surface_interaction(ray, hit, hit.t);", *visible_side(plan, "ray"))
    if plan.emission is not None:
        place = material_arguments(plan) if needs_surface and patterned(scene) else "ray.origin + hit.t * ray.direction"
        text.add(f"    vec3 color = emission_at({place});")
    else:
        text.add("    vec3 color = vec3(0.0);")
    if needs_surface:
        reflection = Reflection(plan, values)
        all_shadows(text, plan, values, reflection)
        _ambient(text, plan, values, reflection)
        if scene.lights:
            text.add(*(f"    {line}" for line in reflection.new_roughness if ambient_sky(scene)))
            all_lights(text, plan, values, reflection)
    end_shade(text, scene, "hit.t", "ray.origin", "ray.direction")
    return _chunk(text, plan, values)


def _split(text: Lines, plan: Plan, values: Values) -> None:
    """The functions `keep_surface` and `kept_hit` of surfaces in textures, `add_light`, which adds some samples of
    light to those of earlier passes, and `shade`, which reads the sum.

    In GLSL, `first` and `end` are the first sample and the one after the last: those of ambient occlusion come first.
    `before` is the sum so far, and in alpha the ambient visibility, or what its samples so far have found missing.
    """
    scene, reflection, samples = plan.scene, Reflection(plan, values), plan.occlusion_samples
    texels = _keep_surface(text, plan)
    text.add("vec4 add_light(Ray ray, vec4 before, int first, int end) {")
    text.add(*texels)
    if ambient_sky(scene) or scene.lights:
        text.add(*reflection.prepare(), by="a metal")
    emitted = "emitted" if plan.emission is not None else "vec3(0.0)"
    text.add("    vec3 color = before.rgb;", "    float ambient_visibility = before.a;")
    text.add(f"    if (first == 0) color = {emitted};")
    if samples:
        _occlusion_samples(text, plan, values)
        text.add(f"    if (first < {samples} && end >= {samples}) {{")
    else:
        text.add("    if (first == 0) {")
        given = "surface.ambient_visibility" if _occluded_by_map(plan) else "1.0"
        text.add(f"        ambient_visibility = {given};")
    _sky(text, plan, reflection, "        ")
    text.add("    }")
    _dim(text, plan)
    if scene.lights:
        all_lights(text, plan, values, reflection)
    text.add("    return vec4(color, ambient_visibility);", "}", "")
    begin_shade(text, plan, values)
    text.add("    vec3 color = lit().rgb;")
    end_shade(text, scene, "hit.t", "ray.origin", "ray.direction")


MISS = "-1.0e30"
"""The distance that is kept for a ray that hits nothing."""


def _keep_surface(text: Lines, plan: Plan) -> list[str]:
    """The functions that write surfaces to textures and read the hits from them.

    Returns the lines that read what `Plan.kept_surface` states into `surface` and other variables.
    """
    kept = plan.kept_surface
    places = lights.layout([type for _, type in kept])
    count = 1 + max(k for k, _ in places)
    stored = [(name, type, k, parts) for (name, type), (k, parts) in zip(kept, places, strict=True)]
    text.lines += [Mapped.declare("sampler2D", f"u_surface_{k}", text.made_by) for k in range(count)]
    text.add("")
    text.add(f"void keep_surface(Ray ray, Hit hit, out vec4 kept[{count}]) {{")
    text.add(f"    kept[0] = vec4(0.0, 0.0, 0.0, {MISS});", *(f"    kept[{k}] = vec4(0.0);" for k in range(1, count)))
    text.add("    if (!hit.found) return;")
    text.add("    Surface surface = surface_interaction(ray, hit, hit.t);", *visible_side(plan, "ray"))
    if plan.emission is not None:
        text.add(f"    vec3 emitted = emission_at({material_arguments(plan)});")
    text.add(*(f"    kept[{k}].{parts} = {name};" for name, _, k, parts in stored), "}", "")
    text.add("Hit kept_hit() {", "    Hit hit = no_hit(texelFetch(u_surface_0, ivec2(gl_FragCoord.xy), 0).w);")
    text.add(f"    hit.found = hit.t > {MISS};", "    return hit;", "}", "")
    return [
        *(f"    vec4 kept_{k} = texelFetch(u_surface_{k}, ivec2(gl_FragCoord.xy), 0);" for k in range(count)),
        *(f"    if (kept_0.w == {MISS}) return vec4(0.0);", "    Surface surface;"),
        *(f"    {f'{of} ' * (name == 'emitted')}{name} = kept_{k}.{parts};" for name, of, k, parts in stored),
        *("    surface.p = ray.origin + surface.t * ray.direction;", "    surface.view = -ray.direction;"),
    ]


def _occlusion_samples(text: Lines, plan: Plan, values: Values) -> None:
    """The loop over some samples of ambient occlusion."""
    scene, samples = plan.scene, plan.occlusion_samples
    occlusion = scene.ambient_occlusion
    assert occlusion is not None
    i, missing = var("i", FLOAT), var("missing", FLOAT)
    sample = occlusion.sample(plan.undivided or plan.field, var("u_side", FLOAT), i)
    values.variables.add("u_side")
    values.functions.append(Function("occlusion_sample", (POINT, NORMAL, i), sample, where=scene.where))
    remaining = occlusion.remaining(missing)
    values.functions.append(Function("ambient_visibility_of", (missing,), remaining, where=scene.where))
    decay = values.text("occlusion_decay", occlusion.decay, scene.where)
    share = "surface.ambient_visibility * " if _occluded_by_map(plan) else ""
    begin, end = as_occlusion(plan, "        ")
    text.add(
        f"    if (first < {samples}) {{",
        "        float missing = first == 0 ? 0.0 : ambient_visibility;",
        "        float weight = 1.0;",
        *begin,
        f"        for (int i = 0; i < {samples}; i++) {{",
        "            if (i >= end) break;",
        "            if (i >= first) missing += weight * occlusion_sample(surface.p, surface.normal, float(i));",
        f"            weight *= {decay};",
        "        }",
        *end,
        f"        ambient_visibility = end < {samples} ? missing : {share}ambient_visibility_of(missing);",
        "    }",
        by="Scene(occlusion=...)",
        where=scene.where,
    )


def _lit(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """The function `direct_light`: emission, ambient light and lights at one vertex of a path or ray tree.

    In GLSL, `traced` is the fraction of each lobe that secondary rays trace. `transmission` is the fraction of
    the surface that is glass; glass reflects lights too.
    """
    traced = f", {reflection.per_lobe} traced" if plan.scene.whitted else ""
    dielectric = plan.glass is not None and bool(plan.scene.lights)
    glass = ", Glass glass, float transmission" if dielectric else ""
    text.add(f"vec3 direct_light(Surface surface{traced}{glass}) {{")
    text.add(
        f"    vec3 color = {f'emission_at({material_arguments(plan)})' if plan.emission is not None else 'vec3(0.0)'};"
    )
    all_shadows(text, plan, values, reflection)
    _ambient(text, plan, values, reflection)
    if plan.scene.lights and ambient_sky(plan.scene):
        text.add(*(f"    {line}" for line in reflection.new_roughness))
    if dielectric:
        kept = f" + transmission * emission_at({material_arguments(plan)})" if plan.emission is not None else ""
        text.add(f"    color = (1.0 - transmission) * color{kept};")
        share = "transmission"
        if plan.model == "mixed":  # the Phong part keeps its colour
            share = "share"
            text.add("    surface.material.physical = mix(surface.material.physical, 1.0, transmission);")
            text.add("    float share = transmission / max(surface.material.physical, 1.0e-6);")
        for name in reflection.prepared:
            text.add(f"    {name} *= 1.0 - {share};")
        changed = "Material outside" if plan.model == "mixed" else "surface.material"
        text.add(f"    {changed} = {reflection.over_dielectric(share)};")
    if plan.scene.lights:
        all_lights(text, plan, values, reflection)
    text.add("    return color;", "}", "")


def _chunk(text: Lines, plan: Plan, values: Values) -> Chunk:
    """The chunk of these lines. Adds the functions of sky and fog that they call."""
    values.functions += sky_functions(plan)
    values.variables |= {"u_sky_light"} if plan.sky_light else set()
    return text.chunk("shade")


def _ambient(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """Ambient light: that of the sky, and ambient visibility for the ambient term of Phong materials."""
    scene = plan.scene
    if ambient_sky(scene) or scene.lights:
        text.add(*reflection.prepare(), by="a metal")
    _visibility(text, plan, values)
    _dim(text, plan)
    _sky(text, plan, reflection, "    ")


def _visibility(text: Lines, plan: Plan, values: Values) -> None:
    """The line that sets `ambient_visibility`, if it is not 1."""
    scene, shares = plan.scene, _occluded_by_map(plan)
    by = "Material(occlusion=...)" if shares else "Scene(occlusion=...)"
    if occluded(scene, plan.model):
        occlusion = scene.ambient_occlusion
        assert occlusion is not None
        visibility = occlusion.visibility(plan.undivided or plan.field, var("u_side", FLOAT))
        values.variables.add("u_side")
        values.functions.append(Function("ambient_occlusion", (POINT, NORMAL), visibility, where=scene.where))
        share = "surface.ambient_visibility * " if shares else ""
        call = f"    float ambient_visibility = {share}ambient_occlusion(surface.p, surface.normal);"
        begin, end = as_occlusion(plan, "    ")
        text.add(*begin, call, *end, by=by, where=scene.where)
    elif shares:
        text.add("    float ambient_visibility = surface.ambient_visibility;", by=by, where=scene.where)


def _dim(text: Lines, plan: Plan) -> None:
    """The line that dims the ambient term of Phong materials."""
    scene, shares = plan.scene, _occluded_by_map(plan)
    if (shares or occluded(scene, plan.model)) and scene.lights and plan.model != "physical":
        by = "Material(occlusion=...)" if shares else "Scene(occlusion=...)"
        text.add("    surface.material.ambient *= ambient_visibility;", by=by, where=scene.where)


def _sky(text: Lines, plan: Plan, reflection: Reflection, indent: str) -> None:
    """The line that adds the sky's light."""
    scene = plan.scene
    if ambient_sky(scene):
        dimmed = _occluded_by_map(plan) or occluded(scene, plan.model)
        factor = "ambient_visibility * " if dimmed else ""
        light = reflection.sky("traced" if scene.whitted else "")
        text.add(f"{indent}color += {factor}{light};", by="the sky's light", where=scene.where)


def _occluded_by_map(plan: Plan) -> bool:
    """True if the scene has ambient light and some material has an occlusion value or map."""
    if plan.relief is None or not ambient(plan.scene, plan.model):
        return False
    share = get(plan.relief.body, "ambient_visibility")
    return not (share.is_constant and float(share.data) == 1.0)
