"""A picture as a figure of matplotlib: with a colour bar, the box with ticks, and a scale bar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import CostError, SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import real, short
from raymarch.expr.srgb import linear_to_srgb
from raymarch.files import import_optional
from raymarch.gpu.frame import Frame
from raymarch.gpu.renderer import Renderer
from raymarch.scene.camera import Pose
from raymarch.scene.data import colormap
from raymarch.scene.parameter import ParamValue
from raymarch.scene.scene import Scene, as_scene
from raymarch.sdf.domain import ColorLike
from raymarch.sdf.node import Node

Array = NDArray[np.float64]

INK = "#202428"
POINTS = 120
"""Points of an edge of the box, each drawn where no surface hides it."""
LONGEST = 0.3
"""Length of a scale bar of its own choice, as a fraction of the width of the picture, at most."""


@checked
def figure(
    scene: Scene | Node,
    size: tuple[int, int] = (640, 480),
    colors: str | Sequence[ColorLike] | None = None,
    low: float = 0.0,
    high: float = 1.0,
    label: str = "",
    box: Any = None,
    axes: Sequence[str] = ("x", "y", "z"),
    unit: str = "",
    scale_bar: float | bool = False,
    samples: int = 16,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    backend: str = "auto",
) -> Any:
    """The picture of a scene as a figure for a publication.

    Parameters
    ----------
    scene : a Scene, or a solid in a default one.
    size : (width, height) of the picture in pixels; 100 of them are an inch.
    colors, low, high : of the colour bar, as they were given to `colormap`. None draws no bar.
    label : text beside the bar, such as "temperature (K)".
    box : (lower, upper), corners of a box whose edges are drawn with ticks where no surface hides them; True is the box
        of the scene's solid. None draws no box.
    axes : the names of the axes at the box.
    unit : of length, written behind them and at the scale bar.
    scale_bar : length of a bar in the plane of the middle of the box, or of the scene; True chooses a round one. Only
        an orthographic camera shows lengths alike at all distances.
    samples : rays per pixel.
    time, params, backend : as in `render`.

    Returns
    -------
    matplotlib.figure.Figure
        `figure.savefig("figure.pdf")` writes it; `figure.axes[0]` shows the picture, in pixels, for further marks.
        It is a picture in the cell of a notebook.

    Raises
    ------
    SceneError : a box without an end, arguments of another kind.
    CostError : matplotlib is not installed.

    Notes
    -----
    The colours of a surface are those of the bar only without light: `Material.unlit`.

    Examples
    --------
    >>> rm.figure(rm.torus(), colors="viridis", low=0, high=5, label="speed (m/s)", box=True).savefig("figure.pdf")
    """
    import_optional("figure", "matplotlib", "report", CostError)
    from raymarch.export.notebook_figure import NotebookFigure  # matplotlib takes time, and is optional

    scene = as_scene("figure", scene)
    corners = _box_of(scene, box)
    with Renderer(size, backend) as renderer:
        made = scene.replace(quality=scene.quality.replace(samples=samples, edges="samples"))
        frame = renderer.render(made, time, params, ("color", "depth"))
        image, depth, pose = np.asarray(frame.image()), frame.depth, _pose(frame)
    width, height = size
    drawn = NotebookFigure(figsize=(width / 100 + 1.2 * (colors is not None), height / 100), layout="constrained")
    shown = drawn.subplots()
    shown.imshow(image, interpolation="none")
    shown.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    shown.set_axis_off()
    if corners is not None:
        _draw_box(shown, corners, pose, depth, [f"{name} ({unit})" if unit else name for name in axes])
    if scale_bar:
        middle = scene.middle[0] if corners is None else 0.5 * (corners[0] + corners[1])
        _draw_scale(shown, pose, size, np.asarray(middle, np.float64), scale_bar, unit)
    if colors is not None:
        _draw_colors(drawn, shown, colors, low, high, label)
    return drawn


def _pose(frame: Frame) -> Pose:
    assert frame.pose is not None
    return frame.pose


def _box_of(scene: Scene, box: Any) -> tuple[Array, Array] | None:
    if box is None or box is False:
        return None
    legal = "True, or (lower, upper), two points"
    if box is True:
        lower, upper = scene.node.bounds
        if not np.all(np.isfinite([lower, upper])):
            raise SceneError("figure: box=True of a solid without end", legal="box=(lower, upper)")
        return lower, upper
    try:
        lower, upper = (np.asarray(corner, np.float64).reshape(3) for corner in box)
    except (TypeError, ValueError):
        raise SceneError(f"figure: box = {short(box)}", legal=legal) from None
    if not np.all(lower < upper) or not np.all(np.isfinite([lower, upper])):
        raise SceneError(f"figure: box = {short(box)}", legal=f"{legal}, the first below the second")
    return lower, upper


def _draw_box(shown: Any, box: tuple[Array, Array], pose: Pose, depth: NDArray[Any], names: Sequence[str]) -> None:
    """The edges of a box, where no surface is before them, and ticks at one edge of each axis."""
    height, width = depth.shape
    middle = pose.place(0.5 * (box[0] + box[1]), (width, height))
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        edges = []
        for ends in product((0, 1), repeat=2):
            start = np.array([box[0][i] for i in range(3)])
            for i, end in zip(others, ends, strict=True):
                start[i] = box[end][i]
            stop = start.copy()
            stop[axis] = box[1][axis]
            _draw_edge(shown, start, stop, pose, depth)
            edges.append((start, stop))
        if middle is not None:
            _draw_ticks(shown, edges, axis, names[axis], pose, (width, height), np.array(middle))


def _draw_edge(shown: Any, start: Array, stop: Array, pose: Pose, depth: NDArray[Any]) -> None:
    height, width = depth.shape
    places = []
    for share in np.linspace(0.0, 1.0, POINTS):
        point = start + share * (stop - start)
        at = pose.place(point, (width, height))
        seen = at is not None and -0.5 <= at[0] < width - 0.5 and -0.5 <= at[1] < height - 0.5
        if at is not None and seen:
            row, column = round(at[1]), round(at[0])
            origins, _ = pose.rays(np.array(column), np.array(row), (width, height))
            seen = bool(np.linalg.norm(point - origins) <= 1.002 * depth[row, column])
        places.append(at if at is not None and seen else (np.nan, np.nan))
    shown.plot(*np.transpose(places), color=INK, lw=0.7, alpha=0.6, solid_capstyle="round")


def _draw_ticks(
    shown: Any,
    edges: Sequence[tuple[Array, Array]],
    axis: int,
    name: str,
    pose: Pose,
    size: tuple[int, int],
    middle: Array,
) -> None:
    """Ticks and the name of an axis at the outermost of its edges: the lowest, or the leftmost if it is upright."""
    from matplotlib.ticker import MaxNLocator

    best = None
    for start, stop in edges:
        places = [pose.place(point, size) for point in (start, stop)]
        if places[0] is None or places[1] is None:
            continue
        a, b = np.array(places[0]), np.array(places[1])
        upright = abs(b[1] - a[1]) > 1.5 * abs(b[0] - a[0])
        out = 0.5 * (a + b) - middle
        score = -out[0] if upright else out[1]
        if best is None or score > best[0]:
            best = float(score), start, stop, a, b
    if best is None or np.linalg.norm(best[4] - best[3]) < 20.0:
        return
    _, start, stop, a, b = best
    normal = np.array([-(b - a)[1], (b - a)[0]]) / np.linalg.norm(b - a)
    normal *= np.sign(normal @ (0.5 * (a + b) - middle)) or 1.0
    low, high = start[axis], stop[axis]
    style = {"ha": "center", "va": "center", "fontsize": 8, "color": INK}
    for value in MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high):
        if low <= value <= high:
            point = start.copy()
            point[axis] = value
            if (at := pose.place(point, size)) is not None:
                to = np.array(at) + 5.0 * normal
                shown.plot([at[0], to[0]], [at[1], to[1]], color=INK, lw=0.8, clip_on=False)
                shown.text(*(np.array(at) + (13.0 + 6.0 * abs(normal[0])) * normal), f"{value:g}", **style)
    turned = np.degrees(np.arctan2(-(b - a)[1], (b - a)[0]))
    turned = (turned + 75.0) % 180.0 - 75.0  # never from top to bottom
    shown.text(*(0.5 * (a + b) + (30.0 + 10.0 * abs(normal[0])) * normal), name, rotation=turned, **style)


def _draw_scale(shown: Any, pose: Pose, size: tuple[int, int], middle: Array, given: Any, unit: str) -> None:
    """A bar of a length in the plane through a point, perpendicular to the view."""
    away = 1.0 if pose.orthographic else float((middle - pose.position) @ pose.view)
    if away <= 0.0:
        raise SceneError("figure: scale_bar, the middle of the box is behind the camera", legal="scale_bar=False")
    pixel = pose.pixel(size[1]) * away
    longest = LONGEST * size[0] * pixel
    if given is True:
        power = 10.0 ** np.floor(np.log10(longest))
        length = float(power * max(step for step in (1, 2, 5) if step * power <= longest))
    else:
        length = real("figure: scale_bar", given, 0.0, np.inf, "a length > 0, or True")
        if not 2.0 * pixel <= length <= 0.9 * size[0] * pixel:
            what = f"figure: scale_bar = {length:g}, the picture shows {size[0] * pixel:.4g}"
            raise SceneError(what, legal="a length that fits into the picture")
    left, bottom = 0.05 * size[0], 0.94 * size[1]
    right = left + length / pixel
    shown.plot([left, right], [bottom, bottom], color=INK, lw=2.5, solid_capstyle="butt")
    words = f"{length:g} {unit}".strip()
    shown.text(0.5 * (left + right), bottom - 6, words, ha="center", va="bottom", fontsize=9, color=INK)


def _draw_colors(drawn: Any, shown: Any, colors: Any, low: float, high: float, label: str) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    rows = linear_to_srgb(np.clip(colormap(np.linspace(0.0, 1.0, 256), colors), 0.0, 1.0))
    if low == high:
        raise SceneError(f"figure: low = high = {short(low)}", legal="two different numbers")
    if low > high:
        rows, low, high = rows[::-1], high, low
    mapped = ScalarMappable(Normalize(low, high), ListedColormap(rows))
    drawn.colorbar(mapped, ax=shown, label=label, shrink=0.8)
