"""Automatic checks of a rendered picture: each returns a doubt, or None."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Doubt
from raymarch.expr.arrays import bound
from raymarch.expr.walk import find
from raymarch.gpu.frame import Frame, all_channels
from raymarch.gpu.prepare import Prepared
from raymarch.plan.hoisting import with_hoisted
from raymarch.plan.objects import misread
from raymarch.plan.unused import is_sampled
from raymarch.scene.camera import Pose
from raymarch.scene.legal import solid_at
from raymarch.scene.light import has_area
from raymarch.scene.origin import ULP
from raymarch.scene.parameter import Values, is_zero
from raymarch.scene.scene import Scene, all_nodes, is_cut_away
from raymarch.scene.studio import GROUND, SAMPLES, in_studio
from raymarch.sdf import levels
from raymarch.sdf.facts import beyond
from raymarch.sdf.sampled_facts import quick_contradictions, stated_by_user

OUT_OF_STEPS = 0.005
"""Fraction of rays that may run out of steps without a doubt: some do at silhouettes and horizons."""

SPARSE = 8
"""Stride, in rows and in columns, of the pixels that are marched again to count rays that run out of steps."""

FEW = 16384
"""Pictures with at most this number of pixels are marched again in full."""

WHITE = 1.0 + 0.5 / 255.0 * 2.4 / 1.055
"""Light that is more than half a step of 8 bits above white, by the slope of the curve of sRGB at 1."""

STARTS = 5
"""Columns and rows of the parallel rays whose starts are asked."""

STARTS_ROUNDED = 8.0
"""Units in the last place by which rounding may move the start of a ray off the surface on which the camera is."""

OVEREXPOSED = 0.05
"""Fraction of the picture that may be clipped to white without a doubt: highlights are. No picture of the
gallery reaches 0.02."""

STATED = 32
"""Number of nodes with facts of the user that are sampled."""


def doubts_of(
    frame: Frame, scene: Scene, ready: Prepared, values: Values, arrived: NDArray[np.bool_] | None
) -> list[Doubt]:
    """All doubts of a frame. arrived : whether each ray, or each of a sparse set, came to an end; None if not known."""
    assert frame.pose is not None
    pose, pixels = frame.pose, frame.size[0] * frame.size[1]
    lost, above = frame._count_odd()
    found: list[Doubt | None] = [*frame.warnings, not_finite(lost, pixels)]
    found += _kept("doubts", _of_scene, scene, ready, values, pose, frame.size)
    white = overexposed(frame.color, scene) if above > OVEREXPOSED * pixels else None
    if white is not None:
        found.append(clipped(white, frame.color, frame.material, scene))
    found.append(dark(frame.color, scene))
    shown, sky = beside_sky(frame.color, scene, _kept("sky", sky_light, scene, ready, values, pose, frame.size))
    if not any(found):
        found.append(of_one_tone(shown, sky, scene))
    if arrived is not None:
        found.append(out_of_steps(arrived, scene))
    missed = bool(np.all(sky)) and not np.any(np.isfinite(frame.depth))
    if missed or (may_be_ground(frame.color, scene) and is_ground(frame.material, scene)):
        found.append(nothing_visible(scene, values, (pose, frame.size)))
    elif not any(found) and is_plain(frame, scene):
        cure = "another place of the camera, as Camera(position=..., target=...)"
        found.append(Doubt("picture", "the picture has one colour: a flat surface fills it", cure))
    return [doubt for doubt in found if doubt is not None]


Made = TypeVar("Made")


def _kept(
    name: str,
    make: Callable[[Scene, Prepared, Values, Pose, tuple[int, int]], Made],
    scene: Scene,
    ready: Prepared,
    values: Values,
    pose: Pose,
    size: tuple[int, int],
) -> Made:
    """What a function makes of all but the picture. That of the last frame is kept."""
    seen = [getattr(pose, part.name) for part in fields(pose)]
    seen = [each.tobytes() if isinstance(each, np.ndarray) else each for each in seen]
    moves = ready.once("moves", id(scene), lambda: (scene, bool(find(scene.expressions(), "time"))))[1]
    key = id(scene), values.time if moves else None, tuple(values.params.items()), size, seen
    return ready.once(name, key, lambda: (scene, make(scene, ready, values, pose, size)))[1]


def _of_scene(scene: Scene, ready: Prepared, values: Values, pose: Pose, size: tuple[int, int]) -> list[Doubt | None]:
    """The doubts of a scene and its camera, whatever the picture shows."""
    found = [*contradicted(scene, values), *moved_otherwise(scene, values), noisy(scene)]
    found += [inside(ready, values, pose, size), *ready.plan.without_effect]
    return [*found, coarse(ready, values, pose, size[1]), too_thin(ready, values, pose)]


def sparse_size(size: tuple[int, int]) -> tuple[int, int]:
    """(width, height) of the sparse set of rays that is marched again."""
    every = SPARSE if size[0] * size[1] > FEW else 1
    return -(-size[0] // every), -(-size[1] // every)


def nothing_visible(scene: Scene, values: Values, picture: tuple[Pose, tuple[int, int]]) -> Doubt | None:
    """The doubt of a picture without a hit. None if no part of the scene is bounded at this time and with these
    parameters, since a miss is then plausible.

    picture : the camera, and (width, height) in pixels.
    """
    now = scene.replace(node=solid_at(scene.node, values))
    if now.node.facts.empty:
        return Doubt("picture", "nothing is visible: the solid is empty")
    if (subject := now.subject) is None:
        return None
    ends = ["({})".format(", ".join(f"{v:.4g}" for v in end)) for end in (subject.lower, subject.upper)]
    place = f"between {ends[0]} and {ends[1]}"
    if is_cut_away(now.node):
        what = f"nothing is visible: nothing is left of the solid {place}"
        return Doubt("picture", what, "a smaller cut, or less that shrinks it")
    what = f"nothing is visible: no ray hits the solid, which lies {place}"
    pose, size = picture
    column, row = pose.places((subject.lower + subject.upper) / 2, size)
    if not (-0.5 <= column < size[0] - 0.5 and -0.5 <= row < size[1] - 0.5):
        return Doubt("picture", what, "another target, or no camera at all: it then sees all of the solid")
    return Doubt("picture", what, "it may be thinner than a pixel: a larger picture, or a camera near a part of it")


def contradicted(scene: Scene, values: Values) -> list[Doubt]:
    """Doubts about facts that the user stated and that samples of the field contradict: bounds, spread and others."""
    nodes = [node for node in all_nodes(scene.node) if stated_by_user(node)][:STATED]
    with bound(values.params, values.time):
        found = [(node, sentence) for node in nodes for sentence in quick_contradictions(node)]
    return [Doubt("values", f"{node.name}: {sentence}", where=node.where) for node, sentence in found]


def moved_otherwise(scene: Scene, values: Values) -> list[Doubt]:
    """Doubts about offsets and shells that are not as thick as asked for, and effects that read short distances."""
    with bound(values.params, values.time):
        found = [*levels.moved_otherwise(scene.node, doubted=True)]
        return found + misread(scene, values)


def not_finite(lost: int, pixels: int) -> Doubt | None:
    """The doubt of a picture with some pixels whose colours are not finite; None if all are."""
    what = f"{lost} of {pixels} pixels have a colour that is not finite"
    return Doubt("picture", what, "--view nonfinite") if lost else None


def out_of_steps(done: NDArray[np.bool_], scene: Scene) -> Doubt | None:
    """The doubt of rays that ran out of steps; None if at most `OUT_OF_STEPS` of them did."""
    share = float(np.mean(~done))
    if share <= OUT_OF_STEPS:
        return None
    cure = f"Quality(max_steps=...), {scene.quality.camera_steps} now; --view iterations"
    what = f"{share:.1%} of the rays ran out of steps, and show the surface that they are near"
    return Doubt("picture", what, cure)


def noisy(scene: Scene) -> Doubt | None:
    """The doubt of path-traced light, a lens, an open shutter or a light of some size with one random path or point a
    pixel; None if there are more, or none."""
    quality, cure = scene.quality, "--samples 64 or Quality(samples=64)"
    if quality.samples > (SAMPLES if in_studio(scene) and scene.path_traced else 1) or quality.temporal != "off":
        return None
    paths = "one random path" if quality.samples == 1 else f"{quality.samples} random paths"
    if scene.camera.lens:
        return Doubt("picture", "Camera(aperture=...) is noisy with one ray a pixel", cure)
    if scene.motion_blur:
        return Doubt("picture", "Camera(shutter=...) shows one moment with one ray a pixel", cure)
    if not scene.path_traced:
        sampled = [light for light in scene.lights if is_sampled(light, scene)]
        if not sampled or quality.light_samples > 1:
            return None
        light = sampled[0]
        reason = "penumbra='sampled'" if light.soft and light.penumbra == "sampled" else "visible=True"
        name = type(light).__name__ + ("" if has_area(light) else f"({reason})")
        cure = "--samples 16, or Quality(light_samples=16)"
        return Doubt("picture", f"{name} is noisy with one random point a pixel", cure)
    if not any(m.transmits for m in scene.materials):
        return Doubt("picture", f"path-traced light is noisy with {paths} a pixel", cure)
    cure = cure if any(m.frosted for m in scene.materials) else f"{cure}; or integrator='whitted'"
    return Doubt("picture", f"glass is noisy with {paths} a pixel", cure)


def inside(ready: Prepared, values: Values, pose: Pose, size: tuple[int, int]) -> Doubt | None:
    """The doubt of a camera in a solid, or on its surface. None in glass, with a lens, and where the plane in which
    rays start may open solids: that of parallel rays is only doubted if it is a face, on which all of them start.

    size : (width, height) of the picture in pixels.
    """
    scene = ready.plan.given
    if ready.distance is None or pose.near or pose.aperture or any(m.transmits for m in scene.materials):
        return None
    starts = pose.position[None]
    if pose.orthographic:
        columns, rows = np.meshgrid(*(np.linspace(0, n - 1, STARTS).round().astype(int) for n in size))
        starts = pose.rays(columns.ravel(), rows.ravel(), size)[0]
    values = with_hoisted(ready.plan.hoisted, values)
    with bound(values.params, values.time):
        depth = -float(np.max(ready.distance(starts - ready.plan.origin)[0]))
    if abs(depth) <= STARTS_ROUNDED * np.spacing(np.abs(starts).max()):
        depth = 0.0
    if not depth >= 0.0 or (pose.orthographic and depth > 0.0):
        return None
    least = "" if scene.node.exactness == "exact" else "at least "
    what = f"the camera is {least}{depth:.3g} deep inside a solid, whose inner side is shown"
    if depth == 0.0:
        what = "the camera is on a surface, which all rays meet at once"
    return Doubt("values", what, "move it, or hide the solid: node.visible(camera=False)")


def coarse(ready: Prepared, values: Values, pose: Pose, height: int) -> Doubt | None:
    """The doubt of a camera so far from all bounded parts that float32 rounds points by half a pixel or more there."""
    away, rounding = _rounding(ready, values, pose)
    pixels = rounding / float(pose.footprint(away, height)) if away > 0.0 else 0.0
    if pixels < 0.5:
        return None
    where, cure = f"{away:.3g} from what it shows", "a nearer camera, as projection='orthographic'"
    cure = "a nearer camera, which shows the same" if pose.orthographic else cure
    if (middle := float(np.max(np.abs(pose.position - ready.plan.origin)))) > 10.0 * away:
        where = f"{middle:.3g} from the middle of what it shows"
        cure = "a smaller solid, as a plane in place of a planet, or all of it nearer the origin"
    what = f"the camera is {where}, where float32 holds points within {pixels:.2g} pixels"
    return Doubt("values", what, cure)


def _rounding(ready: Prepared, values: Values, pose: Pose) -> tuple[float, float]:
    """The distance of the camera from the box of all bounded parts, and by how much float32 rounds points there."""
    scene = ready.plan.scene
    subject = scene.subject or scene.replace(node=solid_at(scene.node, values)).subject  # where time has moved them
    if subject is None:
        return 0.0, 0.0
    position = pose.position - ready.plan.origin
    away = float(np.linalg.norm(beyond(subject.lower, subject.upper, position)))
    return away, 2.0 * ULP * (float(np.max(np.abs(position))) + away)


def too_thin(ready: Prepared, values: Values, pose: Pose) -> Doubt | None:
    """The doubt of a solid that an uneven scale makes thinner than float32 rounds the points of a ray."""
    found, (_, rounding) = levels.thinnest(ready.plan.scene.node), _rounding(ready, values, pose)
    if found is None or found[1] >= rounding:
        return None
    node, thickness = found
    what = f"{node.name} is {thickness:.2g} thick, and float32 holds points within {rounding:.2g}: parts may be missing"
    return Doubt("values", what, f"a solid at least {rounding:.2g} thick, or a nearer camera", where=node.where)


def overexposed(color: NDArray[Any], scene: Scene) -> NDArray[np.bool_] | None:
    """The pixels that tone mapping makes white although their light is above 1; None if they are few."""
    light = _over_channels(np.minimum, np.nan_to_num(color, nan=0.0))
    white: NDArray[np.bool_] = (light > WHITE) & np.all(scene.tone.image(color) == 255, axis=-1)
    return white if np.mean(white) > OVEREXPOSED else None


def clipped(white: NDArray[np.bool_], color: NDArray[Any], material: NDArray[Any], scene: Scene) -> Doubt | None:
    """The doubt of surfaces whose light is clipped to white; None if they are few. Emissive materials may be white."""
    emissive = [i for i, m in enumerate(scene.materials) if m.emits]
    lit = white & (material >= 0) & ~np.isin(material, emissive)
    share = float(np.mean(lit))
    if share <= OVEREXPOSED:
        return None
    stops = float(np.log2(np.quantile(color[lit].max(axis=-1), 0.95)))
    exposure = f"rm.ToneMapping(exposure={-np.ceil(10.0 * stops) / 10.0:.1f})"
    curve = "Scene(tone=rm.ToneMapping('aces')) " if scene.tone.curve == "linear" else ""
    cure = f"lights of less intensity, {curve}or {exposure}"
    return Doubt("picture", f"{share:.0%} of the picture is clipped to white surfaces, whose light is above 1", cure)


DARK, MOSTLY = 2e-3, 0.5
"""Light that a picture shows as almost black, and the share of its pixels above which that is doubted."""


def dark(color: NDArray[Any], scene: Scene) -> Doubt | None:
    """The doubt of a picture that is mostly black, or partly in a scene without any light; None if its sky is black."""
    sky, unlit = scene.sky.radiance, not scene.lights and not scene.sky.lights
    some = 0.01 if unlit and not any(m.emits or m.transmits for m in scene.materials) else MOSTLY
    black = color < DARK
    if np.count_nonzero(black) <= some * black.size:  # no larger share of pixels then
        return None
    share = float(np.mean(all_channels(black)))
    if share <= some or (share < 1.0 and sky.is_constant and not np.any(sky.data)):
        return None
    what = f"{share:.0%} of the picture is black: "
    if unlit:
        return Doubt("picture", what + "the scene has no light", "lights=[Sun()], or Sky(..., light=True)")
    what += "the lights are too weak, too far or hidden"
    what += ", or the materials are black" if any(is_zero(m.color) for m in scene.materials) else ""
    return Doubt("picture", what, "a higher intensity, or another place")


NEARLY_ALL = 0.98
"""Share of a picture that is the picture, where a few of its pixels show the horizon or an edge."""

FAINT, PALE = 24, 250
"""8-bit codes: surfaces below the first in all channels are nearly black, those above the second nearly white."""


def of_one_tone(shown: NDArray[Any], sky: NDArray[np.bool_], scene: Scene) -> Doubt | None:
    """The doubt of a picture in which nearly all of the lit surfaces are shown nearly black, or nearly white. None
    where materials are black or emit light by themselves, which is a choice.

    shown, sky : see `beside_sky`.
    """
    if not (scene.lights or scene.sky.lights) or any(m.emits or is_zero(m.color) for m in scene.materials):
        return None
    lit = np.nan_to_num(shown[~sky].astype(np.float32, copy=False))
    if len(lit) <= OVEREXPOSED * len(shown):
        return None
    codes = scene.tone.image(lit[None])[0]
    low, high = -_high(-codes.min(axis=1).astype(int)), _high(codes.max(axis=1))
    if high >= FAINT and low <= PALE:
        return None
    light = _high(lit.max(axis=1))
    wanted = np.clip(-np.ceil(10.0 * np.log2(max(light, 1e-9))) / 10.0 - float(high < FAINT), -30.0, 30.0)
    wanted = wanted if high < FAINT else min(wanted, -0.5)  # also of surfaces that are just white
    exposure = f"rm.ToneMapping(exposure={wanted:.1f})"
    if high < FAINT:
        what = f"all surfaces are nearly black, at most {high:.0f} of 255"
        return Doubt("picture", what, f"lights of more intensity, or {exposure}")
    what = f"all surfaces are nearly white, at least {low:.0f} of 255"
    return Doubt("picture", what, f"lights of less intensity, or {exposure}")


def _high(values: NDArray[Any]) -> float:
    """The value that nearly all values do not exceed. `np.quantile` imports more of NumPy."""
    last = int(NEARLY_ALL * (len(values) - 1))
    return float(np.partition(values, last)[last])


def has_one_color(color: NDArray[Any]) -> bool:
    """True if nearly all pixels are as alike as a flat surface. False for a black picture: that has its own doubt."""
    every = -(-max(color.shape[:2]) // 256)
    values = color[::every, ::every].reshape(-1, 3)
    least, most = (int(share * (len(values) - 1)) for share in (1.0 - NEARLY_ALL, NEARLY_ALL))
    low, high = np.partition(values, (least, most), axis=0)[[least, most]]
    return bool(np.all(high - low <= 0.02 * high) and np.max(high) >= DARK)


def _over_channels(choice: np.ufunc, color: NDArray[Any]) -> NDArray[Any]:
    """The largest or smallest channel of each pixel, by `np.maximum` or `np.minimum`; NaN if one is. NumPy reduces a
    short last axis in ten times as long."""
    return np.asarray(choice(choice(color[..., 0], color[..., 1]), color[..., 2]))


def is_plain(frame: Frame, scene: Scene) -> bool:
    """True if one flat surface fills a picture whose camera has no stated position."""
    plain = scene.camera.position is None and has_one_color(frame.color)
    return plain and bool(np.mean(np.isfinite(frame.depth)) >= NEARLY_ALL)


def beside_sky(color: NDArray[Any], scene: Scene, sky: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """The colours (N, 3) of a grid of pixels, and which of them match the sky. sky : see `sky_light`."""
    rows, columns = _grid(color.shape[1::-1])
    shown = color[rows[:, None], columns].reshape(-1, 3)
    near = 1e-4 if scene.sky.constant else 0.05  # the samples of a pixel see different parts of the sky
    return shown, np.all(np.abs(shown - sky) <= near * (1.0 + np.abs(sky)), axis=1)


def _grid(size: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of up to 48 x 48 pixels of a picture of (width, height)."""
    rows, columns = (np.linspace(0, n - 1, min(n, 48)).astype(np.intp) for n in size[::-1])
    return rows, columns


def sky_light(scene: Scene, _ready: Prepared | None, values: Values, pose: Pose, size: tuple[int, int]) -> NDArray[Any]:
    """The light of the sky at the pixels of `_grid`, (N, 3)."""
    rows, columns = _grid(size)
    return scene.sky.radiance_along(pose.directions(columns, rows[:, None], size).reshape(-1, 3), values)


def may_be_ground(color: NDArray[Any], scene: Scene) -> bool:
    """True if a picture in a studio is as grey as the ground and its shadows everywhere."""
    if not in_studio(scene):
        return False
    high, low = (_over_channels(choice, color) for choice in (np.maximum, np.minimum))
    return bool(np.all(high - low <= 0.4 * high))


def is_ground(material: NDArray[Any], scene: Scene) -> bool:
    """True if no ray hits anything but the ground of a studio. material : the index at each pixel, -1 for a miss."""
    ground = [i for i, known in enumerate(scene.materials) if known == GROUND]
    return bool(np.all(np.isin(material, ground) | (material < 0)))
