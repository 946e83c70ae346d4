"""The samples of one ray, as the shader takes them, and their figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.plots import blank
from raymarch.errors import CostError, SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import short
from raymarch.gpu.draw_call import CENTRE
from raymarch.gpu.prepare import Prepared, assembled
from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import ParamValue, Values, set_values
from raymarch.scene.quality import SINGLE_PASS
from raymarch.scene.scene import Scene, as_scene
from raymarch.sdf.node import Node
from raymarch.truth.large import field_of
from raymarch.truth.rays import unit

Array = NDArray[np.float64]

KINDS = ("search", "refinement", "undone", "start")
"""What became of a sample: the march moved to it, it refines the hit, the step to it was undone, the start of a ray."""

COLORS = {"search": "#0066a8", "refinement": "#00795a", "undone": "#d95f02", "start": "#5f6770"}

GRID = 160
"""Points of the field in the figure, along the ray."""

HIGH = 0.5
"""Height of the upper part of the figure over its width."""


@dataclass(frozen=True, eq=False, repr=False)
class RaySamples:
    """The samples of the field that the shader takes along the ray of a pixel, in order.

    Attributes
    ----------
    t : (N,), distance along the ray. value : (N,), the field there, negated if the ray starts inside of a solid.
    ahead : (N,), how far the ray is known to be free from there on: `value`, and more with tracer="advance".
    kind : (N,), indices of `KINDS`.
    hit : distance along the ray at which it ends on a surface, inf for a miss.
    origin, direction : (3,), of the ray, in the coordinates of the scene; the direction has length 1.
    tracer : its name, as in `Quality(tracer=...)`. solved : number of solids in closed form, which take no samples.
    """

    t: Array
    value: Array
    ahead: Array
    kind: NDArray[np.int64]
    hit: float
    origin: Array
    direction: Array
    tracer: str
    solved: int

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the field by the shader; that at the camera is made once per frame on the CPU."""
        return int(np.sum(self.kind != KINDS.index("start")))

    def __repr__(self) -> str:
        end = "no hit" if np.isinf(self.hit) else f"hit at {self.hit:.6g}"
        return f"<RaySamples: {self.tracer}, {self.evaluations} evaluations, {end}>"


@checked
def ray_samples(
    scene: Scene | Node,
    pixel: tuple[int, int],
    size: tuple[int, int] = (160, 90),
    tracer: str | None = None,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    backend: str = "auto",
) -> RaySamples:
    """The samples of the field along the ray of a pixel, as the shader of the scene takes them.

    Parameters
    ----------
    scene : a Scene, or a solid in a default one.
    pixel : (column, row) in the picture; row 0 is its top.
    size : (width, height) of the picture in pixels, as many as the ray has samples at least. Widths of hits depend on
        it.
    tracer : replaces that of the scene's Quality. None keeps it.
    time, params, backend : as in `rm.render`.

    Returns
    -------
    RaySamples
        The ray of the pixel's centre, without cones before it.

    Raises
    ------
    SceneError : a pixel outside of the picture, an unknown tracer.
    CostError : more samples than pixels.
    """
    scene = as_scene("ray_samples", scene)
    column, row = _pixel(pixel, size)
    quality = scene.quality if tracer is None else scene.quality.replace(tracer=tracer, omega=None)
    quality = quality.replace(**SINGLE_PASS, samples=1, edges="samples", rays="computed")
    with Renderer(size, backend) as renderer:
        made = plan(scene.replace(quality=quality), ("ray",), size, device=renderer.resources.device)
        pose, samples, end = _drawn(renderer, assembled(made), (column, row), set_values(made.parameters, params, time))
    hit, taken = float(end[0, 0]), int(end[0, 1])
    if taken > size[0] * size[1]:
        raise CostError(f"the ray takes {taken} samples", legal=f"up to one for each of the {size[0]}x{size[1]} pixels")
    t, ahead, behind, kind = samples[:taken].T
    origins, directions = pose.rays(np.array(column), np.array(row), size)
    first = 1 if taken and kind[0] == KINDS.index("start") and ahead[0] == 0.0 else 0  # where nothing was evaluated
    return RaySamples(
        t[first:].astype(np.float64),
        behind[first:].astype(np.float64),
        ahead[first:].astype(np.float64),
        np.asarray(kind[first:], np.int64),
        hit if hit >= 0.0 else np.inf,
        np.array(origins, np.float64).reshape(3),
        np.array(directions, np.float64).reshape(3),
        made.marching.tracer,
        len(made.analytic.solved) if made.analytic.used else 0,
    )


def _drawn(renderer: Renderer, ready: Prepared, pixel: tuple[int, int], values: Values) -> tuple[Pose, Any, Any]:
    """The pose of a picture, and what the pass "ray" draws: the samples of a pixel's ray in order, and its end."""
    (chosen,), size = ready.plan.passes, renderer.size
    pose = ready.pose(values, size[0] / size[1])
    own = {**CENTRE, "u_ray_pixel": (pixel[0] + 0.5, size[1] - pixel[1] - 0.5)}
    target = renderer.resources.target(chosen.name, size, chosen.textures)
    program, _ = renderer.resources.program(ready, chosen.name)
    program.draw(target, {**renderer.inputs(ready, values, pose).uniforms, **own})
    samples, end = (target.read(k)[::-1].reshape(-1, 4) for k in range(chosen.textures))  # the first at the bottom left
    return pose, samples, end


def _pixel(pixel: Any, size: tuple[int, int]) -> tuple[int, int]:
    legal = f"(column, row), from (0, 0) to ({size[0] - 1}, {size[1] - 1}) for size={size}"
    try:
        column, row = (int(part) for part in pixel)
        whole = (column, row) == tuple(pixel)
    except (TypeError, ValueError):
        raise SceneError(f"pixel = {short(pixel)}", legal=legal) from None
    if not whole or not (0 <= column < size[0] and 0 <= row < size[1]):
        raise SceneError(f"pixel = {short(pixel)}", legal=legal)
    return column, row


@checked
def plot_ray(
    scene: Scene | Node,
    pixel: tuple[int, int],
    size: tuple[int, int] = (160, 90),
    tracer: str | None = None,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    backend: str = "auto",
) -> Any:
    """The figure of one ray: the empty spheres of its samples over the field, and the field along the ray.

    Parameters
    ----------
    scene : a Scene, or a solid in a default one.
    pixel : (column, row) in the picture; row 0 is its top.
    size : (width, height) of the picture in pixels.
    tracer : replaces that of the scene's Quality, see `Quality`. None keeps it.
    time, params, backend : as in `rm.render`.

    Returns
    -------
    matplotlib.figure.Figure
        `figure.savefig("ray.png")` writes it. Above: the plane of the ray that is nearest to upright, level sets of the
        field, and a circle for each sample. Below: the field along the ray, and what each sample proves empty.

    Raises
    ------
    SceneError : a pixel outside of the picture, an unknown tracer.
    CostError : matplotlib is not installed.

    Notes
    -----
    The samples are those of the shader, in float32; the field behind them is evaluated in float64. Solids in closed
    form take no samples: `Quality(analytic=False)` marches them.

    Examples
    --------
    >>> rm.plot_ray(rm.torus(), pixel=(80, 40), tracer="plain").savefig("ray.png")
    """
    scene = as_scene("plot_ray", scene)
    found = ray_samples(scene, pixel, size, tracer, time, params, backend)
    values = set_values(scene.parameters, params, time)
    drawn = blank(8.0, 7.0)
    upper, lower = drawn.subplots(2, 1, height_ratios=(3, 2), sharex=True)
    field, shown = field_of(scene, values), _shown(found)
    _draw_plane(upper, found, field, scene.pose(values, size[0] / size[1]).frame[:, 1], shown)
    _draw_values(lower, found, field, shown)
    counts = f"{found.evaluations} evaluations"
    if found.solved:
        solids = "1 solid in closed form takes" if found.solved == 1 else f"{found.solved} solids in closed form take"
        counts += f" ({solids} none)"
    words = [f"pixel ({pixel[0]}, {pixel[1]}) of {size[0]}x{size[1]}: {found.tracer}", counts]
    words += [f"{int(np.sum(found.kind == 2))} undone"] if np.any(found.kind == 2) else []
    words.append("no hit" if np.isinf(found.hit) else f"hit at {found.hit:.5g}")
    upper.set_title(", ".join(words), fontsize=10)
    return drawn


def _shown(found: RaySamples) -> tuple[float, float]:
    """The part of the ray that the figure shows; the sphere around the camera is cut where it is most of it."""
    known = found.t + np.maximum(found.value, 0.0)
    kept = found.t[found.kind != KINDS.index("undone")]
    end = 1.1 * (found.hit if np.isfinite(found.hit) else kept.max(initial=0.0) or known.max(initial=1.0))
    later = found.kind != KINDS.index("start")
    first = np.min((found.t - np.abs(found.value))[later], initial=end)
    begin = first - 0.15 * (end - first)
    return (float(begin) if 0.4 * end < begin < 0.9 * end else 0.0), float(end)


def _draw_plane(axes: Any, found: RaySamples, field: Any, up: Array, shown: tuple[float, float]) -> None:
    """The spheres of the samples in a plane through the ray."""
    from matplotlib.patches import Circle

    beside = unit((up - (up @ found.direction) * found.direction)[None])[0]
    half = 0.5 * HIGH * (shown[1] - shown[0])
    along, across = np.linspace(*shown, GRID), np.linspace(-half, half, round(HIGH * GRID))
    points = found.origin + along[None, :, None] * found.direction + across[:, None, None] * beside
    values = field.distance(points.reshape(-1, 3)).reshape(len(across), len(along))
    axes.contour(along, across, values, levels=_levels(values), colors="#b8bec4", linewidths=0.6)
    axes.contourf(along, across, values, levels=(-np.inf, 0.0), colors=["#d9c7a5"])
    axes.contour(along, across, values, levels=(0.0,), colors="#6b5a36", linewidths=1.2)
    axes.axhline(0.0, color="black", lw=0.8)
    for t, r, kind in zip(found.t, found.value, found.kind, strict=True):
        style = {"color": COLORS[KINDS[kind]], "ls": "--" if KINDS[kind] == "undone" else "-"}
        axes.add_patch(Circle((t, 0.0), abs(r), fill=False, lw=0.9, **style))
        axes.plot([t], [0.0], ".", ms=4, color=style["color"])
    if np.isfinite(found.hit):
        axes.plot([found.hit], [0.0], "x", color="black", ms=7)
    axes.set(xlim=shown, ylim=(-half, half), box_aspect=HIGH, ylabel="across the ray")


def _levels(values: Array) -> Array:
    high = float(np.max(np.abs(values), initial=1e-9))
    step = 10.0 ** np.floor(np.log10(high / 4.0))
    step *= 5.0 if high / step > 40 else 2.0 if high / step > 20 else 1.0
    return np.arange(step, high + step, step)


def _draw_values(axes: Any, found: RaySamples, field: Any, shown: tuple[float, float]) -> None:
    """The field along the ray, each sample with the interval that it proves empty."""
    t = np.linspace(*shown, 4 * GRID)
    values = field.distance(found.origin + t[:, None] * found.direction)
    inside = (
        np.isfinite(found.hit) and field.distance((found.origin + 0.999 * found.hit * found.direction)[None])[0] < 0.0
    )
    axes.plot(t, -values if inside else values, color="black", lw=1.2, label="the field")
    axes.axhline(0.0, color="black", lw=0.6)
    for name in dict.fromkeys(KINDS[kind] for kind in found.kind):
        which = found.kind == KINDS.index(name)
        c, r, free = found.t[which], found.value[which], found.ahead[which]
        axes.plot(c, r, "o", ms=4, color=COLORS[name], label=name)
        for one, value, ahead in zip(c, r, free, strict=True):
            axes.fill([one - abs(value), one, one + abs(value)], [0.0, value, 0.0], color=COLORS[name], alpha=0.12)
            if ahead > 1.001 * abs(value):
                axes.plot([one, one + ahead], [0.0, 0.0], color=COLORS[name], lw=3, alpha=0.5, solid_capstyle="butt")
    seen = values[(t >= shown[0]) & np.isfinite(values)]
    reach = float(np.max(np.abs(seen), initial=1e-9))
    axes.set(ylim=(-0.15 * reach, 1.1 * reach), box_aspect=0.6 * HIGH)
    axes.set(xlabel="distance along the ray", ylabel="value of the field")
    axes.grid(alpha=0.25, lw=0.4)
    axes.legend(fontsize=8)
