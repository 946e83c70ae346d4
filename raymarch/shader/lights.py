"""Generated code that adds the light of each source to a surface: unrolled, or in a loop over rows of a texture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from raymarch.expr.branches import UNSEEN
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.pieces import literal
from raymarch.plan import Plan, lights
from raymarch.plan.shading import ambient_sky
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
from raymarch.shader.chunk import Lines, Values
from raymarch.shader.kinds import shadow_function
from raymarch.shader.light_rows import texel_of

MOST = 1 << 16
"""More than the rows of any texture. A loop that ends by itself has this end, which takes less time than one that is
read."""


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
    if plan.lights_as_data:
        _loop(text, plan, reflection)
        return
    for i, light in enumerate(plan.scene.lights):
        by, where = type(light).__name__, light.where
        if _before_others(plan):
            name = f"light_{i}" if len(plan.scene.lights) > 1 else "light"
            again = _sampled_again(i, light, values, plan)
            text.add(*[f"    Light {name} = {again};"] * bool(again), by=by, where=where)
            text.add(f"    color += {reflection.light(f'visibility_{i}', name)};", by=by, where=where)
        else:
            _light(text, i, light, values, plan, reflection)


def all_shadows(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """Trace the shadows of all sources, for `all_lights` to read: nothing where each light traces its own.

    What the light of the sky and of the sources have in common is thus computed after all marches. Otherwise compilers
    keep it in registers during the marches.
    """
    for i, light in enumerate(plan.scene.lights if _before_others(plan) else ()):
        _light(text, i, light, values, plan, reflection, apart=True)


def _before_others(plan: Plan) -> bool:
    """True if shadows are traced before other light is computed: those of lights that have a sample and a text each."""
    scene = plan.scene
    one = all(lights.samples_of(scene, light) == 1 for light in scene.lights)
    traced = any(lights.shadow_of(light) is not None for light in scene.lights)
    shares = len(scene.lights) > 1 or ambient_sky(scene)
    return one and traced and shares and not (plan.lights_as_data or plan.lights_split)


def _light(
    text: Lines, i: int, light: Light, values: Values, plan: Plan, reflection: Reflection, apart: bool = False
) -> None:
    """The lines of one light, with its values as literals where constant. apart : without the sum, which later reads
    the light and its visibility."""
    scene, by, where = plan.scene, type(light).__name__, light.where

    def value(name: str, of: Expr) -> str:
        return values.text(f"light_{i}_{name}", of, where)

    form, shadow = lights.table(scene).forms[lights.key(light)], lights.shadow_of(light)
    given = _emitter_values(i, light, values)
    radius, cut, width = light.shadow_radius, light.cut_by_horizon, ""
    if light.soft or cut:
        width = value("softness", light.disc_width) + " / light.distance" * light.has_position
    near = "" if radius is None or shadow is None else f"light.distance < {value('shadow_radius', radius)}"
    before = plan.occlusion_samples + sum(lights.samples_of(scene, other) for other in scene.lights[:i])
    split = (str(before), "first", "end") if plan.lights_split else ("", "", "")
    group = _Group(
        [("", form, given, [light])],
        [] if shadow is None else [(shadow, "", light)],
        near,
        width,
        "" if cut else None,
        f"{_dimension(i)}",
        f"{i * scene.quality.light_samples}",
        *split,
        name=f"_{i}",
        count=len(scene.lights),
    )
    made = _Estimator(plan, reflection, group)
    if apart:
        lines, visibility = made.before()
        lines += [f"float visibility_{i} = {visibility};"]
        lines += [f"Light light_{i} = light;"] * (len(scene.lights) > 1 and not _sampled_again(i, light, values, plan))
    else:
        lines = made.lines()
    if plan.lights_split and lights.samples_of(scene, light) == 1:
        lines = [f"if (first <= {before} && end > {before}) {{", *(f"    {line}" for line in lines), "}"]
    if i == 0:
        lines[:1] = [f"Light {lines[0]}"] if lines[0].startswith("light = ") else ["Light light;", lines[0]]
    text.add(*(f"    {line}" for line in lines), by=by, where=where)


def _emitter_values(i: int, light: Light, values: Values) -> list[str]:
    return [values.text(f"light_{i}_{name}", of, light.where) for name, of in light.emitter_values().items()]


def _sampled_again(i: int, light: Light, values: Values, plan: Plan) -> str:
    """The call that samples a light after all shadows, at a point that compilers do not know to be the same, so that
    they do not keep it during the marches. "" for a light that is kept."""
    form = lights.table(plan.scene).forms[lights.key(light)]
    known = POINT in form.function.params and SAMPLE not in form.function.params and not light.cut_by_horizon
    if len(plan.scene.lights) == 1 or not known or not plan.device.branches or lights.shadow_of(light) == "sampled":
        return ""
    return _sample(form, _emitter_values(i, light, values), "0").replace("surface.p", f"surface.p + {UNSEEN.data}")


@dataclass(frozen=True, slots=True)
class _Group:
    """Lights that one text adds: a single one, or those of all rows of the texture.

    A condition is GLSL text that tells which lights of the group are meant, and "" if all are.

    forms : a condition, the form, the texts of its values, and its lights. kinds : each kind of shadow, a condition,
    and one of the lights that cast it. near : true where a light casts its shadow, "" for everywhere. width : of the
    disc. cut : the condition of lights that a horizon may cut; None for none. dimension : the first random dimension.
    number : of samples of all lights before. place : of the first sample, among those that passes split; the text adds
    those from `begin` to `end`. skip : lines that leave out a light without radiance. name : the end of variables.
    count : number of all lights; None if the text reads it, as `light_count`.
    """

    forms: Sequence[tuple[str, lights.LightForm, list[str], Sequence[Light]]]
    kinds: Sequence[tuple[str, str, Light]]
    near: str
    width: str
    cut: str | None
    dimension: str
    number: str
    place: str = ""
    begin: str = ""
    end: str = ""
    skip: Sequence[str] = ()
    name: str = ""
    count: int | None = None

    def times(self, factor: int) -> str:
        """A multiple of the number of all lights."""
        return f"{factor} * light_count" if self.count is None else str(factor * self.count)


@dataclass(frozen=True, slots=True)
class _Estimator:
    """The writer of the lines that add the light of a group to the colour of a surface."""

    plan: Plan
    reflection: Reflection
    group: _Group

    def lines(self) -> list[str]:
        """All lines."""
        found, visibility = self.before()
        return found if visibility is None else [*found, *self.reflection.after_shadow(visibility)]

    def before(self) -> tuple[list[str], str | None]:
        """The lines but for the last, and the visibility of the light that the last line adds; None for no such line.

        First the lights with an area of which several points are added, then what the others have in common.
        """
        found: list[str] = []
        group, rest = self.group, []
        for condition, form, values, of in group.forms:
            if form.area and lights.samples_of(self.plan.scene, of[0]) > 1:
                shown = "1.0"
                for kind, which, _ in group.kinds:
                    if any(lights.shadow_of(light) == kind for light in of):
                        shown = _if_else([group.near, which], self._shadow(kind, group.width), shown)
                sample = _sample(form, values, self._dimension(of[0]))
                found += self._several(condition, sample, shown, of[0], partial(_met, form, values))
            else:
                rest.append((condition, _sample(form, values, group.dimension)))
        for k, (condition, sample) in enumerate(rest):
            condition = condition if k < len(rest) - 1 else ""  # the last is what no other is
            found.append("else " * (k > 0) + _if([condition], f"light = {sample};"))
        lines, visibility = self._rest() if rest else ([], None)
        return found + lines, visibility

    def _rest(self) -> tuple[list[str], str | None]:
        """The lines after the samples: the horizon, the discs and the shadows, and the visibility of what is added."""
        group, width, part = self.group, self.group.width, ""
        found, visibility, several = [*group.skip], "1.0", False
        if any(which for _, which, _ in group.kinds):
            visibility = "visibility"
            found.append("float visibility = 1.0;")
        if group.cut is not None:
            width, part, cut = f"width{group.name}", f"part{group.name}", "cut" if group.cut else ""
            found.append(f"float {width} = {group.width};")
            found += [f"bool cut = {group.cut};"] if cut else []
            found.append(f"float {part} = {_if_else([cut], _horizon('part_above_horizon', width), '1.0')};")
            found.append(_if([cut], f"light = {_horizon('above_horizon', width)};"))
            if any(kind not in ("hard", "sampled") for kind, *_ in group.kinds):
                found.append(_if([cut], f"{width} = min({width}, dot(surface.normal, light.direction));"))
        for kind, which, of in group.kinds:
            if kind == "sampled" and lights.samples_of(self.plan.scene, of) > 1:
                centre = f"centre{group.name}"
                width = width.replace("light.", f"{centre}.")  # that of each sample is shorter
                found.append(f"Light {centre} = light;")
                sample = f"sample_disc({centre}, {width}, {_two(self._dimension(of))})"
                shown = _if_else([group.near], self._shadow(kind, width), "1.0")
                found += self._several(which, sample, shown, of, partial(_disc, centre, width))
                several = not which
                continue
            if kind == "sampled":
                found.append(_if([which], f"light = sample_disc(light, {width}, {_two(group.dimension)});"))
            shown = self._shadow(kind, width)
            if which:
                found.append(_if([group.near, which], f"visibility = {shown};"))
            else:
                visibility = _if_else([group.near], shown, "1.0")
        if part:
            factor = visibility if visibility.isidentifier() else f"({visibility})"
            visibility = part if visibility == "1.0" else f"{part} * {factor}"
        return found, None if several else visibility

    def _shadow(self, kind: str, width: str) -> str:
        """The call that traces a shadow."""
        given = "" if kind in ("hard", "sampled") else f", {width}"
        return f"{shadow_function(self.plan, kind)}(surface, light{given})"

    def _dimension(self, of: Light) -> str:
        """The first random dimension of sample k of a light."""
        k = "(k / 2)" if samples_both(of, self.plan.scene.materials) else "k"
        return f"{self.group.dimension} + {self.group.times(2)} * {k}"

    def _several(
        self, condition: str, sample: str, shown: str, of: Light, texts: Callable[[], tuple[str, str]]
    ) -> list[str]:
        """The mean of several samples of the lights of a condition, of which one is given."""
        scene, group = self.plan.scene, self.group
        samples = scene.quality.light_samples
        lines = [f"for (int k = 0; k < {lights.samples_of(scene, of)}; k++) {{"]
        if group.place:
            lines.append(f"    if ({group.place} + k >= {group.end}) break;")
            lines.append(f"    if ({group.place} + k < {group.begin}) continue;")
        lines.append(f"    light = {sample};")
        if samples_both(of, scene.materials):
            before = group.times(2 * samples)
            weighted = _weighted(texts(), f"{group.number} + k / 2", before, self.reflection)
            lines += [f"    {line}" for line in weighted]
        lines += [f"    {line}" for line in self.reflection.after_shadow(shown, f" / {literal(samples)}")] + ["}"]
        return lines if not condition else [f"if ({condition}) {{", *(f"    {x}" for x in lines), "    continue;", "}"]


def _if(conditions: Sequence[str], statement: str) -> str:
    """A statement, where all conditions hold; "" always holds."""
    given = " && ".join(condition for condition in conditions if condition)
    return f"if ({given}) {statement}" if given else statement


def _if_else(conditions: Sequence[str], value: str, other: str) -> str:
    """A value where all conditions hold, else another one; "" always holds."""
    given = " && ".join(condition for condition in conditions if condition)
    return f"{given} ? {value} : {other}" if given else value


def visible_light(text: Lines, plan: Plan, values: Values) -> None:
    """The function `visible_light`: the radiance of the nearest visible light on a ray that ends at a hit, and in w its
    distance, which is negative if there is none. Nothing in scenes without such lights.

    A light that touches a surface is in front of it: a refined hit may lie half an epsilon before the surface, and
    others an epsilon.
    """
    scene, shown = plan.scene, lights.visible(plan.scene)
    if not shown:
        return
    table, by, where = lights.table(scene), "visible=True", shown[0].where
    text.add("vec4 visible_light(Ray ray, Hit hit, float travelled) {", by=by, where=where)
    text.add("    float end = hit.found ? hit.t : 1.0e30;", "    vec4 nearest = vec4(0.0, 0.0, 0.0, -1.0);")
    share = "0.5 * epsilon_pixels" if plan.refined else "epsilon_pixels"
    within = f"nearness(ray.origin + end * ray.direction, travelled + end, {share})"
    text.add(f"    float slack = hit.found ? {within} : 0.0;")
    text.add("    LightHit met;")
    keep = [
        "if (met.distance > 0.0 && (met.distance - end) * met.cosine < slack) {",
        "    nearest = vec4(met.radiance, met.distance);",
        "    end = met.distance;",
        "    slack = 0.0;",
        "}",
    ]
    if plan.lights_as_data:
        text.add(f"    {_count(plan)}", "    for (int i = 0; i < light_count; i++) {")
        if table.headed:
            text.add(f"        vec4 head = {texel_of(plan, 0)};")
        for k, form in enumerate(table.forms.values()):
            if form.ray is not None:
                values.functions.append(form.ray)
                places = lights.layout(form.types)
                given = [f"{texel_of(plan, at + table.headed)}.{parts}" for at, parts in places]
                text.add(f"        if (head.x == {float(k)}) {{" if table.headed else "        {", by=by, where=where)
                text.add(f"            met = {_on_ray(form, given)};", *(f"            {line}" for line in keep))
                text.add("        }")
        text.add("    }")
    for i, light in enumerate([] if plan.lights_as_data else scene.lights):
        form = table.forms[lights.key(light)]
        if form.ray is not None:
            values.functions += [form.ray] * (form.ray not in values.functions)
            given = _emitter_values(i, light, values)
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


def _weighted(texts: tuple[str, str], number: str, before: str, reflection: Reflection) -> list[str]:
    """The lines that replace each second sample of a light by one of the lobes, and weigh both.

    See `power_heuristic`.

    texts : of `_met` or `_disc`. number : of the sample among those of all lights. before : number of random dimensions
        of the points of lights, as GLSL text.
    """
    met, pdf = texts
    first = str(_dimension(0) + int(before)) if before.isdigit() else f"{_dimension(0)} + {before}"
    return [
        "bool lobe = k % 2 == 1;",
        "if (lobe) {",
        f"    int dimension = {first} + 4 * ({number});",
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


def _horizon(function: str, width: str) -> str:
    """The call of `above_horizon` or `part_above_horizon`."""
    return f"{function}(light, {width}, surface.normal)"


def _loop(text: Lines, plan: Plan, reflection: Reflection) -> None:
    """The loop over all lights, which reads their values from the rows of a texture."""
    scene, table = plan.scene, lights.table(plan.scene)
    ending = plan.lights_split or plan.lights_in_cells
    lines = []
    if table.headed:
        lines.append(f"vec4 head = {texel_of(plan, 0)};  // form, kind of shadow, softness, shadow radius")
    for k in range(table.texels - table.headed):
        lines.append(f"vec4 value_{k} = {texel_of(plan, k + table.headed)};")
    lines += ["Light light;", *_Estimator(plan, reflection, _rows(plan, ending)).lines()]
    if ending:
        lines.append("if (ends) break;")
    turns = _turns(plan)
    count = [_count(plan)] if any("light_count" in line for line in (*turns, *lines)) else []
    text.add(*(f"    {line}" for line in (*count, *turns)), where=scene.where)
    text.add(*(f"        {line}" for line in lines), "    }", where=scene.where)


def _count(plan: Plan) -> str:
    """The line that reads the number of lights. It is no part of the text, so that lights come and go without another
    program."""
    read = f"int(texelFetch(u_lights, ivec2({lights.table(plan.scene).texels}, 0), 0).x)"
    return f"int light_count = {len(plan.scene.lights) if plan.standalone else read};"


def _turns(plan: Plan) -> list[str]:
    """The lines that begin the loop over the lights i, and say when it ends: after all, those that are near the
    surface, or those of which a pass adds samples."""
    split, places, cells = plan.lights_split, lights.stride(plan.scene), plan.lights_in_cells
    if not (split or cells):
        return ["for (int i = 0; i < light_count; i++) {"]
    most, several = "reached.y" if cells else "light_count", split and places > 1
    number = f"begin / {places} + n" if several else "begin + n" if split else "n"
    at, end = f"({number}) * {places}" if several else number, "last" if split else most
    lines = ["ivec2 reached = lights_at(surface.p);  // start and length of a list"] if cells else []
    if split:
        after = f" - {plan.occlusion_samples}" * (plan.occlusion_samples > 0)
        lines += [
            f"int begin = max(first{after}, 0);  // samples of lights: the first, and the one after the last",
            f"int last = min(end{after}, {f'{places} * ' * several}{most});",
        ]
    # llvmpipe leaves a loop at the end of a turn only, so the last turn must say that it is the last
    return [
        *(*lines, f"for (int n = 0; n < {MOST}; n++) {{"),
        *(f"    if ({at} >= {end}) break;", f"    bool ends = {at} + {places if split else 1} >= {end};"),
        *([f"    int place = ({number}) * {places};  // its first sample"] if several else []),
        f"    int i = {f'light_of(reached.x + {number})' if cells else number};",
    ]


def _rows(plan: Plan, ending: bool) -> _Group:
    """The lights of all rows. ending : whether the loop must be left where a light that is the last ends."""
    scene, table = plan.scene, lights.table(plan.scene)
    by_form: dict[lights.Key, list[Light]] = {}
    for light in scene.lights:
        by_form.setdefault(lights.key(light), []).append(light)
    forms = []
    for k, (key, form) in enumerate(table.forms.items()):
        values = [f"value_{texel}.{parts}" for texel, parts in lights.layout(form.types)]
        forms.append((f"head.x == {float(k)}", form, values, by_form[key]))
    kinds = [
        (kind, f"head.y == {float(k)}", next(light for light in scene.lights if lights.shadow_of(light) == kind))
        for k, kind in enumerate(table.kinds, 1)
    ]
    sampled = f"head.y != {float(len(kinds))}" if "sampled" in table.kinds else ""  # it is the last kind
    balls = " || ".join(which for which, *_, of in forms if any(light.cut_by_horizon for light in of))
    if balls and sampled:
        balls = f"({balls}) && {sampled}"
    several = plan.lights_split and lights.stride(scene) > 1
    skip = [_if([sampled, "place < begin"], "continue;")] * several  # the only sample may have been added before
    skip += ["if (ends && light.radiance == vec3(0.0)) break;"] * ending
    limited = any(light.shadow_radius is not None for light in scene.lights)
    return _Group(
        forms,
        kinds,
        "(head.w == 0.0 || light.distance < head.w)" if limited else "",
        _width_of_row(scene),
        balls or None,
        f"{_dimension(0)} + 2 * i",
        f"{scene.quality.light_samples} * i",
        *(("place", "begin", "last") if several else ("", "", "")),
        [*skip, "if (light.radiance == vec3(0.0)) continue;"],
    )


def _width_of_row(scene: Scene) -> str:
    """The width of a row's disc. That of a light with a position is a radius, and is divided by the distance."""
    positioned = {lights.key(light): light.has_position for light in scene.lights}
    far = [f"head.x == {float(k)}" for k, of in enumerate(lights.table(scene).forms) if not positioned[of]]
    if not far:
        return "head.z / light.distance"
    return "head.z" if len(far) == len(positioned) else f"head.z / ({' || '.join(far)} ? 1.0 : light.distance)"
