"""Lights in the shader: few are written as code, many are rows of a texture that one loop reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, expr, var
from raymarch.expr.types import Type
from raymarch.expr.vocabulary import record
from raymarch.expr.walk import free_variables
from raymarch.plan.light_cells import no_power_of_two
from raymarch.prices import STANDARD, Prices
from raymarch.scene.fog import Atmosphere
from raymarch.scene.light import (
    DIRECTION,
    DIRECTION_SAMPLE,
    FAR,
    LIGHT,
    LIGHT_HIT,
    POINT,
    SAMPLE,
    Light,
    density_of,
    ray_hit_of,
    sample_of,
)
from raymarch.scene.parameter import LEAST_LENGTH, Values
from raymarch.scene.scene import Scene
from raymarch.scene.surfaces import has_disc, samples_both

GIVEN = (POINT, SAMPLE, DIRECTION, FAR, DIRECTION_SAMPLE)
"""What a sample of a light, or its density, may depend on besides the light's values."""


SHADOWS: tuple[str, ...] = ("hard", "two-sided", "cone", "triangulated", "sampled")
"""The kinds of shadow."""


Key: TypeAlias = tuple[type[Light], tuple[str, ...], bool]
"""What identifies the form of a light; see `key`."""


@dataclass(frozen=True, slots=True)
class LightForm:
    """Lights that share one function: those of a class with the same values given.

    function : samples a light; its parameters are the values in order, after those of `GIVEN` that it reads.
    met, pdf : its `eval_direction` and `pdf_direction`, if it has them. ray : its `eval_ray`, if it is visible.
    """

    function: Function
    names: tuple[str, ...]
    met: Function | None
    pdf: Function | None
    ray: Function | None

    @property
    def reads(self) -> list[Expr]:
        """Those of `GIVEN` that the function reads."""
        return [p for p in self.function.params if p in GIVEN]

    @property
    def area(self) -> bool:
        """True if the lights have an area: their light is the mean over random points."""
        return SAMPLE in self.function.params

    @property
    def types(self) -> tuple[Type, ...]:
        """Types of the values."""
        return tuple(p.type for p in self.function.params[len(self.reads) :])


@dataclass(frozen=True, slots=True)
class LightTable:
    """The rows of some lights, of which only values that change are evaluated in each frame.

    forms : by their keys; see `key`. kinds : the kinds of shadow that the lights cast; their numbers in the texture are
    their positions, from 1. headed : True if rows begin with a head, because the lights have several forms, or some
    cast shadows, have an area, or are cut by a horizon. fixed : the values that are constant, (lights, 4 texels).
    varied : the row, the first number and the expression of each other value. balls, moving : the same of what each
    light reaches, (lights, 4). limited : number of lights that have such a ball. rows_now, balls_now : the values of
    `varied` and of `moving`, for the bound parameters and time.
    """

    forms: dict[Key, LightForm]
    kinds: list[str]
    headed: bool
    fixed: NDArray[np.float64]
    varied: list[tuple[int, int, Expr]]
    balls: NDArray[np.float64]
    moving: list[tuple[int, int, Expr]]
    limited: int
    rows_now: Callable[[], Sequence[NDArray[Any]]]
    balls_now: Callable[[], Sequence[NDArray[Any]]]

    @property
    def texels(self) -> int:
        """The number of texels of a row: the head, and the values of the form that has most."""
        return self.fixed.shape[1] // 4


class _Lights:
    """The lights of a scene and what they pass, as a key of a cache that compares them by identity."""

    def __init__(self, lights: Sequence[Light], fog: Atmosphere | None) -> None:
        self.lights, self.fog = lights, fog

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Lights) and self.lights is other.lights and self.fog is other.fog

    def __hash__(self) -> int:
        return hash((id(self.lights), id(self.fog)))


def table(scene: Scene) -> LightTable:
    """The table of the lights of a scene."""
    return _table(_Lights(scene.lights, scene.fog))


@lru_cache(16)
def _table(of: _Lights) -> LightTable:
    found, kinds = _forms(of.lights, of.fog), {shadow_of(light) for light in of.lights}
    ordered = [kind for kind in SHADOWS if kind in kinds]
    head = len(found) > 1 or bool(ordered) or any(form.area for form in found.values())
    head = head or any(light.cut_by_horizon for light in of.lights)
    places = {of: layout(form.types) for of, form in found.items()}
    numbers = {of: i for i, of in enumerate(found)}
    width = head + max((1 + k for place in places.values() for k, _ in place), default=0)
    fixed, balls = np.zeros((len(of.lights), 4 * width)), np.full((len(of.lights), 4), [0.0, 0.0, 0.0, np.inf])
    varied: list[tuple[int, int, Expr]] = []
    moving: list[tuple[int, int, Expr]] = []
    for i, light in enumerate(of.lights):
        form, shadow, values = key(light), shadow_of(light), light.emitter_values()
        given = [
            (4 * (head + k) + "xyzw".index(c[0]), e) for (k, c), e in zip(places[form], values.values(), strict=True)
        ]
        if head:
            fixed[i, :2] = numbers[form], ordered.index(shadow) + 1 if shadow else 0
            given += [(2, light.disc_width)]
            given += [] if light.shadow_radius is None else [(3, light.shadow_radius)]
        reached = () if light.reach is None else zip((0, 3), light.reach, strict=True)
        for numbers_of, changing, pairs in ((fixed, varied, given), (balls, moving, reached)):
            for first, value in pairs:
                if value.is_constant:
                    numbers_of[i, first : first + value.type.size] = value.data
                else:
                    changing.append((i, first, value))
    limited = sum(light.reach is not None for light in of.lights)
    rows_now, balls_now = (evaluator([value for *_, value in listed], []) for listed in (varied, moving))
    return LightTable(found, ordered, head, fixed, varied, balls, moving, limited, rows_now, balls_now)


def _forms(lights: Sequence[Light], fog: Atmosphere | None) -> dict[Key, LightForm]:
    """The forms of some lights, in an order that does not depend on that of the lights."""
    found: dict[Key, LightForm] = {}
    dimming = None if fog is None else fog.transmittance
    for light in sorted(lights, key=lambda light: _spelled(key(light))):
        of = key(light)
        if of not in found:
            kind, names, _ = of
            values = {name: var(name, value.type) for name, value in light.emitter_values().items()}
            earlier = sum(other is kind for other, *_ in found)
            name = f"_{_snake(kind.__name__)}{f'_{earlier + 1}' if earlier else ''}"
            density = density_of(light, values, dimming)
            met = None if density is None else _function(f"eval{name}", record(LIGHT, *density[0]), values)
            pdf = None if density is None else _function(f"pdf{name}", density[1], values)
            sample = _function(f"sample{name}", record(LIGHT, *sample_of(light, values, dimming)), values)
            shown = ray_hit_of(light, values)
            ray = None if shown is None else _function(f"ray{name}", record(LIGHT_HIT, *map(expr, shown)), values)
            found[of] = LightForm(sample, names, met, pdf, ray)
    return found


def _function(name: str, body: Expr, values: Mapping[str, Expr]) -> Function:
    """A function of the values of a light, after those of `GIVEN` that it reads."""
    read = free_variables([body])
    return Function(name, (*(p for p in GIVEN if p in read), *values.values()), body)


def key(light: Light) -> Key:
    """What identifies the form of a light: the class of its samples, the names of its values, and whether it is
    visible."""
    methods = {"sample_direction", "eval_direction", "pdf_direction", "eval_ray"}
    kind = next(cls for cls in type(light).__mro__ if not methods.isdisjoint(vars(cls)))
    return kind, tuple(light.emitter_values()), light.visible


def _spelled(of: Key) -> tuple[str, str, tuple[str, ...], bool]:
    """A key as names, by which keys are sorted."""
    kind, names, shown = of
    return kind.__module__, kind.__qualname__, names, shown


Signature: TypeAlias = tuple[Key, str | None, bool, bool, bool]
"""What the text of a loop over rows depends on, of each light; see `signature`."""


def signature(light: Light) -> Signature:
    """What the text of a loop over rows depends on: the form, the kind of shadow, and whether the light is soft, is cut
    by a horizon, and has a shadow radius."""
    return key(light), shadow_of(light), light.soft, light.cut_by_horizon, light.shadow_radius is not None


def visible(scene: Scene) -> list[Light]:
    """The lights that rays show."""
    return [x for x in scene.lights if x.visible and table(scene).forms[key(x)].ray is not None]


def with_discs(scene: Scene) -> Scene:
    """The scene with `penumbra="sampled"` of all lights that have a disc; see `has_disc`. Those without a shadow have a
    shadow that no surface is near enough to receive."""
    sampled = {"penumbra": "sampled"}
    none = {**sampled, "shadow": True, "shadow_radius": LEAST_LENGTH}
    discs = [has_disc(x, scene.materials, scene.bouncing) for x in scene.lights]
    given = [sampled if x.shadow else none for x in scene.lights]
    changed = [x.replace(**to) if disc else x for x, to, disc in zip(scene.lights, given, discs, strict=True)]
    return scene if tuple(changed) == scene.lights else scene.replace(lights=changed)


def _snake(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() and i else c.lower() for i, c in enumerate(name))


def as_data(scene: Scene, prices: Prices = STANDARD) -> bool:
    """True if the lights are rows of a texture."""
    return len(scene.lights) > prices.lights


def split(scene: Scene) -> bool:
    """True if passes add a few lights each to the surfaces that camera rays hit."""
    return scene.quality.lights_per_pass is not None and splittable(scene) > 1


def splittable(scene: Scene) -> int:
    """The number of samples of light that passes may add one by one, to what camera rays hit: those of ambient
    occlusion and of lights. 0 in scenes whose rays bounce."""
    if scene.path_traced or scene.whitted:
        return 0
    ambient = scene.occlusion is not None and (scene.sky.lights or scene.lights)
    dimmed = scene.occlusion.steps if scene.occlusion is not None and ambient else 0
    return dimmed + sum(samples_of(scene, light) for light in scene.lights)


def samples_of(scene: Scene, light: Light) -> int:
    """The number of samples of a light for each ray."""
    several = table(scene).forms[key(light)].area or has_disc(light, scene.materials, scene.bouncing)
    return scene.quality.light_samples * (1 + samples_both(light, scene.materials, scene.bouncing)) if several else 1


def stride(scene: Scene) -> int:
    """The largest number of samples of a light for each ray. In a loop over rows, each light takes as many places."""
    return max((samples_of(scene, light) for light in scene.lights), default=1)


def shadow_of(light: Light) -> str | None:
    """The kind of shadow of a light, "hard" or one of its `penumbra`; None if it casts none."""
    if not light.shadow:
        return None
    return light.penumbra if light.soft else "hard"


def layout(types: Sequence[Type]) -> list[tuple[int, str]]:
    """The texel and components of each value of a row: vectors have a texel each, and numbers fill the gaps."""
    found: dict[int, tuple[int, str]] = {}
    free: list[tuple[int, str]] = []
    texels = 0
    for i in sorted(range(len(types)), key=lambda i: -types[i].size):
        size = types[i].size
        if size > 1 or not free:
            free += [(texels, c) for c in "xyzw"[size:]]
            found[i] = (texels, "xyzw"[:size])
            texels += 1
        else:
            found[i] = free.pop(0)
    return [found[i] for i in range(len(types))]


def rows(scene: Scene, values: Values, count: int | None = None) -> NDArray[np.float32]:
    """The lights of one frame as float32, shape (lights, texels, 4).

    count : number of lights, from the first; None for all.
    The head holds the number of the form, that of the kind of shadow or 0, the softness, and the shadow radius or 0 for
    none. The other texels hold the values of the form; see `layout`.
    """
    found = table(scene)
    made = _evaluated(found.fixed, found.varied, found.rows_now, values)[:count]
    return made.astype(np.float32).reshape(len(made), -1, 4)


def padded(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """The rows as a texture: one texel more, of which the first row holds the number of lights, and a number of rows
    that is no power of two. Software renderers compile a program again for a texture whose size is another kind."""
    many, texels, _ = rows.shape
    made = np.zeros((no_power_of_two(many), texels + 1, 4), np.float32)
    made[:many, :texels], made[0, texels, 0] = rows, many
    return made


def in_fog(scene: Scene) -> bool:
    """True if the text of the fog holds the lights too, so that it draws no others."""
    return scene.fog is not None and scene.fog.lit


def in_cells(scene: Scene, prices: Prices = STANDARD) -> bool:
    """True if a grid of cells finds the lights that reach a point: if many are limited to a range."""
    return as_data(scene, prices) and table(scene).limited > prices.lights


def balls(scene: Scene, values: Values, count: int | None = None) -> NDArray[np.float64]:
    """What the lights of one frame reach: centres and radii, shape (lights, 4). A light without a range has an infinite
    radius. count : as for `rows`."""
    found = table(scene)
    return _evaluated(found.balls, found.moving, found.balls_now, values)[:count]


def _evaluated(
    fixed: NDArray[np.float64],
    varied: Sequence[tuple[int, int, Expr]],
    now: Callable[[], Sequence[NDArray[Any]]],
    values: Values,
) -> NDArray[np.float64]:
    made = fixed.copy()
    with bound(values.params, values.time):
        found = now()
    for (row, first, expression), value in zip(varied, found, strict=True):
        made[row, first : first + expression.type.size] = value
    return made
