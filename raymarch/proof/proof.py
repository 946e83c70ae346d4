"""`rm.prove`: a proof about the hit of each pixel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import numbers, short, switch
from raymarch.expr.walk import topological
from raymarch.gpu.renderer import Renderer
from raymarch.proof.facts import wrong_facts
from raymarch.proof.pixels import coverage
from raymarch.proof.rays import Whole
from raymarch.proof.reported import Reported, Solid
from raymarch.proof.search import CONTRADICTED, OPEN, PROVED
from raymarch.proof.shadows import Lit, Shadows, lit_pixels, shadows_of
from raymarch.scene.legal import warn_of_values
from raymarch.scene.parameter import ParamValue, Values, set_values
from raymarch.scene.scene import Scene, as_scene
from raymarch.scene.shown import Shown
from raymarch.sdf.node import Node

SIZE = (320, 180)
"""Default size of a picture that is rendered."""

MOST = 1 << 24
"""Most pixels of a proof."""

COLORS = {PROVED: (58, 110, 84), CONTRADICTED: (214, 40, 40), OPEN: (240, 190, 60)}


@dataclass(frozen=True, eq=False, repr=False)
class Proof:
    """What is proved about the pixels of a picture of H rows and W columns; row 0 is the top.

    Attributes
    ----------
    state : (H, W) uint8. 0 proved: more than the tolerance before the reported hit, no point of the ray is deeper in
        the solid than the tolerance, and the surface is within the tolerance of the hit; or no hit was reported, and no
        point of the ray is deeper than the tolerance. 1 contradicted: a point of the ray before the hit is in the
        solid, and was not shown to be less deep; or no surface is within the tolerance of the hit. 2 open: neither was
        shown.
    grazing : (H, W) bool. Proved hits whose surface is within the tolerance in space, but not along the ray: there the
        field of the others changes its sign.
    low, high : (H, W) float64. No surface lies before `low` on the ray, and one before `high`; inf if none is known.
    depth : (H, W) float64, the reported hits.
    within : (H, W) float64, the tolerance as a length.
    evaluations : (H, W) int64, enclosures of operands that were computed.
    reasons : what kept pixels open, with their number.
    tolerance : the tolerance as it was given.
    wrong_facts : facts of definitions that are certainly wrong, each with the definition's file and line. Asked are the
        user's definitions, and all if a pixel is contradicted. They are sought when this is first read.
    coverage : with `pixels="whole"`, two arrays (H, W), 0 to 1: the least and the greatest part of each pixel that the
        solid covers; else None.
    assumed : what the proof takes from definitions: the constants of shapes that solve an equation in a loop, and of
        `glsl_node`, whose twin is taken for its GLSL.
    estimates : the shapes and operators whose field is an estimate. Rays end where it is small, which may be before its
        surface: such hits are contradicted.
    shadows : with `shadows=True`, what is proved about each light with a hard shadow.
    """

    state: NDArray[np.uint8]
    grazing: NDArray[np.bool_]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    depth: NDArray[np.float64]
    within: NDArray[np.float64]
    evaluations: NDArray[np.int64]
    reasons: Mapping[str, int]
    tolerance: str = field(default="0.05px")
    assumed: tuple[str, ...] = ()
    estimates: tuple[str, ...] = ()
    coverage: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    shadows: tuple[Shadows, ...] = ()
    _asked: tuple[Node, Values] | None = None

    @cached_property
    def wrong_facts(self) -> tuple[str, ...]:
        return () if self._asked is None else wrong_facts(*self._asked, every=bool(self.contradicted))

    def __getstate__(self) -> dict[str, Any]:
        """Plain data: a pickled proof knows the wrong facts, not the scene."""
        return {**vars(self), "wrong_facts": self.wrong_facts, "_asked": None}

    @property
    def share(self) -> float:
        """Proved pixels over all pixels, 0 to 1."""
        return float(np.mean(self.state == PROVED))

    @property
    def proved(self) -> int:
        return int(np.sum(self.state == PROVED))

    @property
    def contradicted(self) -> int:
        return int(np.sum(self.state == CONTRADICTED))

    @property
    def open(self) -> int:
        return int(np.sum(self.state == OPEN))

    def __repr__(self) -> str:
        return f"<Proof: {self}>"

    def __str__(self) -> str:
        height, width = self.state.shape
        what = self.tolerance.replace("px", " px")
        said = (
            f"nothing deeper than {what} lies more than {what} before the hit, and the surface is within {what} of it"
        )
        if not np.isfinite(self.depth).any():
            said = f"no hit is reported, and nothing deeper than {what} lies on the ray"
        parts = [f"{self.proved:,} of {self.state.size:,} pixels proved at {width}x{height}: {said}"]
        if self.grazing.any():
            parts += [f"for {int(self.grazing.sum()):,} of them in space, but not along the ray, which grazes it"]
        if self.coverage is not None:
            low, high = self.coverage
            whole, empty = int(np.sum(low == 1.0)), int(np.sum(high == 0.0))
            parts += [
                f"{whole:,} pixels are covered, {empty:,} empty, {low.size - whole - empty:,} hold an edge or may"
            ]
        of = f" (rays end where an estimate is small: {', '.join(self.estimates)})" if self.estimates else ""
        parts += [f"{self.contradicted:,} contradicted{of}"] if self.contradicted else []
        parts += [f"{self.open:,} open"] if self.open else []
        parts += [str(each) for each in self.shadows]
        return "; ".join(parts)

    def image(self) -> Image.Image:
        """Proved pixels green, contradicted ones red, open ones yellow.

        Returns
        -------
        PIL.Image.Image
        """
        picture = np.zeros((*self.state.shape, 3), np.uint8)
        for state, color in COLORS.items():
            picture[self.state == state] = color
        return Image.fromarray(picture)

    def as_dict(self) -> dict[str, Any]:
        """Figures for JSON.

        Returns
        -------
        dict[str, Any]
        """
        height, width = self.state.shape
        rows, columns = np.nonzero(self.state == CONTRADICTED)
        return {
            "size": [width, height],
            "tolerance": self.tolerance,
            "pixels": self.state.size,
            "proved": self.proved,
            "contradicted": self.contradicted,
            "open": self.open,
            "grazing": int(self.grazing.sum()),
            "share": self.share,
            "evaluations": float(self.evaluations.mean()),
            "reasons": dict(self.reasons),
            "assumed": list(self.assumed),
            "estimates": list(self.estimates),
            "wrong_facts": list(self.wrong_facts),
            "shadows": [
                {
                    "light": each.light,
                    "name": each.name,
                    "asked": each.asked,
                    "proved": each.count(PROVED),
                    "contradicted": each.count(CONTRADICTED),
                    "open": each.count(OPEN),
                    "unsearched": each.unsearched,
                }
                for each in self.shadows
            ],
            "contradictions": [
                {
                    "row": int(i),
                    "column": int(j),
                    "hit": _finite(self.depth[i, j]),
                    "free_to": float(self.low[i, j]),
                    "surface_before": _finite(self.high[i, j]),
                }
                for i, j in zip(rows[:100], columns[:100], strict=True)
            ],
        }


def _finite(number: float) -> float | None:
    return float(number) if np.isfinite(number) else None


@checked
def prove(
    scene: Scene | Node,
    frame: Any = None,
    size: tuple[int, int] | None = None,
    tolerance: str | float = "0.05px",
    time: float | None = None,
    params: Mapping[str, ParamValue] | None = None,
    pixels: Literal["center", "whole"] = "center",
    shadows: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Proof:
    """Prove the hits of a picture by intervals that are rounded outwards.

    Parameters
    ----------
    scene : the scene, or a solid in a default one.
    frame : a Frame or a Truth, or any object with `depth`, (H, W): the distance along the ray through the centre of
        each pixel, inf where nothing was hit. None renders the scene. A Frame and a Truth know their solid, its values
        and their camera, unless they were pickled: others than those of this call are refused.
    size : (width, height) in pixels, at most 16,777,216 in all. None is that of the frame, or (320, 180).
    tolerance : "0.05px" is a part of the width of a pixel at the hit; a number is a length in scene units. Above 0.
    time : seconds. None is the time of the frame, or 0.
    params : values of parameters by name, within their ranges; the others keep their defaults.
    pixels : "whole" also bounds the part of each pixel that the solid covers, by beams around all rays of the pixel.
    shadows : True also proves the hard shadow of each light at each proved hit: that the way to the light is free
        where a picture of that light alone is lit, and blocked where it is dark. The picture is drawn here, with the
        scene's quality.
    progress : called with the share that is done, 0 to 1.

    Returns
    -------
    Proof

    Raises
    ------
    SceneError : a frame without depths (H, W) or with NaN, of another size, or that shows something else, a tolerance
        that is not above 0, and arguments of another kind or outside their range.

    Notes
    -----
    The field is that of real numbers, as the definitions state it. The proof needs no Lipschitz constant. Of a union of
    several solids it uses their bounding boxes, unless a box is unknown. It is about the rays through the centres of
    pixels, from the camera's position in float64, up to the distance at which rays end.
    """
    scene = as_scene("prove", scene)
    if pixels not in ("center", "whole"):
        raise SceneError(f"prove: pixels = {short(pixels)}", legal='"center" or "whole"')
    if progress is not None and not callable(progress):
        raise SceneError(f"prove: progress = {short(progress)}", legal="a function of the fraction done, or None")
    share, length, text = _tolerance(tolerance)
    if frame is None:
        with Renderer(_bounded(size or SIZE)) as renderer:
            frame = renderer.render(scene, time or 0.0, params, outputs=("depth",))
    depth = _depths(frame, size)
    shape, at = depth.shape, time if time is not None else getattr(frame, "time", 0.0)
    values = set_values(scene.parameters, params, at, scene.where)
    warn_of_values(scene.node, values.params, values.time)
    pose = scene.pose(values, shape[1] / shape[0])
    _refuse_other(frame, Shown(scene.node, values, pose))
    reported = Reported.of(scene, values, pose, shape[::-1], depth.ravel(), (share, length))
    solid = Solid(scene.node, values)
    stages = _stages(progress, 1 + switch("prove: shadows", shadows) + (pixels == "whole"))
    verdict, reasons, inside = reported.proved(solid, next(stages))
    cast: tuple[Shadows, ...] = ()
    if shadows:
        lit = _lit(scene, values, reported, np.flatnonzero((verdict.state == PROVED) & ~inside), shape)

        def draw(channels: Sequence[Sequence[int]]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
            lights = [[scene.lights[index] for index in own] for own in channels]
            return lit_pixels(scene, lights, shape[::-1], at, params)

        cast = shadows_of(scene, values, scene.far(pose, values), lit, draw, next(stages))
    covered = None
    if pixels == "whole":
        start, end = reported.start.reshape(shape), reported.end.reshape(shape)
        near = _least_beside(np.minimum(depth, end))
        covered = coverage(solid.outside, pose, shape[::-1], near, start, end, next(stages))
    return Proof(
        state=verdict.state.reshape(shape),
        grazing=(verdict.grazing & (verdict.state == PROVED)).reshape(shape),
        low=verdict.low.reshape(shape),
        high=verdict.high.reshape(shape),
        depth=depth,
        within=reported.within.reshape(shape),
        evaluations=verdict.evaluations.reshape(shape),
        reasons=reasons,
        tolerance=text,
        assumed=solid.outside.assumed,
        estimates=_estimates(scene.node),
        coverage=covered,
        shadows=cast,
        _asked=(scene.node, values),
    )


def _estimates(root: Node) -> tuple[str, ...]:
    """The names of nodes whose field is an estimate, though those of their children are none."""
    nodes = topological([root], lambda node: node.children)
    kind = {node: node.facts.exactness == "estimate" for node in nodes}
    return tuple(sorted({node.name for node in nodes if kind[node] and not any(kind[c] for c in node.children)}))


def _stages(progress: Callable[[float], None] | None, count: int) -> Iterator[Callable[[float], None] | None]:
    """The progress of each of some stages, of equal shares."""
    for stage in range(count):
        yield None if progress is None else _stage(progress, stage, count)


def _stage(progress: Callable[[float], None], stage: int, count: int) -> Callable[[float], None]:
    return lambda share: progress((stage + share) / count)


def _lit(scene: Scene, values: Values, reported: Reported, proved: Whole, shape: tuple[int, ...]) -> Lit:
    """The hits of proved pixels, from which rays to lights start."""
    proved = proved[np.isfinite(reported.hit[proved])]
    own = (reported.rays[proved], reported.hit[proved], reported.within[proved], proved)
    return Lit.seen(scene.node, values, *own, shape)


def _least_beside(depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """The least of each pixel and its neighbours."""
    wide = np.pad(depth, 1, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(wide, (3, 3)).min(axis=(2, 3)))


def _bounded(size: Any) -> tuple[int, int]:
    """A size whose rays and verdicts fit into memory; the renderer refuses sides that are no whole numbers."""
    try:
        width, height = size
        pixels = float(width) * float(height)
    except (TypeError, ValueError):
        legal = "(width, height) in pixels, such as (640, 360)"
        raise SceneError(f"prove: size = {short(size)}", legal=legal) from None
    if pixels > MOST:
        raise SceneError(f"prove: size = {short(size)}", legal=f"at most {MOST:,} pixels, which take some 6 GB")
    return width, height


def _tolerance(within: Any) -> tuple[float | None, float, str]:
    """A share of the pixel or None, a length, and the text of a tolerance."""
    legal = 'a share of a pixel such as "0.05px", or a length such as 0.01 in the scene\'s unit, above 0'
    given = within.strip() if isinstance(within, str) else within
    shared = isinstance(given, str) and given.endswith("px")
    try:
        number = np.nan if isinstance(given, bool) else float(given.removesuffix("px") if shared else given)
    except (TypeError, ValueError):
        number = np.nan
    if not (0.0 < number < np.inf):
        raise SceneError(f"prove: tolerance = {short(within)}", legal=legal)
    return (number, 0.0, f"{number:g}px") if shared else (None, number, f"{number:g}")


def _refuse_other(frame: Any, asked: Shown) -> None:
    shown = getattr(frame, "_of", None)
    differs = shown.differs(asked) if isinstance(shown, Shown) else ""
    if differs:
        legal = "a picture of this scene with this time and params, or an object that has its depth alone"
        raise SceneError(f"prove: the frame {differs}", legal=legal)


def _depths(frame: Any, size: tuple[int, int] | None) -> NDArray[np.float64]:
    legal = "a Frame, or an object with depth (H, W), inf where nothing was hit"
    if not hasattr(frame, "depth"):
        raise SceneError(f"prove: frame = {short(frame)}, which has no depth", legal=legal)
    depth = numbers("prove: depth of the frame", frame.depth, legal)
    if depth.ndim != 2 or not depth.size:
        raise SceneError(f"prove: depth of shape {depth.shape}", legal=legal)
    if size is not None and depth.shape != _bounded(size)[::-1]:
        what = f"prove: depth of {depth.shape[1]}x{depth.shape[0]} pixels for size = {short(size)}"
        raise SceneError(what, legal="no size beside a frame, or the frame's (width, height)")
    if np.isnan(depth).any() or (depth < 0.0).any():
        bad = "NaN" if np.isnan(depth).any() else "below 0"
        raise SceneError(f"prove: {int((~(depth >= 0.0)).sum()):,} depths are {bad}", legal=legal)
    _bounded(depth.shape[::-1])
    return depth
