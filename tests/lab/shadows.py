"""Hard and soft shadows of bodies that are known, judged by closed forms: which points of a receiver are dark.

python -m tests.lab.shadows --pairs 200      # some million pixels; prints what is wrong, and where

A receiver (a floor, a ball or a wall) stands near the camera. An occluder (a ball or a slab) stands between it and the
light, at a distance of 10^-2 to 10^5. The reference intersects rays with both in closed form, in float64. A pixel
counts if its point is off the border of the shadow by more than its own footprint and more than float32 resolves there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.gpu import Renderer

Array = NDArray[np.float64]

SIZE = (71, 71)
PENUMBRAS = ("hard", "two-sided", "cone", "triangulated", "sampled")
ULP = 2.0**-23
VIEW = (0.7, 0.6, 0.5)
"""From the lit point to the camera, times `Pair.camera`."""


@dataclass(frozen=True)
class Pair:
    """A receiver and an occluder.

    receiver : "floor" at y = 0, "ball" of radius 1 below the origin, or "wall" that leans.
    tilt : of the light's direction from y, degrees. distance : of the occluder from the lit point, the origin.
    body : "ball" or "slab". size : radius of the ball, or half width of the slab.
    penumbra : of the light. softness : tangent of its angular radius.
    place : "sun", or "point" for a light ten times as far as the occluder. camera : distance of the camera.
    analytic : as in `Quality`; False marches what has a closed form.
    """

    receiver: str
    tilt: float
    distance: float
    body: str
    size: float
    penumbra: str
    softness: float
    place: str
    camera: float
    bounces: int = 0
    analytic: bool | None = False

    @property
    def light(self) -> Array:
        """The unit direction to the light from the origin."""
        angle = np.radians(self.tilt)
        across = np.array((0.6, 0.0, 0.8))
        return np.asarray(np.sin(angle) * across + np.cos(angle) * np.array((0.0, 1.0, 0.0)))

    def scene(self) -> rm.Scene:
        """Of a receiver without ambient light, under a black sky."""
        receiver = {"floor": rm.plane(), "ball": rm.sphere(1.0).translate((0, -1, 0)), "wall": rm.plane((0.6, 0.8, 0))}
        middle = self.distance * self.light
        occluder = rm.sphere(self.size)
        if self.body == "slab":
            occluder = rm.cylinder(self.size, 0.2 * self.size).orient(tuple(self.light))
        hard = self.penumbra == "hard"
        soft = {} if hard else {"softness": self.softness, "penumbra": self.penumbra}
        light: Any = rm.Sun(tuple(self.light), shadow=True, **soft)
        if self.place == "point":
            far = 10.0 * self.distance
            soft = {} if hard else {"radius": self.softness * far, "penumbra": self.penumbra}
            light = rm.PointLight(tuple(far * self.light), intensity=far * far, shadow=True, **soft)
        color = 1.0 if self.bounces == 0 else 0.01  # what other surfaces send is not to count
        paint = rm.Material((color, color, color), ambient=0.0, specular=0.0)
        node = receiver[self.receiver] | occluder.translate(tuple(middle))
        samples = 1 if self.bounces == 0 else 4
        return rm.Scene(
            node.material(paint),
            rm.Camera(tuple(self.camera * np.array(VIEW)), (0, 0, 0), fov=30),
            lights=[light],
            sky=(0, 0, 0),
            bounces=self.bounces,
            quality=rm.Quality(samples=samples, analytic=self.analytic),
        )


def drawn(rng: np.random.Generator, index: int) -> Pair:
    """A pair at random; kinds take turns, so that each is there equally often."""
    distance = float(10 ** rng.uniform(-2, 5))
    receiver = ("floor", "ball", "wall")[index % 3]
    tilt = float(rng.choice([rng.uniform(0, 60), rng.uniform(60, 85), rng.uniform(85, 89.5)]))
    tilt = min(tilt, 50.0) if receiver == "wall" else tilt
    penumbra = PENUMBRAS[index % len(PENUMBRAS)]
    camera = min(float(10 ** rng.uniform(-1, 1)), 20.0 * distance) * (0.1 if receiver == "ball" else 1.0)
    # a shadow that fills the picture, has its border in it, or is a spot
    size = min(0.7 * distance, camera * float(10 ** rng.uniform(-1.0, 1.0)))
    size = max(size, 1e-3 * distance)
    light = Pair(receiver, tilt, distance, "ball", size, "hard", 0.0, "sun", camera).light
    while np.linalg.norm(distance * light - camera * np.array(VIEW)) < 1.3 * size:  # the camera is not to be in it
        size *= 0.5
    body = ("ball", "slab")[(index // 2) % 2]
    # what is thinner than the light's disc lets light through by the two-sided rule, as the docs say
    softness = float(10 ** rng.uniform(-3, -0.5 if body == "ball" else -1.3)) * size / distance
    return Pair(
        receiver,
        tilt,
        distance,
        body,
        size,
        penumbra,
        softness,
        ("sun", "point")[(index // 3) % 2],
        camera,
        bounces=1 if index % 7 == 0 else 0,
    )


# The reference


def _directions(pair: Pair) -> tuple[Array, Array, float]:
    """Where the camera stands, the rays of all pixels (H, W, 3), and the width of a pixel at distance 1."""
    width, height = SIZE
    eye = pair.camera * np.array(VIEW)
    back = eye / np.linalg.norm(eye)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    tangent = np.tan(np.radians(15.0))
    x = (2 * (np.arange(width) + 0.5) - width) / height * tangent
    y = (height - 2 * (np.arange(height) + 0.5)) / height * tangent
    rays = x[None, :, None] * right + y[:, None, None] * up - back
    return eye, rays / np.linalg.norm(rays, axis=-1, keepdims=True), 2 * tangent / height


def _plane(normal: Array, origins: Array, rays: Array) -> Array:
    """Distance along rays to the plane through the origin; inf where they do not come down to it."""
    rise = rays @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -(origins @ normal) / rise
    return np.where((rise < 0) & (t > 0), t, np.inf)


def _ball(centre: Array, radius: float, origins: Array, rays: Array) -> Array:
    """Distance along rays to a ball, inf where they miss it; they start outside."""
    to = centre - origins
    along = np.einsum("...i,...i->...", to, rays)
    off = to - along[..., None] * rays
    square = radius * radius - np.einsum("...i,...i->...", off, off)
    t = along - np.sqrt(np.maximum(square, 0.0))
    return np.where((square > 0) & (t > 0), t, np.inf)


def clearance(pair: Pair, points: Array) -> tuple[Array, Array]:
    """By how much the rays from points to the light's middle pass the occluder, and the distance there: (N,), (N,).

    Negative inside. Of a slab, what its silhouette leaves: a disc seen along its axis, and its edge widened by its half
    thickness times the slant.
    """
    middle = pair.distance * pair.light
    rays = np.broadcast_to(pair.light, points.shape)
    end = np.full(points.shape[:-1], np.inf)
    if pair.place == "point":
        way = 10.0 * middle - points
        end = np.linalg.norm(way, axis=-1)
        rays = way / end[..., None]
    to = middle - points
    along = np.einsum("...i,...i->...", to, rays)
    off = np.linalg.norm(to - along[..., None] * rays, axis=-1)
    return off - pair.size, np.where(along < end, along, -1.0)


def judged(pair: Pair) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Pixels that must be lit, those that must be dark, and those in which the receiver is seen and faces the light."""
    eye, rays, pixel = _directions(pair)
    origins = np.broadcast_to(eye, rays.shape)
    normal = {"floor": np.array((0.0, 1.0, 0.0)), "wall": np.array((0.6, 0.8, 0.0))}.get(pair.receiver)
    if normal is not None:
        t = _plane(normal, origins, rays)
        normals = np.broadcast_to(normal, rays.shape)
        slant = np.abs(rays @ normal)
    else:
        t = _ball(np.array((0.0, -1.0, 0.0)), 1.0, origins, rays)
        p = eye + np.where(np.isfinite(t), t, 0.0)[..., None] * rays
        normals = p + np.array((0.0, 1.0, 0.0))
        slant = np.abs(np.einsum("...i,...i->...", normals, rays))
    # the occluder is not to be seen, nor to touch what is judged
    seen = np.isfinite(t) & (t < _ball(pair.distance * pair.light, 1.2 * pair.size, origins, rays)) & (slant > 0.02)
    p = eye + np.where(seen, t, 1.0)[..., None] * rays
    far, ahead = clearance(pair, p)
    to_light = np.broadcast_to(pair.light, p.shape)
    if pair.place == "point":
        to_light = 10.0 * pair.distance * pair.light - p
        to_light = to_light / np.linalg.norm(to_light, axis=-1, keepdims=True)
    facing = np.einsum("...i,...i->...", normals, to_light)
    wide = 0.0 if pair.penumbra == "hard" else pair.softness
    seen &= facing > max(
        0.005, 4 * wide
    )  # all of the light is above the receiver, and its cosine about that of its middle
    off_it = np.linalg.norm(p - pair.distance * pair.light, axis=-1) > 1.3 * pair.size + 4 * pixel * t
    seen &= off_it
    # by how much the border may be off: two footprints, and what float32 can tell apart there
    grain = 2 * pixel * t / np.maximum(slant, 0.02) + 32 * ULP * (pair.distance + pair.camera)
    thick = 0.1 * pair.size * np.linalg.norm(np.cross(to_light, pair.light), axis=-1) if pair.body == "slab" else 0.0
    if pair.receiver == "ball":  # what it hides of the light itself is not judged
        seen &= facing > 0.05
    soft = 0.0 if pair.penumbra == "hard" else 1.5 * pair.softness * np.abs(ahead)
    lit = seen & ((far > soft + grain + thick) | (ahead < -pair.size))
    dark = seen & (far < -(soft + grain + thick)) & (ahead > 0)
    return lit, dark, seen


def wrong(pair: Pair, renderer: Renderer) -> tuple[int, int, int, int]:
    """Pixels judged lit, judged dark, drawn too dark, drawn too light."""
    lit, dark, _ = judged(pair)
    frame = renderer.render(pair.scene())
    free = renderer.render(replace_shadow(pair))
    share = frame.color[..., 0] / np.maximum(free.color[..., 0], 1e-12)
    least = 0.5 if pair.penumbra == "sampled" else 0.98  # one point of the light stands for all
    return int(lit.sum()), int(dark.sum()), int(np.sum(lit & (share < least))), int(np.sum(dark & (share > 0.02)))


def replace_shadow(pair: Pair) -> rm.Scene:
    """The same picture without any shadow."""
    scene = pair.scene()
    light = scene.lights[0]
    kept = {"intensity": light.intensity} if isinstance(light, rm.PointLight) else {}
    plain: Any = rm.Sun(tuple(pair.light)) if pair.place == "sun" else None
    if plain is None:
        plain = rm.PointLight(tuple(10.0 * pair.distance * pair.light), **kept)
    return scene.replace(lights=[plain])


def pairs(count: int, seed: int) -> Iterator[Pair]:
    rng = np.random.default_rng(seed)
    for index in range(count):
        yield drawn(rng, index)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    total = np.zeros(4, np.int64)
    with Renderer(SIZE) as renderer:
        for pair in pairs(given.pairs, given.seed):
            found = wrong(pair, renderer)
            total += found
            if found[2] or found[3]:
                print(f"{found[2]} too dark, {found[3]} too light of {found[0]} and {found[1]}: {pair}", flush=True)
    print(
        f"{total[0] + total[1]} pixels judged, {total[1]} of them in shadow: {total[2]} too dark, {total[3]} too light"
    )
    return 1 if total[2] or total[3] else 0


if __name__ == "__main__":
    sys.exit(main())
