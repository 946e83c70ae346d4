"""Thin solids before a surface: no ray passes what is thicker than a tenth of a pixel, with `rm.prove` as the judge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan import plan
from raymarch.scene.file import load

SIZE = (80, 45)
TOLERANCE = "0.1px"
"""Of the promise in docs/marching.md."""
CARPET = Path(__file__).parents[2] / "examples" / "papers" / "carpet.py"


def camera(elevation: float, distance: float, azimuth: float = 0.7) -> rm.Camera:
    flat = distance * np.cos(elevation)
    return rm.Camera((flat * np.cos(azimuth), distance * np.sin(elevation), flat * np.sin(azimuth)), (0, 0, 0), fov=40)


def fins(cut: bool) -> rm.Node:
    """Low plates on a floor, from a twentieth to half a pixel thick at the distances where they are seen."""
    made = rm.box((8, 1, 8)).translate((0, -0.5, 0)) - rm.sphere(0.3).translate((0, 3, 0)) if cut else rm.plane()
    for k in range(5):
        fin = rm.box((0.003 * 1.6**k, 0.02, 6)).translate((0.05 * k, 0.01, 0))
        made = made | fin.repeat((0.25, None, None), (31, 1, 1))
    return made


def sponge(cut: bool) -> rm.Node:
    made = rm.menger(1.0218, iterations=2) if not cut else rm.menger(1.0, iterations=4)
    return made - rm.sphere(0.3).translate((0, 3, 0)) if cut else made


@pytest.mark.parametrize("elevation", [0.03, 0.3])
@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("solid", [fins, sponge])
def test_no_ray_passes_a_thin_solid(
    renderer: rm.Renderer, solid: Callable[[bool], rm.Node], cut: bool, elevation: float
) -> None:
    scene = rm.Scene(solid(cut), camera(elevation, 3.0 if solid is fins else 1.6), quality=rm.Quality(analytic=False))
    frame = renderer.render(scene, outputs=("depth",))
    assert np.isfinite(frame.depth).mean() > 0.05
    assert rm.prove(scene, frame, tolerance=TOLERANCE).contradicted == 0


def test_no_ray_passes_the_pile_of_a_carpet(renderer: rm.Renderer) -> None:
    scene = load(CARPET)
    frame = renderer.render(scene.replace(quality=rm.Quality()), outputs=("depth",))
    found = rm.prove(scene, frame, tolerance=TOLERANCE)
    assert found.contradicted == 0 and found.share > 0.995


@pytest.mark.parametrize("epsilon", [0.1, 1.0])
def test_a_hit_at_an_edge_is_near_it(renderer: rm.Renderer, epsilon: float) -> None:
    """The last step is not evaluated: it must not lead away from the edge that the ray touches."""
    for turn in np.linspace(0, 1, 4):
        turned = (0.3 + turn, (1, 2, 3))
        node = rm.box((1, 1, 1)).rotate(*turned) - rm.box((1.2, 0.3, 0.3)).rotate(*turned)
        if epsilon == 1.0:
            node = rm.box((1, 0.01, 1)).rotate(*turned)
        quality = rm.Quality(analytic=False, epsilon=epsilon)
        scene = rm.Scene(node, camera(0.4, 3.0, turn), quality=quality)
        frame = renderer.render(scene, outputs=("depth",))
        assert rm.prove(scene, frame, tolerance=f"{epsilon}px").contradicted == 0


def tangle() -> rm.Node:
    return rm.implicit(lambda p: rm.dot(p * p, p * p) - 5 * rm.dot(p, p) + 11.8, 3)


@pytest.mark.parametrize(
    ("solid", "position"),
    [
        (lambda: rm.union(tangle(), rm.sphere().translate((0, 3, 0)), k=0.5), (5, 4, 7)),
        (lambda: tangle().twist(0.3), (5, 4, 7)),
        (lambda: tangle().repeat(7, (3, 1, 1)), (12, 9, 18)),
        (lambda: rm.sphere().displace(lambda p: 0.1 * rm.value_noise(20 * p)), (1.5, 1.2, 2.1)),
        (lambda: rm.pipe(rm.sphere(), rm.sphere(1.1).translate((0.05, 0.02, 0)), 0.072), (1.5, 1.2, 2.1)),
    ],
    ids=["blended", "twisted", "repeated", "displaced", "pipe"],
)
def test_no_ray_ends_before_a_flat_field(
    renderer: rm.Renderer, solid: Callable[[], rm.Node], position: tuple[float, float, float]
) -> None:
    """The field is up to 54 times smaller than the distance, so a value of epsilon / 16 is no hit. It is divided by a
    large slope, or the surfaces along which a pipe runs nearly touch."""
    scene = rm.Scene(solid(), rm.Camera(position), lights=[])
    assert plan(scene).contact_share < 1 / 20
    frame = renderer.render(scene, outputs=("depth",))
    assert np.isfinite(frame.depth).mean() > 0.1
    assert rm.prove(scene, frame, tolerance=TOLERANCE).contradicted == 0


STAR = [
    (radius * np.cos(angle), radius * np.sin(angle))
    for radius, angle in zip([0.35, 0.8] * 7, np.arange(14) * np.pi / 7, strict=True)
]


@pytest.mark.parametrize(
    "solid",
    [
        lambda: rm.box((0.8, 1.4, 0.6)).taper(0.3).twist(1.0).taper(-0.4),
        lambda: rm.polygon(STAR).shell(0.08).extrude(1.2, scale=0.5, twist=1.2),
        lambda: rm.sphere(0.9).displace_by_noise(0.15, 3, 3),
        lambda: rm.transition(rm.box((0.4, 2, 0.4)), rm.sphere(0.5).translate((0, 0.6, 0)), (0, -0.5, 0), (0, 0.5, 0)),
    ],
    ids=["tapered", "star", "noise", "transition"],
)
def test_hits_of_grazing_rays_are_half_as_near(solid: Callable[[], rm.Node]) -> None:
    """These fields are 4 to 8 times smaller than the distance. A ray that grazes them ends with a last step, which adds
    to what the value at its last sample leaves unknown."""
    scene = rm.Scene(solid(), rm.Camera((1.2, 1.6, 3.6), target=(0, 0, 0), fov=40), lights=[])
    assert rm.prove(scene, size=(160, 90), tolerance="0.05px").contradicted == 0


@pytest.fixture(scope="module")
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer(SIZE) as made:
        yield made
