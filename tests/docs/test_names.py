"""docs/names.md lists every name that tools of this kind have in common, and its code runs."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr import vocabulary

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
TERMS, _, FORMER = REST.partition("## Former names")
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


def test_the_present_names_exist() -> None:
    present = {cell for _, cell in re.findall(r"^\| ([^|]+?) \| (.+) \|$", FORMER, re.MULTILINE)}
    calls = [call for cell in present for call in re.findall(r"`([^`]+)`", cell)]
    assert len(calls) > 8
    for call in calls:
        name, _, rest = call.partition("(")
        if match := re.match(r"(\w+)=", rest):
            assert match[1] in inspect.signature(getattr(rm, name)).parameters, call
        elif "=" not in name:
            owner, _, attribute = name.rpartition(".")
            owners = [getattr(rm, owner)] if owner else [rm, vocabulary]
            assert any(hasattr(each, attribute) for each in owners), call
