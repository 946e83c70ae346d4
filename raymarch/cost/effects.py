"""Ablation of effects: the cost of each effect of a scene, and its change of the picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from raymarch.cost.drawing import timed
from raymarch.cost.errors import picture_errors
from raymarch.cost.flip import flip
from raymarch.cost.settings import Setting
from raymarch.cost.statistics import Median, median
from raymarch.cost.sweep import Progress, turns
from raymarch.errors import CostError
from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.scene.light_kinds import hard
from raymarch.scene.material import Material
from raymarch.scene.parameter import set_values
from raymarch.scene.scene import Scene
from raymarch.sdf.labels import relabelled
from raymarch.shader import assemble
from raymarch.shader.assemble import assemble_effect

TEXEL = 16
"""Bytes of a texel: four 32-bit floats."""
REPEATS = 3
"""Pictures of which `dearest` takes the median time."""


@dataclass(slots=True)
class Effect:
    """Cost of an effect. All values but the flips are differences: the scene with the effect minus without it.

    milliseconds : frame time; frames of the same turn are compared. evaluations : of the field and its gradient per
    pixel, with all secondary rays. texture_bytes, shader_bytes : size of the passes' textures and of the shader's text.
    flip_mean, flip_p99, flip_max, flip_region : FLIP of the picture without the effect against that with it.
    color, color_without : both pictures, (H, W, 3), linear RGB.
    """

    name: str
    evaluations: float
    texture_bytes: int
    shader_bytes: int
    flip_mean: float
    flip_p99: float
    flip_max: float
    flip_region: int
    color: NDArray[Any] = field(repr=False)
    color_without: NDArray[Any] = field(repr=False)
    _differences: list[float] = field(default_factory=list, repr=False)
    _frames: list[float] = field(default_factory=list, repr=False)

    @property
    def milliseconds(self) -> Median:
        return median(self._differences)

    @property
    def share(self) -> float:
        """The fraction of the frame's time that the effect takes; about 0 or below where it takes none."""
        return self.milliseconds.value / median(self._frames).value

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "name": self.name,
            "milliseconds": self.milliseconds.as_dict(),
            "evaluations": self.evaluations,
            "texture_bytes": self.texture_bytes,
            "shader_bytes": self.shader_bytes,
            "flip": {
                "mean": self.flip_mean,
                "p99": self.flip_p99,
                "max": self.flip_max,
                "largest_region": self.flip_region,
            },
        }


def ablations(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """The scene without each of its effects in turn.

    Effects are: fog, occlusion, a switch of a light or of the sky that is on, a
    softness that is not 0, one of several lights, a post effect, textures and relief, all bounces of light, the last
    bounce, and more than one ray per pixel.
    """
    for name in ("fog", "occlusion"):
        if getattr(scene, name) is not None:
            yield name, scene.replace(**{name: None})
    for switch in _switches([*scene.lights]):
        lights = tuple(
            light.replace(**{switch: False}) if getattr(light, switch, False) is True else light
            for light in scene.lights
        )
        yield f"{switch} of lights", scene.replace(lights=lights)
    if any(light.soft for light in scene.lights):
        lights = tuple(hard(light) if light.soft else light for light in scene.lights)
        yield "softness of shadows", scene.replace(lights=lights)
    if scene.sky.lights:
        yield "light of the sky", scene.replace(sky=scene.sky.replace(light=False))
    if len(scene.lights) > 1:
        for i, light in enumerate(scene.lights):
            rest = scene.lights[:i] + scene.lights[i + 1 :]
            yield f"light {i + 1}, {type(light).__name__}", scene.replace(lights=rest)
    for effect in scene.post:
        yield effect.LABEL, scene.replace(post=[other for other in scene.post if other is not effect])
    if any(m.textured or m.relief for m in scene.materials):
        yield "maps", scene.replace(node=relabelled(scene.node, Material.without_maps))
    if scene.path_traced or scene.whitted:
        yield "bounces of light", scene.replace(bounces=0)
    if scene.bounces > 1 and (scene.path_traced or scene.whitted):
        yield f"bounce {scene.bounces}", scene.replace(bounces=scene.bounces - 1)
    if scene.quality.samples > 1:
        yield "anti-aliasing", scene.replace(quality=scene.quality.replace(samples=1))
    elif scene.quality.edges == "distance":
        yield "anti-aliasing", scene.replace(quality=scene.quality.replace(edges="samples"))


def _switches(parts: list[Any]) -> list[str]:
    """Names of attributes that are True in some part."""
    found: dict[str, None] = {}
    for part in parts:
        found.update((name, None) for name, value in part.arguments().items() if value is True)
    return list(found)


def ablate(
    scene: Scene,
    renderer: Any,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    repeats: int = 9,
    seed: int = 1,
    progress: Progress | None = None,
) -> list[Effect]:
    """Measure each effect of a scene, most expensive first.

    renderer : an open renderer. repeats, seed : as for `raymarch.cost.sweep.sweep`; all variants take turns.

    Raises CostError for a scene without effects.
    """
    tell = progress or (lambda _what, _share: None)
    variants = list(ablations(scene))
    if not variants:
        raise CostError("the scene has no effects", legal="shadows, fog, occlusion, light of the sky, several lights")
    renderer.kept = max(renderer.kept, 4 * (len(variants) + 1))
    with renderer.resources.scenes_apart():
        complete = _figures(scene, renderer, time, params)
        found = []
        for i, (name, made) in enumerate(variants):
            tell(f"without {name}", 0.5 * i / len(variants))
            without = _figures(made, renderer, time, params)
            differences = picture_errors(flip(complete["color"], without["color"]))
            costs = {n: complete[n] - without[n] for n in ("evaluations", "texture_bytes", "shader_bytes")}
            found.append(Effect(name, color=complete["color"], color_without=without["color"], **costs, **differences))
        scenes = [scene, *(made for _, made in variants)]
        times: list[list[float]] = [[] for _ in scenes]
        for done, k in enumerate(turns(len(scenes), repeats, seed)):
            tell("time", 0.5 + 0.5 * done / (repeats * len(scenes)))
            times[k].append(timed(scenes[k], Setting("", scenes[k].quality), renderer, time, params)[0])
    for effect, others in zip(found, times[1:], strict=True):
        effect._frames = times[0]
        effect._differences = [a - b for a, b in zip(times[0], others, strict=True)]
    return sorted(found, key=lambda e: -e.milliseconds.value)


def _figures(scene: Scene, renderer: Any, time: float, params: Any) -> dict[str, Any]:
    """Measurements that need no clock. Two frames are rendered, so that no frame that is timed later is the first."""
    size = renderer.size
    color = renderer.render(scene, time, params, ("color",)).array("color")
    renderer.render(scene, time, params, ("color",))
    planned = plan(scene, size=size, device=renderer.resources.device)
    shader = assemble(planned)
    data = sum(samples.nbytes for samples in shader.samples.values())
    cells = sum(level.size(size)[0] * level.size(size)[1] for level in planned.marching.schedule.levels)
    scene_passes = [p for p in planned.passes if p.often != "level" and p.effect is None]
    targets = {p.pair if p.history else p.name: p.textures * (2 if p.history else 1) for p in scene_passes}
    values = set_values(planned.parameters, params, time)
    effects = [p for p in planned.passes if p.effect is not None]
    for effect in (p.effect for p in effects if p.effect is not None):
        cells += sum(stage.size[0] * stage.size[1] for stage in effect.stages(effect.numbers(values), size))
    return {
        "color": color,
        "evaluations": evaluations_of(scene, renderer, time, params),
        "texture_bytes": data + TEXEL * (cells + sum(targets.values()) * size[0] * size[1]),
        "shader_bytes": len(shader.text().encode()) + sum(len(assemble_effect(p).text().encode()) for p in effects),
    }


def evaluations_of(scene: Scene, renderer: Any, time: float = 0.0, params: Mapping[str, Any] | None = None) -> float:
    """Mean evaluations of the field and its gradient per pixel: the mean of `evaluation_counts`."""
    return float(evaluation_counts(scene, renderer, time, params).mean())


def evaluation_counts(
    scene: Scene, renderer: Any, time: float = 0.0, params: Mapping[str, Any] | None = None
) -> NDArray[np.float32]:
    """Evaluations of the field and its gradient by all rays of a pixel, shadows and reflections among them, (H, W).

    See `raymarch.shader.tally`.
    """
    with Renderer(renderer.size, context=renderer.context) as own:
        own.resources.device = renderer.resources.device
        counts = own.render(scene, time, params, ("all_evaluations",)).array("all_evaluations")
        return np.asarray(counts, np.float32)


DEAREST = 3
"""Number of effects that `dearest` returns."""
SMALL = 160 * 90
"""Pixels of the pictures by which `dearest` measures, at most."""


@dataclass(frozen=True, slots=True)
class Saving:
    """What a picture saves without an effect: shares of its evaluations, and of its CPU time or, on a GPU, its time."""

    name: str
    evaluations: float
    time: float
    kind: str

    @property
    def words(self) -> str:
        """As a sentence's part."""
        return f"{self.name}: {self.evaluations:.0%} of the evaluations, {self.time:.0%} of the {self.kind}"


def dearest(
    scene: Scene,
    size: tuple[int, int],
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    backend: str = "auto",
    device: int | None = None,
) -> list[Saving]:
    """The dearest effects of a scene and what leaving out each would save, measured in small pictures.

    The most expensive come first. Effects are those of `ablations`; the list is empty for a scene without any.
    Evaluations include those of all rays of a pixel.
    """
    scale = min(1.0, (SMALL / (size[0] * size[1])) ** 0.5)
    small = max(1, round(size[0] * scale)), max(1, round(size[1] * scale))
    variants = [("", scene), *ablations(scene)]
    with Renderer(small, backend, device) as renderer, renderer.resources.scenes_apart():
        renderer.kept = max(renderer.kept, 4 * len(variants))
        software = renderer.context.driver.is_software
        counts, times = [], np.zeros((len(variants), REPEATS))
        for _, made in variants:
            counts.append(evaluations_of(made, renderer, time, params) * made.quality.samples)
            renderer.render(made, time, params).array("color")
        for turn, (k, (_, made)) in product(range(REPEATS), enumerate(variants)):
            start = process_time()
            frame = renderer.render(made, time, params)
            frame.array("color")
            times[k, turn] = 1e3 * (process_time() - start) if software else frame.milliseconds
    spent = np.median(times, axis=1)
    kind = "CPU time" if software else "time"
    found = [
        Saving(name, 1.0 - count / max(counts[0], 1e-9), 1.0 - float(took / max(spent[0], 1e-9)), kind)
        for (name, _), count, took in zip(variants[1:], counts[1:], spent[1:], strict=True)
    ]
    return sorted(found, key=lambda saving: -saving.time)[:DEAREST]


def table(effects: list[Effect], name: str) -> Table:
    """The effects as a table, most expensive first."""
    drawn = Table(title=f"{name}: cost of each effect, and change of the picture", title_justify="left", box=None)
    headings = ("ms", "95 %", "evals", "texture bytes", "shader bytes", "flip p99", "flip max", "bad region")
    drawn.add_column("effect", no_wrap=True)
    for heading in headings:
        drawn.add_column(heading, justify="right", no_wrap=True)
    for e in effects:
        t = e.milliseconds
        span = f"{t.low:.2f} to {t.high:.2f}"
        flips = (f"{e.flip_p99:.3f}", f"{e.flip_max:.3f}", str(e.flip_region))
        drawn.add_row(
            e.name, f"{t.value:.2f}", span, f"{e.evaluations:.1f}", str(e.texture_bytes), str(e.shader_bytes), *flips
        )
    return drawn
