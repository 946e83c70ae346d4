"""Measure the prices of choices on a driver: scenes drawn with each choice forced, in turn.

A choice costs what a frame of 640x360 takes, and a part of the first one. Where scenes get larger step by step, its
price is the size at which both sides cost the same; it is never paid if what it buys is cheaper at no size of them.
Other prices are differences of two scenes.

Times vary, so each price has an interval that holds its median with about 95 % confidence. A price whose interval holds
that of the class stays as it is. Of one that is wide beside it, the end that is nearest to the class's counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

import raymarch
import raymarch.sdf as sdf
from raymarch.cost.effects import evaluations_of
from raymarch.expr.operations import reads
from raymarch.gpu.clock import Clock
from raymarch.gpu.context import Context
from raymarch.gpu.measured_prices import Measured, replaced
from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.plan.device import DeviceClass
from raymarch.prices import NEVER, OBJECT, SAVED_FAR, Prices
from raymarch.scene import Camera, Scene, Sun
from raymarch.sdf import Node

PLANNED = (640, 360)
PICTURE = PLANNED[0] * PLANNED[1]
"""Width and height of the picture for which choices are weighed, and its pixels."""

FRAMES = 20
"""Frames over which the first one is spread."""

SIZES = ((24, 14), (48, 27), (96, 54), (192, 108), (384, 216))
"""Sizes of the pictures: the largest of which a draw takes at most `LONG` milliseconds."""

LONG = 20.0
SLOW = 250.0
"""Milliseconds of the largest draw where three sizes are compared."""

ROUNDS, FEWEST = 15, 5
"""Rounds in which draws take turns, and those where a draw of the smallest size takes longer than `LONG`."""

FIRSTS = 3
"""First frames of each side."""

WIDE = 2.5
"""Largest ratio of the ends of an interval whose median counts."""

SCENES = 3
"""Most scenes that one stage draws."""


@dataclass(frozen=True, slots=True)
class Times:
    """Times of several sides of a choice. first : seconds by which each first frame takes longer, by repetition and
    side. frames : milliseconds by round and side, at a picture of 640x360."""

    first: NDArray[np.float64]
    frames: NDArray[np.float64]

    @property
    def costs(self) -> NDArray[np.float64]:
        """Milliseconds of a frame with its part of the first, by round and side."""
        return self.frames + 1e3 / FRAMES * np.median(self.first, axis=0)


class Bench:
    """Draws scenes with prices forced. context : to draw on. device : the class of its driver, without measured prices.

    clock : returns the milliseconds of a draw; None for that of the driver. drawn : is called after each scene.
    """

    def __init__(
        self, context: Context, device: DeviceClass, clock: Callable[[Callable[[], None]], float] | None = None
    ) -> None:
        self.context, self.device = context, device
        self.drawn: Callable[[], object] = lambda: None
        if clock is None:
            made = Clock(context)
            made.by_cpu = True
            clock = made.time
        self.clock = clock

    def times(
        self, scene: Scene, sides: Sequence[Prices], size: tuple[int, int] | None = None, rounds: int | None = None
    ) -> Times:
        """The times of a scene with some prices, drawn in turn.

        size : of the pictures, whose times then stay as they are. None: as large as a draw may take.
        rounds : number of them; None to choose it.
        """
        with ExitStack() as stack:
            firsts, draws, renderers = [], list[Callable[[], None]](), list[Renderer]()
            for _ in range(FIRSTS):
                stack.close()
                renderers = [stack.enter_context(self._renderer(prices)) for prices in sides]
                draws = [partial(_draw, renderer, scene) for renderer in renderers]
                firsts.append([1e-3 * self.clock(draw) for draw in draws])
            fitting, usual = self._size(self.clock(draws[0]))
            chosen, rounds = size or fitting, rounds or usual
            for renderer, draw in zip(renderers, draws, strict=True):
                renderer.resize(chosen)
                draw()
            frames = np.array([[self.clock(draw) for draw in draws] for _ in range(rounds)])
        self.drawn()
        pixels = chosen[0] * chosen[1]
        shown = 1e-3 * np.median(frames, axis=0) * (SIZES[0][0] * SIZES[0][1] / pixels)
        scale = 1.0 if size else PICTURE / pixels
        return Times(np.maximum(np.array(firsts) - shown, 0.0), scale * frames)

    def _renderer(self, prices: Prices) -> Renderer:
        renderer = Renderer(SIZES[0], context=self.context)
        renderer.resources.device, renderer.planned_for = replace(self.device, prices=prices), PLANNED
        return renderer

    @staticmethod
    def _size(took: float) -> tuple[tuple[int, int], int]:
        """The size of the pictures, and the number of rounds, if a draw of the smallest size took so long."""
        chosen = SIZES[0]
        for size in SIZES[1:]:
            if took * (size[0] * size[1]) / (SIZES[0][0] * SIZES[0][1]) <= LONG:
                chosen = size
        return chosen, FEWEST if took > LONG else ROUNDS

    def sizes(self, scene: Scene, prices: Prices) -> Sequence[tuple[int, int]]:
        """Three sizes of pictures to compare: as large as this driver draws within `SLOW` milliseconds."""
        with self._renderer(prices) as renderer:
            _draw(renderer, scene)
            took = self.clock(partial(_draw, renderer, scene)) / (SIZES[0][0] * SIZES[0][1])
        last = max(3, sum(took * size[0] * size[1] <= SLOW for size in SIZES))
        return SIZES[last - 3 : last]

    def evaluations(self, scene: Scene, prices: Prices) -> float:
        """Evaluations of the field in a picture of 640x360."""
        with Renderer(SIZES[0], context=self.context) as renderer:
            renderer.resources.device = replace(self.device, prices=prices)
            return PICTURE * evaluations_of(scene, renderer)


@dataclass(frozen=True, slots=True)
class Found:
    """A price: its field of `Prices`, its value, the interval of its rounds, that of the class, and why this holds;
    "" if the measured one holds."""

    name: str
    value: float
    low: float
    high: float
    standard: float
    kept: str = ""


Stage: TypeAlias = Callable[[Bench, Prices], Iterator[tuple[str, NDArray[np.float64]]]]
"""Measures some prices. Yields the name and the values of its rounds."""


def measure(
    bench: Bench, date: str, tell: Callable[[float], object] = lambda share: None, stages: Sequence[Stage] = ()
) -> tuple[Measured, list[Found]]:
    """Measure all prices of a driver. Takes half a minute of CPU time on llvmpipe.

    date : of today, ISO 8601. tell : is called with the share that is done. stages : what is measured; () for all.
    """
    stages = stages or STAGES
    driver, standard = bench.context.driver, bench.device.prices
    found: list[Found] = []
    share = 0.0

    def drawn() -> None:
        nonlocal share
        share += 1.0 / (SCENES * len(stages))
        tell(min(share, 1.0))

    bench.drawn = drawn
    for k, stage in enumerate(stages):
        share = k / len(stages)
        tell(share)
        now = replaced(standard, {each.name: each.value for each in found if not each.kept})
        found += [_judged(*values, standard) for values in stage(bench, now)]
    prices = {each.name: each.value for each in found if not each.kept}
    kept = {each.name: each.kept for each in found if each.kept}
    made = Measured(driver.renderer, driver.version, raymarch.__version__, bench.device.name, date, prices, kept)
    return made, found


def _judged(name: str, rounds: NDArray[np.float64], standard: Prices) -> Found:
    """A price by its value in each round; that of the class if the rounds do not tell it from this."""
    each = np.sort(rounds)
    inner = max(0, round(0.5 * len(each) - math.sqrt(len(each))))
    middle, low, high = (float(each[i]) for i in (len(each) // 2, inner, -1 - inner))
    own = float(getattr(standard, name))
    kept = ""
    if not math.isfinite(low + high):
        kept = "it cannot be measured"
    elif low <= own <= high:
        kept = f"{'too noisy' if high > WIDE * low else 'as measured'}: {low:.3g} to {high:.3g}"
    elif high > WIDE * low:
        middle = low if low > own else high
    if middle <= 0.0:
        kept = "it cannot be measured"
    return Found(name, middle, low, high, own, kept)


def _grid_of(form: Callable[[int], Node], count: int) -> Scene:
    """Solids on a floor."""
    side = math.ceil(math.sqrt(count))
    solids = [form(i).translate((1.4 * (i % side - 0.5 * (side - 1)), 0.0, -1.4 * (i // side))) for i in range(count)]
    camera = Camera((2.0, 3.0, 4.0), (0.0, 0.0, -0.7 * (side - 1)), fov=45.0)
    floor = sdf.plane(offset=-0.6)
    return Scene(sdf.union(floor, *solids), camera, [Sun((0.6, 1.0, 0.5), shadow=True)])


def _chain(count: int) -> Scene:
    """A blend of balls that fills the picture: arithmetic without a branch."""
    balls = [
        sdf.sphere(0.5 + 1e-3 * i).translate((0.6 * math.cos(2 * i), 0.03 * i, 0.6 * math.sin(2 * i)))
        for i in range(count)
    ]
    high = 0.015 * count
    camera = Camera((1.0, high + 0.5, 2.0), (0.0, high, 0.0), fov=40.0)
    return Scene(sdf.union(*balls, k=0.1), camera, [Sun((0.6, 1.0, 0.5), shadow=True)])


def _arithmetic(bench: Bench, prices: Prices) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Nanoseconds of an operation, and seconds of a thousand and of their square, whose ratio is that of the class, by
    blends of 4, 16 and 40 balls."""
    prices = replace(prices, look_up=NEVER, costly_objects=NEVER, slow_text=NEVER, draw=NEVER)
    scenes = [_chain(count) for count in (4, 16, 40)]
    made = [bench.times(scene, [prices]) for scene in scenes]
    sizes = [_operations(bench, scene, prices) for scene in scenes]
    work = [n * bench.evaluations(scene, prices) for scene, n in zip(scenes, sizes, strict=True)]
    rounds = min(len(each.frames) for each in made)
    frames = np.array([each.frames[:rounds, 0] for each in made])
    yield "operation", 1e6 * (frames[2] - frames[0]) / (work[2] - work[0])
    own = bench.device.prices
    few, many = (made[k].first[:, 0] for k in (0, 2))
    factor = (many - few) / (own.seconds(sizes[2]) - own.seconds(sizes[0]))
    yield "compile", factor * own.compile
    yield "compile_square", factor * own.compile_square


def _reading(bench: Bench, prices: Prices) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Operations of reading a texel, by unions of 2 and 8 grids of distances."""
    axis = np.linspace(-1.0, 1.0, 12)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")

    def form(i: int) -> Node:
        return sdf.grid(np.sqrt(x * x + y * y + z * z) - 0.6 - 0.01 * i, 1.2)

    scenes = [_grid_of(form, count) for count in (2, 8)]
    made = [bench.times(scene, [prices]) for scene in scenes]
    seen = [bench.evaluations(scene, prices) for scene in scenes]
    rounds = min(len(each.frames) for each in made)
    frames = made[1].frames[:rounds, 0] - made[0].frames[:rounds, 0]
    fields = [plan(scene, device=replace(bench.device, prices=prices)) for scene in scenes]
    texels, work = (
        [n * e for n, e in zip(some, seen, strict=True)]
        for some in ([reads([each.field.body]) for each in fields], [each.operations for each in fields])
    )
    yield "read", (1e6 * frames / prices.operation - (work[1] - work[0])) / (texels[1] - texels[0])


def _closed_forms(bench: Bench, prices: Prices) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Seconds of a solid in closed form, of which as many are solved as `Prices.patience` allows."""
    sides = [replace(prices, closed_form=cost, look_up=NEVER) for cost in (1e-9, NEVER)]
    steps: list[Step] = [(float(count), _grid_of(_ball_or_box, count), None) for count in (4, 12, 36)]
    most = np.minimum(_break_even(bench, steps, sides), 2.0 * steps[-1][0])
    yield "closed_form", np.divide(prices.patience, most, out=np.full(len(most), NEVER), where=most > 0.0)


def _boxes(bench: Bench, prices: Prices) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Operations of an operand whose box is worth asking."""

    def scene(count: int) -> Scene:
        return _grid_of(lambda i: sdf.sierpinski(0.9, count).rotate(0.3 * i, "y"), 6)

    never = replace(prices, skip=NEVER, costly_objects=NEVER, look_up=NEVER)
    steps = [(_operations(bench, scene(count), never) / 6, scene(count), None) for count in (4, 12, 36)]
    yield "skip", _paid_from(steps, _break_even(bench, steps, [never, replace(never, skip=0.0, operands=1)]))


def _objects(bench: Bench, prices: Prices) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Operations of finding objects through cells, by rings as text and as rows. Compilers draw balls so fast that they
    are worth rows much later; rings as text take twice the time where balls as rows take a third more."""
    sides = [replace(prices, look_up=cost, form=OBJECT, closed_form=NEVER, skip=NEVER) for cost in (NEVER, 0.0)]
    steps: list[Step] = [(float(OBJECT * count), _grid_of(_ring, count), None) for count in (8, 24, 72)]
    yield "look_up", _paid_from(steps, _break_even(bench, steps, sides))


def _cones(bench: Bench, prices: Prices) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Operations of a further pass with its program, by endless columns in pictures of several sizes."""
    form = sdf.box((0.5, 30.0, 0.5)).round(0.05) | sdf.cylinder(0.3, 30.0) | sdf.torus(0.5, 0.1)
    node = sdf.union(form.twist(0.1), sdf.sphere(0.4).scale((1.0, 2.0, 1.0)), k=0.1).repeat((2.0, None, 2.0))
    scene = Scene(node, Camera((1.0, 2.0, 6.0), (0.0, 1.0, 0.0), fov=60.0), [Sun((0.6, 1.0, 0.5))])
    sides = [replace(prices, draw=cost) for cost in (NEVER, 0.0)]
    work = SAVED_FAR * _operations(bench, scene, prices)
    steps = [(work * size[0] * size[1], scene, size) for size in bench.sizes(scene, sides[0])]
    yield "draw", _paid_from(steps, _break_even(bench, steps, sides))


MEANING = {
    "operation": "ns of an arithmetic operation of one ray",
    "compile": "s to compile 1,000 operations",
    "compile_square": "s more for their square",
    "read": "operations that take as long as reading a texel",
    "skip": "operations from which a part is worth a box",
    "look_up": "operations of finding objects through cells",
    "closed_form": "s to compile a solid in closed form",
    "draw": "operations of a further pass, for all pixels",
}
"""The unit and the meaning of each price that is measured, in short: `raymarch.prices.Prices` says it in full."""

STAGES: Sequence[Stage] = (_arithmetic, _reading, _boxes, _objects, _closed_forms, _cones)
"""What is measured, in order: prices in operations need that of an operation."""


def _ring(i: int) -> Node:
    return sdf.torus(0.4 + 1e-3 * i, 0.08).rotate(1.0, "x")


def _ball_or_box(i: int) -> Node:
    size = 0.4 + 1e-3 * i
    return sdf.sphere(size) if i % 2 else sdf.box(2.0 * size).rotate(0.2 * (i % 7), "y")


def _draw(renderer: Renderer, scene: Scene) -> None:
    renderer.render(scene)


def _operations(bench: Bench, scene: Scene, prices: Prices) -> int:
    return plan(scene, device=replace(bench.device, prices=prices)).operations


Step: TypeAlias = tuple[float, Scene, tuple[int, int] | None]
"""A size, what is drawn, and in which size of the picture; None for one of 640x360."""


def _break_even(bench: Bench, steps: Sequence[Step], sides: Sequence[Prices]) -> NDArray[np.float64]:
    """The size from which the second side is cheaper, by round: where the logarithm of their ratio is 0, linear in that
    of the size. 0 or infinite if that is below half of the smallest or above twice the largest size."""
    at = np.log([size for size, *_ in steps])
    costs = [bench.times(scene, sides, picture).costs for _, scene, picture in steps]
    rounds = min(map(len, costs))
    ratios = np.array([np.sort(np.log(each[:, 1] / each[:, 0]))[:rounds] for each in costs])  # ascending: the interval
    return np.array([_root(at, ratios[:, k]) for k in range(rounds)])


def _root(at: NDArray[np.float64], ratio: NDArray[np.float64]) -> float:
    slope, offset = np.polyfit(at, ratio, 1)
    if slope >= 0.0:  # it never gets cheaper with size
        return 0.0 if ratio.mean() < 0.0 else math.inf
    for k in range(len(at) - 1):
        if ratio[k] > 0.0 >= ratio[k + 1]:
            return math.exp(at[k] + (at[k + 1] - at[k]) * ratio[k] / (ratio[k] - ratio[k + 1]))
    root = float(-offset / slope)
    low, high = at[0] - math.log(2.0), at[-1] + math.log(2.0)
    return 0.0 if root < low else math.inf if root > high else math.exp(root)


def _paid_from(steps: Sequence[Step], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The price of what pays from some sizes on: at least half of the smallest that was drawn, `NEVER` without any."""
    return np.clip(sizes, 0.5 * steps[0][0], NEVER)
