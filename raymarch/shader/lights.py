"""Generated code that adds the light of each source to a surface: unrolled, or in a loop over rows of a texture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.pieces import literal
from raymarch.plan import Plan, lights
from raymarch.scene.light import (
    DIRECTION,
    DIRECTION_SAMPLE,
    FAR,
    POINT,
    SAMPLE,
    Light,
    above_horizon,
    eval_disc,
    part_above_horizon,
    pdf_disc,
    power_heuristic,
    sample_disc,
)
from raymarch.scene.scene import Scene
from raymarch.scene.surfaces import samples_both
from raymarch.shader.bsdf import Reflection
from raymarch.shader.chunk import Chunk, Lines, Mapped, Values
from raymarch.shader.kinds import shadow_function


def all_lights(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """Add the light of all sources to the colour of a surface."""
    table = lights.table(plan.scene)
    points = plan.scene.quality.light_samples
    both = [light for light in plan.scene.lights if lights.samples_of(plan.scene, light) > points]
    for key, form in table.forms.items():
        met = any(lights.key(light) == key for light in both) and form.area
        values.functions += [f for f in (form.function, *((form.met, form.pdf) if met else ())) if f is not None]
    if "sampled" in table.kinds:
        values.functions += [sample_disc, *((eval_disc, pdf_disc) if any(light.soft for light in both) else ())]
    values.functions += [power_heuristic] if both else []
    values.functions += (
        [above_horizon, part_above_horizon] if any(light.cut_by_horizon for light in plan.scene.lights) else []
    )
    if lights.as_data(plan.scene):
        _loop(text, plan, reflection)
        return
    for i, light in enumerate(plan.scene.lights):
        _light(text, i, light, values, plan, reflection)


def _light(text: Lines, i: int, light: Light, values: Values, plan: Plan, reflection: Reflection) -> None:
    """The lines of one light, with its values as literals where constant."""
    by, where = type(light).__name__, light.where

    def value(name: str, of: Expr) -> str:
        return values.text(f"light_{i}_{name}", of, where)

    form = lights.table(plan.scene).forms[lights.key(light)]
    given = [value(name, of) for name, of in light.emitter_values().items()]
    samples, stride = plan.scene.quality.light_samples, 2 * len(plan.scene.lights)
    disc = light.soft and light.penumbra == "sampled"
    width = value("softness", light.disc_width) + _per_distance(light) if disc else ""
    cut = light.cut_by_horizon
    visibility = _visibility(plan, light, value, f"width_{i}" if cut else "")
    both = samples_both(light, plan.scene.materials)
    count = lights.samples_of(plan.scene, light)
    before = plan.occlusion_samples + sum(lights.samples_of(plan.scene, other) for other in plan.scene.lights[:i])
    dimension = f"{_dimension(i)}" + f" + {stride} * {'(k / 2)' if both else 'k'}" * (count > 1)
    sample = _sample(form, given, dimension)
    if count == 1:
        lines = [f"light = {sample};"]
        if disc:
            lines.append(f"light = sample_disc(light, {width}, {_two(dimension)});")
        if cut:
            lines += [
                f"float width_{i} = {value('radius', light.softness)} / light.distance;",
                f"float part_{i} = {_horizon('part_above_horizon', f'width_{i}')};",
                f"light = {_horizon('above_horizon', f'width_{i}')};",
            ]
            visibility = f"part_{i}" if visibility == "1.0" else f"part_{i} * ({visibility})"
        lines.append(f"color += {reflection.light(visibility)};")
        if plan.lights_split:
            lines = [f"if (first <= {before} && end > {before}) {{", *(f"    {line}" for line in lines), "}"]
    else:
        lines = [f"light = {sample};", f"Light centre_{i} = light;"] if disc else []
        width = width.replace("light.", f"centre_{i}.")  # that of each sample is shorter
        lines.append(f"for (int k = 0; k < {count}; k++) {{")
        if plan.lights_split:
            lines += [f"    if ({before} + k >= end) break;", f"    if ({before} + k < first) continue;"]
        drawn = f"sample_disc(centre_{i}, {width}, {_two(dimension)})" if disc else sample
        lines.append(f"    light = {drawn};")
        if both:
            texts = _disc(f"centre_{i}", width) if disc else _met(form, given)
            weighted = _weighted(texts, f"{i * samples} + k / 2", stride * samples, reflection)
            lines += [f"    {line}" for line in weighted]
        lines += [f"    color += {reflection.light(visibility)} / {literal(samples)};", "}"]
    if i == 0:
        lines[:1] = [f"Light {lines[0]}"] if lines[0].startswith("light = ") else ["Light light;", lines[0]]
    text.add(*(f"    {line}" for line in lines), by=by, where=where)


def visible_light(text: Lines, plan: Plan, values: Values) -> None:
    """The function `visible_light`: the radiance of the nearest visible light on a ray that ends at a hit, and in w its
    distance, which is negative if there is none. Nothing in scenes without such lights.

    A light that touches a surface is in front of it: a hit may lie two epsilons before the surface.
    """
    scene, shown = plan.scene, lights.visible(plan.scene)
    if not shown:
        return
    table, by, where = lights.table(scene), "visible=True", shown[0].where
    text.add("vec4 visible_light(Ray ray, Hit hit, float travelled) {", by=by, where=where)
    text.add("    float end = hit.found ? hit.t : 1.0e30;", "    vec4 nearest = vec4(0.0, 0.0, 0.0, -1.0);")
    text.add("    float slack = hit.found ? 2.0 * epsilon(ray.origin + end * ray.direction, travelled + end) : 0.0;")
    text.add("    LightHit met;")
    keep = [
        "if (met.distance > 0.0 && (met.distance - end) * met.cosine < slack) {",
        "    nearest = vec4(met.radiance, met.distance);",
        "    end = met.distance;",
        "    slack = 0.0;",
        "}",
    ]
    if lights.as_data(scene):
        text.add(f"    for (int i = 0; i < {len(scene.lights)}; i++) {{")
        if table.headed:
            text.add(f"        vec4 head = {_texel(plan, 0)};")
        for k, form in enumerate(table.forms.values()):
            if form.ray is not None:
                values.functions.append(form.ray)
                given = [f"{_texel(plan, texel + table.headed)}.{parts}" for texel, parts in lights.layout(form.types)]
                text.add(f"        if (head.x == {float(k)}) {{" if table.headed else "        {", by=by, where=where)
                text.add(f"            met = {_on_ray(form, given)};", *(f"            {line}" for line in keep))
                text.add("        }")
        text.add("    }")
    for i, light in enumerate([] if lights.as_data(scene) else scene.lights):
        form = table.forms[lights.key(light)]
        if form.ray is not None:
            values.functions += [form.ray] * (form.ray not in values.functions)
            given = [values.text(f"light_{i}_{name}", of, light.where) for name, of in light.emitter_values().items()]
            text.add(f"    met = {_on_ray(form, given)};", *(f"    {line}" for line in keep), by=by, where=light.where)
    text.add("    return nearest;", "}", "")


def _on_ray(form: lights.LightForm, values: Sequence[str]) -> str:
    """The call of a form's `ray`."""
    assert form.ray is not None
    given = {POINT: "ray.origin", DIRECTION: "ray.direction"}
    return f"{form.ray.name}({', '.join([*(given[p] for p in form.ray.params if p in given), *values])})"


def _sample(form: lights.LightForm, values: Sequence[str], dimension: str) -> str:
    """The call that samples a light. dimension : the first of two random dimensions, as GLSL text."""
    return _call(form.function, values, _two(dimension))


def _call(function: Function, values: Sequence[str], random: str = "") -> str:
    """The call of a function of a light.

    No point of the scene is farther from the camera than u_far, so no two points are farther apart than twice that.
    """
    texts = {POINT: "surface.p", SAMPLE: random, DIRECTION: "direction", FAR: "2.0 * u_far", DIRECTION_SAMPLE: "light"}
    return f"{function.name}({', '.join([*(texts[p] for p in function.params if p in texts), *values])})"


def _met(form: lights.LightForm, values: Sequence[str]) -> tuple[str, str]:
    """The calls that give the light of a `direction`, and the density of the direction of `light`."""
    assert form.met is not None and form.pdf is not None
    return _call(form.met, values), _call(form.pdf, values)


def _disc(centre: str, width: str) -> tuple[str, str]:
    """The same for the disc of a light."""
    return f"eval_disc({centre}, {width}, direction)", f"pdf_disc({centre}, {width}, light.direction)"


def _weighted(texts: tuple[str, str], number: str, before: int, reflection: Reflection) -> list[str]:
    """The lines that replace each second sample of a light by one of the lobes, and weigh both.

    See `power_heuristic`.

    texts : of `_met` or `_disc`. number : of the sample among those of all lights. before : number of random dimensions
        of the points of lights.
    """
    met, pdf = texts
    return [
        "bool lobe = k % 2 == 1;",
        "if (lobe) {",
        f"    int dimension = {_dimension(0) + before} + 4 * ({number});",
        f"    vec3 direction = {reflection.sample_lobes()};",
        f"    light = {met};",
        "}",
        f"light.radiance *= power_heuristic(lobe, {pdf}, {reflection.pdf_lobes()});",
    ]


def _two(dimension: str) -> str:
    """Two random numbers, as GLSL text."""
    after = str(int(dimension) + 1) if dimension.isdigit() else f"{dimension} + 1"
    return f"vec2(random_of_pixel({dimension}), random_of_pixel({after}))"


def _dimension(light: int) -> int:
    """The first random dimension of a light, beyond those of path tracing."""
    return 1024 + 2 * light


def _per_distance(light: Light) -> str:
    """The factor that makes a light's `disc_width` the sine of an angle."""
    return " / light.distance" if light.has_position else ""


def _horizon(function: str, width: str) -> str:
    """The call of `above_horizon` or `part_above_horizon`."""
    return f"{function}(light, {width}, surface.normal)"


def _upright(width: str) -> str:
    """The width of the part of a sphere above the horizon, after `above_horizon`."""
    return f"min({width}, dot(surface.normal, light.direction))"


def _visibility(plan: Plan, light: Light, value: Callable[[str, Expr], str], cut: str) -> str:
    """The visibility of a light from the surface, as GLSL text. cut : the width of a sphere that a horizon may cut."""
    shadow = lights.shadow_of(light)
    if shadow is None:
        return "1.0"
    width = ""
    if shadow not in ("hard", "sampled"):
        width = f", {_upright(cut) if cut else value('softness', light.disc_width) + _per_distance(light)}"
    shown = f"{shadow_function(plan, shadow)}(surface, light{width})"
    radius = getattr(light, "shadow_radius", None)
    return shown if radius is None else f"light.distance < {value('shadow_radius', radius)} ? {shown} : 1.0"


def _loop(text: Lines, plan: Plan, reflection: Reflection) -> None:
    """The loop over all lights, which reads their values from the rows of a texture."""
    scene, table = plan.scene, lights.table(plan.scene)
    kinds, head, samples = table.kinds, table.headed, plan.scene.quality.light_samples

    def add(line: str) -> None:
        text.add(f"        {line}", where=scene.where)

    split, places = plan.lights_split, lights.stride(scene)
    ending = split or plan.lights_in_cells
    if ending:
        if plan.lights_in_cells:
            text.add("    ivec2 reached = lights_at(surface.p);  // start and length of a list", where=scene.where)
        most = "reached.y" if plan.lights_in_cells else str(len(scene.lights)) * split
        begin = "n"
        if split:
            after = f" - {plan.occlusion_samples}" * (plan.occlusion_samples > 0)
            text.add(
                f"    int begin = max(first{after}, 0);  // samples of lights: the first, and the one after the last"
            )
            text.add(f"    int last = min(end{after}, {f'{places} * ' * (places > 1)}{most});")
            begin = f"begin / {places} + n" if places > 1 else "begin + n"
        text.add(f"    for (int n = 0; n < {len(scene.lights)}; n++) {{")
        end = "last" if split else most
        at = f"({begin}) * {places}" if split and places > 1 else begin
        add(f"if ({at} >= {end}) break;")
        # llvmpipe leaves a loop at the end of a turn only, so the last turn must say that it is the last
        add(f"bool ends = {at} + {places if split else 1} >= {end};")
        if split and places > 1:
            add(f"int place = ({begin}) * {places};  // its first sample")
        add(f"int i = light_of(reached.x + {begin});" if plan.lights_in_cells else f"int i = {begin};")
    else:
        text.add(f"    for (int i = 0; i < {len(scene.lights)}; i++) {{")
    if head:
        add(f"vec4 head = {_texel(plan, 0)};  // form, kind of shadow, softness, shadow radius")
    for k in range(table.texels - head):
        add(f"vec4 value_{k} = {_texel(plan, k + head)};")
    add("Light light;")
    limited = any(getattr(light, "shadow_radius", None) is not None for light in scene.lights)
    near = "(head.w == 0.0 || light.distance < head.w) && " if limited else ""
    first, stride = f"{_dimension(0)} + 2 * i", 2 * len(scene.lights)

    def several(condition: str, sample: str, shown: str, of: Light, texts: Callable[[], tuple[str, str]]) -> None:
        """The mean of several samples of the lights of a condition, of which one is given."""
        add(f"if ({condition}) {{")
        add(f"    for (int k = 0; k < {lights.samples_of(scene, of)}; k++) {{")
        if split:
            add("        if (place + k >= last) break;")
            add("        if (place + k < begin) continue;")
        add(f"        light = {sample};")
        if samples_both(of, scene.materials):
            for line in _weighted(texts(), f"{samples} * i + k / 2", stride * samples, reflection):
                add(f"        {line}")
        add(f"        color += {reflection.light(shown)} / {literal(samples)};")
        add("    }")
        add("    continue;")
        add("}")

    def dimension(of: Light) -> str:
        """The first random dimension of sample k of a light."""
        return f"{first} + {stride} * {'(k / 2)' if samples_both(of, scene.materials) else 'k'}"

    hard, traced = "1.0", shadow_function(plan, "hard")
    if "hard" in kinds:
        hard = f"{near}head.y == {float(kinds.index('hard') + 1)} ? {traced}(surface, light) : 1.0"
    rest = []
    for k, (key, form) in enumerate(table.forms.items()):
        values = [f"value_{texel}.{parts}" for texel, parts in lights.layout(form.types)]
        of = next(light for light in scene.lights if lights.key(light) == key)
        if form.area and lights.samples_of(scene, of) > 1:
            calls = partial(_met, form, values)
            several(f"head.x == {float(k)}", _sample(form, values, dimension(of)), hard, of, calls)
        else:
            rest.append((k, _sample(form, values, first)))
    for k, sample in rest:
        condition = f"if (head.x == {float(k)}) " if k != rest[-1][0] else ""
        add(f"{'else ' if k != rest[0][0] else ''}{condition}light = {sample};")
    if rest:
        if split and places > 1:  # the only sample of a light may have been added before
            other = f"head.y != {float(kinds.index('sampled') + 1)} && " if "sampled" in kinds else ""
            add(f"if ({other}place < begin) continue;")
        if ending:
            add("if (ends && light.radiance == vec3(0.0)) break;")
        add("if (light.radiance == vec3(0.0)) continue;")
        balls = [f"head.x == {float(k)}" for k, of in enumerate(table.forms) if _has_balls(scene, of)]
        visibility = "visibility" if kinds or balls else "1.0"
        if kinds or balls:
            add("float visibility = 1.0;")
        width = _width_of_row(scene)
        if balls:
            width = "width"
            add(f"float width = {_width_of_row(scene)};")
            sampled = f" && head.y != {float(kinds.index('sampled') + 1)}" if "sampled" in kinds else ""
            add(f"bool cut = {' || '.join(balls)};" if not sampled else f"bool cut = ({' || '.join(balls)}){sampled};")
            add(f"float part = cut ? {_horizon('part_above_horizon', 'width')} : 1.0;")
            add(f"if (cut) light = {_horizon('above_horizon', 'width')};")
            add(f"if (cut) width = {_upright('width')};")
        for number, kind in enumerate(kinds, 1):
            condition = f"head.y == {float(number)}"
            of = next(light for light in scene.lights if lights.shadow_of(light) == kind)
            if kind == "sampled" and lights.samples_of(scene, of) > 1:
                add("Light centre = light;")
                width = width.replace("light.", "centre.")
                shown = f"{near.removesuffix(' && ')} ? {traced}(surface, light) : 1.0"
                sample = f"sample_disc(centre, {width}, {_two(dimension(of))})"
                shown = shown if near else f"{traced}(surface, light)"
                several(condition, sample, shown, of, partial(_disc, "centre", width))
                continue
            if kind == "sampled":
                add(f"if ({condition}) light = sample_disc(light, {width}, {_two(first)});")
            given = "" if kind in ("hard", "sampled") else f", {width}"
            add(f"if ({near}{condition}) visibility = {shadow_function(plan, kind)}(surface, light{given});")
        add(f"color += {reflection.light(f'part * {visibility}' if balls else visibility)};")
    if ending:
        add("if (ends) break;")
    text.add("    }")


def _has_balls(scene: Scene, form: lights.Key) -> bool:
    """True if a horizon may cut lights of a form."""
    return any(light.cut_by_horizon for light in scene.lights if lights.key(light) == form)


def _width_of_row(scene: Scene) -> str:
    """The width of a row's disc. That of a light with a position is a radius, and is divided by the distance."""
    positioned = {lights.key(light): light.has_position for light in scene.lights}
    far = [f"head.x == {float(k)}" for k, of in enumerate(lights.table(scene).forms) if not positioned[of]]
    if not far:
        return "head.z / light.distance"
    return "head.z" if len(far) == len(positioned) else f"head.z / ({' || '.join(far)} ? 1.0 : light.distance)"


def _texel(plan: Plan, k: int) -> str:
    """Texel k of the row of light i."""
    return f"light_texel({k}, i)" if plan.standalone else f"texelFetch(u_lights, ivec2({k}, i), 0)"


def light_rows(plan: Plan, constant: bool = False) -> Chunk:
    """The texture with the values of all lights. constant : an array is declared in its place."""
    by = "the scene's lights"
    lines = [Mapped.declare("sampler2D", "u_lights", by, note="one row per light")]
    if plan.standalone:
        read = f"u_lights[light * {lights.table(plan.scene).texels} + texel]"
        read = read if constant else "texelFetch(u_lights, ivec2(texel, light), 0)"
        body = ["vec4 light_texel(int texel, int light) {", f"    return {read};", "}"]
        lines += [Mapped(line, by) for line in ["", *body]]
    return Chunk.of("light rows", lines)
