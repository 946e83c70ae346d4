"""Sketches against closed forms, and against distances, signs and areas from finely divided outlines."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import BPoly, CubicHermiteSpline

import raymarch as rm

Floats = NDArray[np.float64]
RANDOM = np.random.default_rng(5)
POINTS = RANDOM.uniform(-2, 6, (20_000, 2))


# The judge: an outline as many short chords


def arc(centre: Any, radius: float, first: float, last: float, n: int = 4000) -> Floats:
    """Points of an arc; angles in degrees, from first to last."""
    t = np.radians(first + (last - first) * np.arange(n + 1) / n)
    return np.asarray(centre) + radius * np.stack([np.cos(t), np.sin(t)], axis=1)


def judged(outline: Floats, points: Floats) -> Floats:
    """Signed distance to a closed polyline: the sign by counting crossings of a ray."""
    a, b = outline, np.roll(outline, -1, axis=0)
    along = b - a
    nearest, inside = np.empty(len(points)), np.empty(len(points), bool)
    for i, p in enumerate(points):
        t = np.clip(np.sum((p - a) * along, axis=1) / np.sum(along * along, axis=1), 0, 1)
        nearest[i] = np.sqrt(np.min(np.sum((a + t[:, None] * along - p) ** 2, axis=1)))
        over = (a[:, 1] > p[1]) != (b[:, 1] > p[1])
        x = a[over, 0] + (p[1] - a[over, 1]) / along[over, 1] * along[over, 0]
        inside[i] = np.sum(x > p[0]) % 2
    return np.where(inside, -nearest, nearest)


def area_of(outline: Floats) -> float:
    (x, y), (u, v) = outline.T, np.roll(outline, -1, axis=0).T
    return abs(0.5 * float(np.sum(x * v - y * u)))


CASES: dict[str, Callable[[float], tuple[rm.Node, Floats]]] = {}


def case(make: Callable[[float], tuple[rm.Node, Floats]]) -> Callable[[float], tuple[rm.Node, Floats]]:
    CASES[make.__name__] = make
    return make


def at(s: float, *points: tuple[float, float]) -> list[tuple[float, float]]:
    return [(s * x, s * y) for x, y in points]


@case
def keyhole(s: float) -> tuple[rm.Node, Floats]:
    """A slot with an arc of 300 degrees."""
    left, right, foot, corner = at(s, (-0.5, np.sqrt(0.75)), (0.5, np.sqrt(0.75)), (0.5, 4), (-0.5, 4))
    made = rm.sketch(right).line_to(foot).line_to(corner).line_to(left).arc_to(right, s, large=True).close()
    return made, s * np.vstack([[(0.5, 4), (-0.5, 4)], arc((0, 0), 1, 120, 420)])


@case
def bay(s: float) -> tuple[rm.Node, Floats]:
    """An arc that bends in, drawn clockwise, tangent to both lines: two spikes without an angle."""
    inner = 3 - 3 / np.sqrt(2)
    a, b, middle, c = at(s, (0, 0), (0, 3), (inner, inner), (3, 0))
    made = rm.sketch(a).line_to(b).arc_through(middle, c).close()
    return made, s * np.vstack([[(0, 0)], arc((3, 3), 3, 180, 270), [(3, 0)]])


@case
def notch(s: float) -> tuple[rm.Node, Floats]:
    """Two half circles side by side: the outside ends in a notch without an angle."""
    right, top, left, foot = at(s, (4, 1), (2, 1), (0, 1), (2, -1))
    made = rm.sketch(right).arc_to(top, s).arc_to(left, s).line_to(foot).close()
    return made, s * np.vstack([arc((3, 1), 1, 0, 180), arc((1, 1), 1, 0, 180)[1:], [(2, -1)]])


@case
def spline(s: float) -> tuple[rm.Node, Floats]:
    knots = np.array([(0.0, 0.0), (1.5, -0.6), (3.2, 0.3), (3.4, 2.0), (1.0, 1.4), (-0.6, 2.2)])
    h = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    t = np.concatenate([[0], np.cumsum(h)])
    v = np.diff(knots, axis=0) / h[:, None]
    inner = (h[1:, None] * v[:-1] + h[:-1, None] * v[1:]) / (h[:-1] + h[1:])[:, None]
    slopes = np.vstack([1.5 * v[0] - 0.5 * inner[0], inner, 1.5 * v[-1] - 0.5 * inner[-1]])
    curve = CubicHermiteSpline(t, knots, slopes)(np.linspace(0, t[-1], 20_001))
    return rm.sketch(s * knots[0]).spline_to(s * knots[1:], tolerance=s * 1e-5).close(), s * curve


@case
def bezier(s: float) -> tuple[rm.Node, Floats]:
    control = np.array([(0.0, 0.0), (4.0, -1.0), (4.0, 3.0), (0.5, 2.0)])
    curve = BPoly(control[:, None, :], [0, 1])(np.linspace(0, 1, 20_001))
    return rm.sketch((0, 0)).bezier_to(*(s * control[1:]), tolerance=s * 1e-5).close(), s * curve


@pytest.mark.parametrize("size", [0.001, 1.0, 1000.0])
@pytest.mark.parametrize("name", CASES)
def test_distances_signs_and_areas_are_those_of_many_chords(name: str, size: float) -> None:
    made, outline = CASES[name](size)
    near = outline[RANDOM.integers(len(outline), size=150)] + RANDOM.normal(0, 0.05 * size, (150, 2))
    points = np.vstack([RANDOM.uniform(-2, 5, (250, 2)) * size, near])
    slack = size * (1.1e-5 if name in ("spline", "bezier") else 2e-6)
    assert np.max(np.abs(made.distance(points) - judged(outline, points))) < slack
    assert made.exactness == "exact"
    assert np.allclose(made.bounds, (outline.min(axis=0), outline.max(axis=0)), atol=slack)


def test_many_pieces_are_a_table_of_the_same_shape() -> None:
    fine = rm.sketch((0, 0)).bezier_to((4, -1), (4, 3), (0.5, 2), tolerance=1e-7).close()
    assert len(fine.params["pieces"]) > 100
    assert "u_table" in fine.glsl()
    control = np.array([(0.0, 0.0), (4.0, -1.0), (4.0, 3.0), (0.5, 2.0)])
    outline = BPoly(control[:, None, :], [0, 1])(np.linspace(0, 1, 20_001))
    assert np.max(np.abs(fine.distance(POINTS[:300]) - judged(outline, POINTS[:300]))) < 1e-6


# Closed forms


BOARD = rm.sketch((0, 0)).line_to((4, 0), name="right").line_to((4, 2)).line_to((0, 2), name="top")


@pytest.mark.parametrize(
    ("made", "known"),
    [
        (BOARD.close(), rm.rectangle((4, 2)).translate((2, 1))),
        (BOARD.fillet(0.5).close(), rm.rectangle((3, 1)).round(0.5).translate((2, 1))),
        (BOARD.fillet(1).close(), rm.stroke((1, 1), (3, 1), 2)),  # two of the lines vanish
        (BOARD.chamfer(0.5, ["top", 0]).close(), rm.polygon([(0.5, 0), (4, 0), (4, 2), (0.5, 2), (0, 1.5), (0, 0.5)])),
        (rm.sketch((1, 0)).arc_to((-1, 0), 1).arc_to((1, 0), 1).close(), rm.circle(1)),
        (rm.sketch((1, 0)).arc_to((-1, 0), -1).arc_to((1, 0), -1).close(), rm.circle(1)),
        (rm.sketch((0, -1)).line_to((0, 1)).tangent_arc_to((2, 1)).line_to((2, -1)).tangent_arc_to((0, -1)).close(),
         rm.stroke((1, -1), (1, 1), 2)),
        (BOARD.fillet(1).hole(rm.sketch((2, 1)).arc_to((3, 1), 0.5).arc_to((2, 1), 0.5)).close(),
         rm.stroke((1, 1), (3, 1), 2) - rm.circle(0.5).translate((2.5, 1))),
    ],
)  # fmt: skip
def test_sketches_of_known_shapes(made: rm.Node, known: rm.Node) -> None:
    assert np.max(np.abs(made.distance(POINTS) - known.distance(POINTS))) < 1e-12


def test_symmetry_and_convexity_are_found() -> None:
    round_board = rm.sketch((-2, -1)).line_to((2, -1)).line_to((2, 1)).line_to((-2, 1)).close()
    assert round_board.facts.symmetry == "xy"
    assert BOARD.fillet(0.5).close().facts.convex
    assert not notch(1.0)[0].facts.convex
    assert not BOARD.line_to((1, 1)).close().facts.convex
    assert not BOARD.hole(rm.sketch((1, 0.5)).line_to((2, 0.5)).line_to((1, 1))).close().facts.convex


def test_fillets_touch_both_pieces() -> None:
    """Between arcs and lines that bend in and out, the outline has one direction at each joint, and the radius."""
    corners = rm.sketch((0, 0)).arc_through((1.5, 0.4), (3, 0)).line_to((3.4, 1.8)).arc_through((1.8, 1.2), (0, 2))
    for radius in (0.05, 0.2, 0.35):
        made = corners.fillet(radius).close()
        rows = np.array(made.params["pieces"])
        chord, bulge = rows[:, 2:4] - rows[:, :2], rows[:, 4]
        heading, half = np.arctan2(chord[:, 1], chord[:, 0]), 2 * np.arctan(bulge)
        turn = np.roll(heading - half, -1) - (heading + half)
        assert np.max(np.abs((turn + np.pi) % (2 * np.pi) - np.pi)) < 1e-9
        radii = np.linalg.norm(chord, axis=1)[bulge != 0] / (2 * np.abs(np.sin(half[bulge != 0])))
        assert np.sum(np.abs(radii - radius) < 1e-9) == 4


# As solids


def test_volumes_follow_from_the_area_by_greens_theorem() -> None:
    made, outline = keyhole(1.0)
    part = made.extrude(0.5)
    assert rm.measure(part, cells=64).volume == pytest.approx(0.5 * area_of(outline), rel=2e-3)
    ring = made.translate((3, 0)).revolve()  # Pappus
    assert rm.measure(ring, cells=96).volume == pytest.approx(2 * np.pi * 3 * area_of(outline), rel=3e-3)


def test_a_plate_with_a_hole_is_exported(tmp_path: Any) -> None:
    plate = BOARD.fillet(0.4).hole(rm.sketch((1, 1)).arc_to((2, 1), 0.5).arc_to((1, 1), 0.5)).close().extrude(0.4)
    rm.export(plate, tmp_path / "plate.stl", cells=48)
    mesh = trimesh.load(tmp_path / "plate.stl")
    area = 8 - (4 - np.pi) * 0.4**2 - np.pi * 0.25
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.4 * area, rel=5e-3)
    assert mesh.euler_number == 0


# Faults


LINE = rm.sketch((0, 0)).line_to((4, 0))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: LINE.extrude(1), "open outline"),
        (lambda: LINE.close(), "encloses nothing"),
        (lambda: LINE.line_to((4, 0)), "where it starts"),
        (lambda: LINE.line_to((0, 2)).line_to((4, 2)).close(), "at (2, 1)"),
        (lambda: LINE.line_to((4, 2)).line_to((2, 0)).line_to((0, 2)).close(), "at (2, 0)"),
        (lambda: LINE.line_to((4, 2)).arc_to((0, 2), -2).close(), "meets"),
        (lambda: LINE.line_to((2, 0)).line_to((2, 1)).close(), "turns back"),
        (lambda: BOARD.fillet(1.2).close(), "radius <= 1 there"),
        (lambda: BOARD.fillet(1.7, "right").fillet(0.5).close(), 'corner 1 "right" = (4.0, 0.0) (radius <= 1.5'),
        (lambda: BOARD.chamfer(1.5, [0, "top"]).close(), "length <= 1 there"),
        (lambda: BOARD.fillet(0.1, "left").close(), '"right", "top"'),
        (lambda: BOARD.fillet(0.1, 4).close(), "0 to 3"),
        (lambda: BOARD.fillet(-1), "radius = -1"),
        (lambda: LINE.arc_to((4, 2), 0.9), "1 or more"),
        (lambda: LINE.arc_through((5, 0), (2, 0)), "no arc"),
        (lambda: LINE.spline_to([(5, 1), (5, 1)]), "twice"),
        (lambda: LINE.line_to((rm.Param("x", 1), 0)), "no `Param`"),
        (lambda: BOARD.hole(rm.sketch((3, 1)).line_to((5, 1)).line_to((3, 1.5))).close(), "meets"),
        (lambda: BOARD.hole(rm.sketch((5, 1)).line_to((6, 1)).line_to((5, 2))).close(), "not inside"),
        (lambda: BOARD.hole(rm.circle()), "an open sketch"),
        (lambda: LINE.lineTo(1, 2), "line_to"),
        (lambda: LINE.threePointArc((1, 2), (2, 3)), "arc_through"),
        (lambda: LINE.offset2D(1), "close().offset"),
        (lambda: rm.Workplane("XY"), "rm.sketch"),
    ],
)
def test_faults_name_the_cure(make: Callable[[], object], words: str) -> None:
    with pytest.raises(rm.SceneError) as caught:
        make()
    assert words in str(caught.value)
    assert "test_sketches.py" in str(caught.value)
