"""docs/names.md lists every name that tools of this kind have in common, and its code runs."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm

PAGE = Path(__file__).parents[2] / "docs" / "names.md"

COMMON = """
sphere, ellipsoid, box, rounded box, box frame, plane, slab, torus, capped torus, link, infinite cylinder,
capped cylinder, rounded cylinder, infinite cone, capped cone, round cone, capsule, line tube, polyline tube,
Bézier tube, hexagonal prism, triangular prism, octahedron, tetrahedron, pyramid, dodecahedron, icosahedron,
truncated tetrahedron, truncated cube, truncated octahedron, truncated dodecahedron, truncated icosahedron,
solid angle, cut sphere, cut hollow sphere, death star, vesica, rhombus, superquadric, triangle, quad, disc, blob,
gyroid, Schwarz P, Schwarz D, Neovius, lidinoid, height map, grid sampled as a field, mesh sampled as a field,
circle, rectangle, rounded rectangle, polygon, regular polygon, star, flat triangle, trapezoid, arc, ring, pie, heart,
flat vesica, ellipse, quadratic Bézier, polyline, cross, egg, moon, text, image,
union, intersection, difference, xor, complement, smooth union, smooth intersection, smooth difference, cubic blend,
quartic blend, circular blend, exponential blend, root blend, circular geometric blend, chamfer, round union, stairs,
columns, pipe, engrave, groove, tongue, morph, transition along a line,
round, shell, elongate, extrude, extrude to, revolve, slice, offset,
translate, rotate, orient, scale, mirror, matrix, twist, bend, taper, shear, wrap around,
displacement by a function, displacement by noise, displacement by a texture,
infinite repetition, limited repetition, polar repetition, mirrored repetition, repetition over an interval,
grid with a cell index,
Mandelbulb, quaternion Julia, Mandelbox, Menger sponge, Sierpinski, apollonian, own folds, raw GLSL
"""

NODES, _, REST = PAGE.read_text(encoding="utf-8").partition("## Rendering terms")
TERMS, _, NAMING = REST.partition("## How parameters are named")
ROWS = re.findall(r"^\| ([^|]+?) \| (.+) \|$", NODES, re.MULTILINE)
CALLS = [(names, match[1].replace("\\|", "|")) for names, cell in ROWS if (match := re.fullmatch(r"`(.+)`", cell))]


def test_every_common_name_is_there() -> None:
    known = {name for names, _ in CALLS for name in names.split(", ")}
    common = {" ".join(name.split()) for name in COMMON.split(",")}
    assert len(common) > 110
    assert common - known == set()


@pytest.mark.parametrize(("names", "call"), CALLS, ids=[names for names, _ in CALLS])
def test_what_stands_there_runs(names: str, call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    given = {"rm": rm, "np": np, "a": rm.box(1), "b": rm.sphere(0.6).translate((0.4, 0.2, 0)), "f": rm.star()}
    node = eval(call, given)
    assert isinstance(node, rm.Node)
    points = np.random.default_rng(1).uniform(-1, 1, (50, node.dimension))
    assert np.all(np.isfinite(node.distance(points)))
    assert "field(" in node.glsl()


@pytest.mark.parametrize("code", re.findall(r"`([^`]+)`", TERMS))
def test_the_rendering_terms_run(code: str) -> None:
    given = {"rm": rm, "n": 2, "Quality": rm.Quality, "Scene": lambda **given: rm.Scene(rm.box(1), **given)}
    assert eval(code, given) is not None


def parameters() -> dict[str, set[str]]:
    """The names of all public parameters, and who has them."""
    found: dict[str, set[str]] = {}
    owners = [(name, getattr(rm, name)) for name in rm.__all__ if callable(getattr(rm, name))]
    methods = [(f"{name}.{m}", f) for name, each in owners if isinstance(each, type) for m, f in vars(each).items()]
    for name, each in owners + [(m, f) for m, f in methods if inspect.isfunction(f) and "._" not in m]:
        if not (isinstance(each, type) and issubclass(each, Exception)):
            for parameter in inspect.signature(each).parameters:
                found.setdefault(parameter, set()).add(name)
    return found


def test_a_parameter_has_the_word_of_the_table() -> None:
    known = parameters()
    words = [
        name for cell in re.findall(r"^\| (`[^|]+`) \|", NAMING, re.MULTILINE) for name in re.findall(r"`(\w+)`", cell)
    ]
    assert len(words) > 20 and set(words) <= set(known)
    others = {"centre", "colour", "turn", "file", "filename", "path", "bottom", "diameter", "degrees", "dir", "towards"}
    assert {name: known[name] for name in others & set(known)} == {"path": {"export"}}
    assert known["angle"] == {"arc", "capped_torus", "pie", "Node.revolve", "Node.rotate"}
    assert known["softness"] == {"Light", "Sun", "SunSky.sun"}
    assert known["rounding"] == {"rounded_box", "rounded_cylinder", "rounded_rectangle"}
    assert known["direction"] == {"DirectionSample", "Node.orient", "RaySamples", "RectLight", "SpotLight", "Truth"}


@pytest.mark.parametrize("name", [name for name, each in vars(rm.sdf).items() if name in rm.__all__ and callable(each)])
def test_sizes_come_in_one_order(name: str) -> None:
    """What is measured across, then the height, then what shapes the rest."""
    order = ("sides", "points", "radius", "major", "minor", "width", "height", "top", "rounding", "thickness")
    given = [p for p in inspect.signature(getattr(rm, name)).parameters if p in order]
    if not {"radius", "minor", "points"} <= set(given) and "a" not in inspect.signature(getattr(rm, name)).parameters:
        assert given == sorted(given, key=order.index)


def test_shapes_fit_each_other() -> None:
    """Shapes with natural sizes are 2 wide."""
    for name in "box rounded_box box_frame sphere cylinder rounded_cylinder cone disc cut_hollow_sphere".split():
        lower, upper = getattr(rm, name)().bounds
        assert np.allclose(upper[0] - lower[0], 2.0), name
    for name in "circle rectangle rounded_rectangle ring arc trapezoid".split():
        lower, upper = getattr(rm, name)().bounds
        assert np.allclose(upper[0] - lower[0], 2.0), name
