"""Objects as rows of a table: which objects, and the field that cells give against that of all objects."""

import io
import tracemalloc
from collections import OrderedDict
from dataclasses import fields, replace

import numpy as np
import pytest
from rich.console import Console

import raymarch as rm
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.operations import operations
from raymarch.expr.walk import find
from raymarch.plan import cells, kept_cells, lists, plan
from raymarch.plan.cells import CUT
from raymarch.plan.device import HARDWARE, SOFTWARE
from raymarch.plan.explain import as_dict, show
from raymarch.plan.gather import gather
from raymarch.plan.objects import ObjectsInCells
from raymarch.prices import STANDARD
from raymarch.scene.reading import exact_distance, largest_size
from raymarch.scene.scene import all_nodes
from raymarch.sdf import derivation
from raymarch.sdf.blends import REACH
from raymarch.sdf.labels import rows_of
from raymarch.sdf.rows import Rows
from raymarch.shader import assemble
from tests.support.arrangements import ARRANGEMENTS, RADIUS, arranged


def objects(n, seed=0, size=1.0, materials=False, extra=0.0):
    """Boxes and spheres about the origin, one to a unit cube, in units of `size`."""
    rng = np.random.default_rng(seed)
    side = n ** (1 / 3)
    made = []
    for i in range(n):
        place = size * (rng.uniform(0.0, side, 3) - side / 2 + extra)
        if i % 2:
            each = rm.sphere(size * rng.uniform(0.15, 0.35))
        else:
            each = rm.box(size * rng.uniform(0.3, 0.6, 3)).rotate(rng.uniform(0, 3), rng.normal(size=3))
        each = each.translate(place)
        made.append(each.material(rm.Material(color=rng.uniform(0, 1, 3))) if materials else each)
    return made


def points(n, side, seed=1):
    return np.random.default_rng(seed).uniform(-side, side, (n, 3))


def onto(node, at, away=0.0):
    """Points near the surface: those given, moved along the gradient."""
    random = np.random.default_rng(3)
    return at - (node.distance(at) + random.uniform(-away, away, len(at)))[:, None] * node.gradient(at)


def located(node, exact=0.0):
    """The cells of the only rows of a node."""
    gathered = gather(node, "data", exact)
    (rows,) = gathered.rows
    return ObjectsInCells(gathered.rows).located(rows)


def compared(node, at, exact=0.0):
    """The field through cells in float64, that of all objects, and where the first is exact: in a blend wherever the
    objects of a cell are listed, in a hard union up to a part of the edge of a cell."""
    found = located(node, exact)
    value, true = evaluator([found.field.body], found.field.params)(at)[0], node.distance(at)
    near = evaluator([found.place.near], found.field.params)(at)[0]
    if not found.rows.family:
        made = found.cells
        assert np.all(near[true <= made.need + CUT * made.size / 2**made.depth])
        near = near & (true <= made.need + CUT * made.size / 2**made.depth)
    return value, true, near


def assert_same(node, at, scale=1.0, exact=0.0):
    value, true, near = compared(node, at, exact)
    np.testing.assert_allclose(value[near], true[near], atol=2e-6 * scale, rtol=0)
    rest, known = value[~near], true[~near]
    assert np.all(np.sign(rest) == np.sign(known))
    assert np.all(np.abs(rest) <= np.abs(known) + 2e-6 * scale)
    if not np.isinf(node.facts.lower).any():
        assert np.all(near[true <= exact])
    return near


@pytest.mark.parametrize("n", [2, 17, 100])
def test_a_cell_asks_every_object_that_decides_in_it(n):
    at = points(2000, 1.2 * n ** (1 / 3))
    node = rm.union(*objects(n))
    near = assert_same(node, np.concatenate([at, onto(node, at, 0.05)]))
    assert 0.3 < near.mean() < 0.7


@pytest.mark.parametrize(("name", "k"), [*((name, 0.0) for name in ARRANGEMENTS), ("line", 0.005)])
def test_memory_grows_as_the_objects_do_whatever_their_arrangement(name, k):
    """NumPy tells tracemalloc of its arrays."""
    places = arranged(name, 200)
    node = rm.union(*[rm.sphere(RADIUS).translate(place) for place in places], k=k)
    found = gather(node, "data", 0.0).rows
    tracemalloc.start()
    try:
        for rows in found:
            kept_cells.build(rows, 0.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 200 * (1 << 17)
    if name != "two groups":  # in float32, the spheres of the second are points
        assert_same(node, places + np.random.default_rng(1).normal(scale=2 * RADIUS, size=places.shape))


@pytest.mark.parametrize("k", [0.0, 0.005])
@pytest.mark.parametrize("name", ["one cluster", "two groups"])
def test_groups_far_apart_have_grids_of_their_own(name, k):
    """In one grid, a cell would list all objects of a group."""
    places = arranged(name, 300) if name == "one cluster" else arranged(name, 300) * (1e-2, 1.0, 1.0)
    balls = [rm.sphere(RADIUS).translate(place) for place in places]
    node = rm.union(*balls, k=k)
    found = gather(node, "data", 0.0)
    assert sorted(map(len, found.rows)) == ([10, 290] if name == "one cluster" else [150, 150]) and found.data == 300
    near = onto(node, places + np.random.default_rng(1).normal(scale=RADIUS, size=places.shape))
    each = [ObjectsInCells(found.rows).located(rows).field for rows in found.rows]
    values = np.min([evaluator([field.body], field.params)(near)[0] for field in each], axis=0)
    np.testing.assert_allclose(values, node.distance(near), atol=2e-7 * np.abs(places).max(), rtol=0)
    if name == "two groups":
        assert max(kept_cells.build(rows, 0.0).most for rows in found.rows) < 100
    wide = rm.union(*balls, k=4e3)
    assert len(gather(wide, "data", 0.0).rows) == 1, "its operands blend across the gap"
    copies = gather(rm.instances(rm.sphere(RADIUS), places), "data", 0.0)
    assert len(copies.rows) == 2
    np.testing.assert_allclose(copies.node.distance(near), rm.union(*balls).distance(near), atol=1e-9)


@pytest.mark.parametrize("k", [0.0, 0.05])
def test_objects_that_nearly_coincide_share_large_cells(k, monkeypatch):
    """No cell tells them apart, so finer cells would only repeat their list."""
    monkeypatch.setattr(lists, "MANY", 4000)
    places = 1e-3 * np.random.default_rng(5).normal(size=(300, 3))
    node = rm.union(*[rm.sphere(1.0).translate(place) for place in places], k=k)
    (rows,) = gather(node, "data", 0.0).rows
    assert len(kept_cells.build(rows, 0.0).lists) < 60_000  # 7,000,000 and 160,000 without the rule
    assert_same(node, points(1000, 1.5))


def test_many_objects_in_one_cell_are_doubted():
    node = rm.instances(rm.sphere(1.0), 1e-4 * np.random.default_rng(5).normal(size=(1500, 3)))
    (doubt,) = plan(rm.Scene(node)).warnings
    assert "objects nearly coincide" in doubt and "65,535" in doubt.cure
    assert not plan(rm.Scene(rm.union(*objects(60)))).warnings


def test_cells_are_not_smaller_than_rounding():
    """Far from the origin all objects around a point stay in doubt, so halving would only take memory."""
    (rows,) = gather(rm.union(*[ball.translate((1e6, 0, 0)) for ball in objects(60)]), "data", 0.0).rows
    made = kept_cells.build(rows, 0.0)
    assert made.size >= 8.0 * cells.ROUNDING * 1e6 and len(made.texels) < 1000


@pytest.mark.parametrize("blend", ["quadratic", "cubic", "quartic", "circular"])
def test_blends_are_folded_in_the_order_of_the_text(blend):
    node = rm.union(*objects(40), k=0.4, blend=blend)
    assert_same(node, points(1000, 2.4))


def test_a_wide_blend_of_many_objects():
    """All objects of a cell decide together, so that the order of folds matters most."""
    assert_same(rm.union(*objects(40), k=1.5), points(1000, 3.0))


def test_a_blend_holds_an_unbounded_solid():
    node = rm.union(rm.plane(), *objects(40), k=0.3)
    assert_same(node, points(3000, 6.0))


def test_unbounded_solids_of_a_blend_meet_far_from_its_objects():
    """Outside the grid they are blended with each other: there is no surface but theirs."""
    walls = rm.plane(), rm.plane((1, 0, 0), -6).round(0.1), rm.plane((0, 0, 1), -7), rm.plane((0.6, 0.8, 0), -9)
    node = rm.union(*objects(20), *walls, k=0.5)
    at = points(1500, 40.0)
    at = np.concatenate([at, onto(node, at, 0.5)])
    value, true, _ = compared(node, at)
    far = np.abs(at).max(axis=1) > 9.0
    assert np.all(np.abs(value) <= np.abs(true) + 1e-5)
    touching = far & (np.abs(true) < 0.5)
    assert np.sum(touching) > 50
    np.testing.assert_allclose(value[touching], true[touching], atol=1e-5)


def test_fields_are_exact_up_to_the_distance_that_effects_need():
    node = rm.union(*objects(40))
    for exact in (0.5, 2.0):
        assert_same(node, points(1000, 4.0), exact=exact)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_other_units(size):
    node = rm.union(*objects(40, size=size))
    assert_same(node, size * points(1000, 3.0), scale=size)


def test_objects_on_the_borders_of_cells():
    """A regular lattice, asked on the borders of its cells in float32, where rounding decides on the cell."""
    node = rm.union(*[rm.sphere(0.3).translate((x, y, z)) for x in range(4) for y in range(4) for z in range(4)])
    made = located(node).cells
    lines = [made.low[i] + made.size * np.arange(2, made.counts[i] - 1) for i in range(3)]
    at = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    for shift in (-1e-6, 0.0, 1e-6):
        assert_same(node, (at + shift).astype(np.float32).astype(np.float64))


def test_forms_of_any_operators():
    rng = np.random.default_rng(2)
    made = []
    for i in range(24):
        tree = rm.cylinder(0.1, rng.uniform(0.5, 1.0)) | rm.sphere(rng.uniform(0.2, 0.3)).translate((0, 0.5, 0))
        tree = tree - rm.box(0.2).translate((0.1, 0.5, 0))
        bent = rm.box((0.4, 1.0, 0.3)).twist(rng.uniform(0.5, 2.0)).scale(rng.uniform(0.4, 0.9))
        made.append((bent if i % 3 else tree).translate(rng.uniform(-2, 2, 3)))
    assert any(node.children[0].children[0].facts.divisor > 1.0 for node in made if node.children[0].name == "scale")
    near = assert_same(rm.union(*made), points(3000, 3.0))
    assert near.any()


@pytest.mark.parametrize(("kinds", "loops"), [(8, 1), (9, 2), (17, 3)])
def test_forms_beyond_eight_have_loops_of_their_own(kinds, loops):
    rng = np.random.default_rng(6)
    ball, made = rm.sphere(0.3), []
    for i in range(4 * kinds):
        kind = i % kinds  # a form for each number of balls
        solid = rm.union(*(ball.translate((0.1 * k, 0.07 * k * k, 0)) for k in range(kind + 1)), k=0.1)
        made.append(solid.translate(rng.uniform(-3, 3, 3)))
    node = rm.union(*made)
    found = located(node)
    assert len(found.rows.forms) == kinds
    assert len(find([found.field.body], "loop")) == loops
    assert assert_same(node, points(2000, 3.0)).any()


@pytest.mark.parametrize("copies", [lambda blade: blade.polar(5), lambda blade: blade.repeat(1.2, 2)])
def test_what_an_object_repeats_has_the_numbers_of_the_object(copies):
    """The field of what is evaluated at several places is a function of the point and of these numbers."""
    rng = np.random.default_rng(2)
    blades = [rm.box((rng.uniform(0.2, 0.5), 0.1, 0.2)).rotate(0.5 * x, "x").translate((0.4, 0, 0)) for x in range(12)]
    assert_same(rm.union(*(copies(b).scale(0.5).translate(rng.uniform(-2, 2, 3)) for b in blades)), points(2000, 3.0))


@pytest.mark.parametrize("k", [0.0, 0.3])
def test_long_lists_are_divided_into_pages(monkeypatch, k):
    """As they are where float32 cannot number all entries."""
    node = rm.union(*objects(30, seed=4), rm.plane(offset=-3.0) if k else rm.sphere(), k=k)
    monkeypatch.setattr("raymarch.plan.objects.MOST", 100)
    monkeypatch.setattr("raymarch.plan.objects._built", OrderedDict())
    assert len(located(node).pages) > 2
    at = points(1000, 3.0)
    assert_same(node, np.concatenate([at, onto(node, at, 0.05)]))


def test_gradients_are_those_of_the_text():
    node = rm.union(*objects(30), k=0.2)
    at = points(1000, 2.0)
    found = located(node)
    slope = evaluator([companion(found.field).body], found.field.params)(at)[0][:, :3]
    near = evaluator([found.place.near], found.field.params)(at)[0]
    away = np.abs(slope - node.gradient(at)).max(axis=1)[near]
    assert np.mean(away < 1e-4) > 0.99


# The cache


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_cells_are_kept_on_disk(tmp_path, monkeypatch, k):
    monkeypatch.setenv("RAYMARCH_CACHE", str(tmp_path))
    prices = replace(STANDARD, kept_objects=10, kept_seconds=0.0)
    (rows,) = gather(rm.union(*objects(20), k=k), "data", 0.0).rows
    first = kept_cells.build(rows, 0.1, prices)
    (file,) = (tmp_path / "cells").iterdir()
    with monkeypatch.context() as patch:
        patch.setattr(cells.Builder, "run", None)
        same = kept_cells.build(rows, 0.1, prices)
    for field in fields(first):
        assert np.array_equal(getattr(first, field.name), getattr(same, field.name)), field.name
    content = file.read_bytes()
    for spoiled in (b"", content[: len(content) // 2]):
        file.write_bytes(spoiled)
        assert np.array_equal(kept_cells.build(rows, 0.1, prices).texels, first.texels) and file.read_bytes() == content
    kept_cells.build(rows, 0.2, prices)
    kept_cells.build(gather(rm.union(*objects(20, seed=1), k=k), "data", 0.0).rows.popitem()[0], 0.1, prices)
    assert len(list((tmp_path / "cells").iterdir())) == 3
    monkeypatch.setattr(kept_cells, "KEPT_BYTES", 0)
    kept_cells.build(rows, 0.3, prices)
    assert len(list((tmp_path / "cells").iterdir())) == 1
    monkeypatch.setenv("RAYMARCH_CACHE", "/dev/null/nowhere")
    with pytest.warns(UserWarning, match="20 objects are built again in each run: cannot write '/dev/null/nowhere"):
        kept_cells.build(rows, 0.1, prices)


# Which objects


def count(node, choice="auto"):
    gathered = gather(node, choice, 0.0)
    return gathered.data


def test_few_objects_stay_text():
    assert count(rm.union(*objects(STANDARD.objects - 2))) == 0
    assert count(rm.union(*objects(STANDARD.objects))) == STANDARD.objects
    assert count(rm.union(*objects(STANDARD.objects)), "text") == 0
    assert count(rm.union(*objects(6)), "data") == 6


def test_few_objects_become_data_where_text_compiles_for_long():
    outline = [(0, -1), *((0.3 + 0.1 * (i % 2), -0.9 + 0.04 * i) for i in range(40)), (0, 1)]
    solids = rm.polygon(outline).revolve(), rm.polygon([*outline[:-2], (0, 0.9)]).revolve().round(0.01)
    pieces = [solids[i % 2].translate((i, 0, 0)) for i in range(8)]
    made = plan(rm.Scene(rm.union(*pieces) | rm.plane(offset=-2)))
    text = plan(rm.Scene(rm.union(*pieces) | rm.plane(offset=-2), quality=rm.Quality(objects="text")))
    estimate = f"text is estimated to take {text.compile_seconds:.0f} s to compile, more than 10"
    assert made.gathered.data == 8
    assert made.gathered.reason == f"{estimate}; rows share one function for each form"
    assert made.compile_seconds < 0.5 * text.compile_seconds
    assert not plan(rm.Scene(rm.union(*pieces[:2]))).gathered.rows


def test_a_scene_of_few_objects_has_the_same_shader():
    node = rm.union(*objects(6, materials=True)) | rm.plane()
    texts = [assemble(plan(rm.Scene(node, quality=rm.Quality(objects=choice)))).text() for choice in ("auto", "text")]
    assert texts[0] == texts[1]
    assert "texelFetch" not in texts[0]


def test_a_chain_of_bars_is_one_union():
    node = rm.plane()
    for each in objects(50):
        node |= each
    gathered = gather(node, "auto", 0.0)
    assert (gathered.data, gathered.text) == (50, 1)
    (rows,) = gathered.rows
    assert len(rows.forms) == 2


def test_few_moving_objects_stay_text_beside_others():
    small = rm.sphere(rm.Param("radius", 0.3, 0.1, 1.0)).translate((0, 3, 0))
    turning = rm.box(0.3).rotate(rm.time).translate((2, 0, 0))
    gathered = gather(rm.union(*objects(40), small, turning), "auto", 0.0)
    assert (gathered.data, gathered.text) == (40, 2)
    assert count(rm.union(*objects(40), small, k=0.2)) == 41  # the order of the folds would change
    assert count(rm.union(*objects(40), small, rm.plane(), k=0.2)) == 0


SPREAD = rm.Param("spread", 1.0, 0.2, 2.0)


def moving(n, blend=False):
    """Objects of which the positions, turns and sizes read time and a parameter, each by numbers of its own."""
    rng = np.random.default_rng(4)
    made = []
    for i in range(n):
        x, y, z, a, b = rng.uniform(-1.5, 1.5, 5)
        if i % 3 == 0:
            each = rm.sphere(0.3 + 0.1 * rm.sin(rm.time + a)).translate((SPREAD * x, SPREAD * y + b * rm.time, z))
        elif i % 3 == 1:
            each = rm.box(rng.uniform(0.2, 0.5, 3)).rotate(a + b * rm.time, rng.normal(size=3)).translate((x, y, z))
        else:
            tree = rm.cylinder(0.1, 0.6) | rm.sphere(0.2).translate((0, 0.2 + 0.1 * rm.sin(a * rm.time), 0))
            each = tree.scale(SPREAD + abs(a)).rotate(b).translate((x, y, z))
        made.append(each)
    return [each for each in made if each.facts.bounded]


@pytest.mark.parametrize("k", [0.0, 0.3])
def test_rows_follow_parameters_and_time(k):
    """The field through cells is that of the tree for each value, from the same functions and tables."""
    node = rm.union(*moving(36), k=k)
    at = points(150, 3.0)
    texts = set()
    for spread, time in ((1.0, 0.0), (1.9, 0.7), (0.2, 40.0)):
        with bound({"spread": spread}, time):
            near = assert_same(node, np.concatenate([at, onto(node, at, 0.05)]))
            assert near.mean() > 0.2
        texts.add(located(node).texels.name)
    assert len(texts) == 1


def test_tables_of_moving_objects_are_explained():
    made = plan(rm.Scene(rm.union(*moving(60)) | rm.plane(offset=-9)))
    out = io.StringIO()
    show(made, {}, 1, Console(file=out, width=200))
    count = made.gathered.data
    assert f"{count} objects, of which {count} move, 1 beside them as text: 32 or more" in out.getvalue()
    sizes = [entry["size"] for entry in as_dict(made, {})["textures"]]
    assert len(sizes) == 3 and all(f"{w} x {h}, " in out.getvalue() for w, h in sizes)


def test_costly_objects_become_data():
    made = plan(rm.Scene(rm.union(*[rm.ellipsoid((0.9, 0.5, 0.3 + 0.02 * i)).translate((i, 0, 0)) for i in range(28)])))
    assert made.gathered.data == 28 and not made.bounding.used
    (rows,) = made.gathered.rows
    total = 28 * operations([rows.forms[0].columns.field.body])
    told = f"28 of them take 700 operations or more, {total:,} together (from 20,000 on they are rows); "
    assert made.gathered.reason == told + "text repeats them, rows share one function for all"
    few = plan(rm.Scene(rm.union(*[rm.ellipsoid((0.9, 0.5, 0.3 + 0.02 * i)).translate((i, 0, 0)) for i in range(8)])))
    assert not few.gathered.data and few.bounding.used


def test_tables_of_moving_objects_are_those_of_their_own_blend():
    """Two unions of the same objects have other lists: a wider blend lists more of them."""
    row = [rm.sphere(0.2).translate((0.5 * i, 0.1 * rm.sin(rm.time + i), 0)) for i in range(40)]
    at = np.column_stack([np.linspace(-1, 20, 200), np.linspace(-1, 1, 200) ** 3, np.zeros(200)])
    narrow, wide = rm.union(*row, k=0.01), rm.union(*row, k=1.5)
    for node in (narrow, wide):
        with bound({}, 0.3):
            assert_same(node, at)
    assert located(narrow).texels != located(wide).texels
    assert located(narrow).texels == located(rm.union(*row, k=0.01)).texels


def test_a_moved_object_changes_tables_but_no_text():
    def name(a):
        made = rm.union(*[rm.sphere(0.2).translate((i, rm.sin(a * i * rm.time), 0)) for i in range(2, 41)])
        return located(made).texels

    first, again, other = name(1.0), name(1.0), name(1.5)
    assert first == again and first.name != other.name
    with bound({}, 0.0):
        still = first.values
    with bound({}, 0.3):
        assert not np.array_equal(still, first.values)


def test_motion_vectors_and_exports_keep_moving_objects_as_text():
    node = rm.union(*[rm.sphere(0.2).translate((i, rm.sin(i * rm.time), 0)) for i in range(2, 41)])
    assert plan(rm.Scene(node)).gathered.data == 39
    assert plan(rm.Scene(node, quality=rm.Quality(temporal="reproject"))).gathered.data == 0
    assert plan(rm.Scene(node), standalone=True).gathered.data == 0


def test_unions_below_other_operators():
    many = rm.union(*objects(40))
    assert count(many.translate((1, 2, 3)).rotate(0.3).scale(2.0) - rm.box(1)) == 40
    assert count(many.material(rm.Material()) & rm.sphere(3)) == 40
    assert count(many.scale((1, 2, 1)).shear(0.5, "x", "y")) == 40
    assert count(many.round(0.1)) == 0
    assert count(rm.union(many, rm.plane(), k=0.2)) == 40
    assert count(rm.union(many, rm.plane(), k=0.2, blend="chamfer")) == 0
    assert count(rm.union(*objects(40), k=0.2, blend="exponential")) == 0


def test_equal_rows_are_equal():
    def rows(seed):
        (found,) = gather(rm.union(*objects(40, seed)), "auto", 0.0).rows
        return found

    first, again, other = rows(0), rows(0), rows(1)
    assert isinstance(first, Rows)
    assert first == again and hash(first) == hash(again)
    assert first != other


def test_the_plan_says_which_and_why():
    for choice, used in (("auto", True), ("text", False)):
        scene = rm.Scene(rm.union(*objects(40)) | rm.plane(), quality=rm.Quality(objects=choice))
        (found,) = [f for f in as_dict(plan(scene), {})["features"] if f["name"] == "objects as data"]
        assert found["used"] is used
        assert ("40 objects" in found["reason"]) is used


def test_a_tree_without_objects_stays_and_one_with_them_has_their_rows():
    alone = rm.box(1).translate((1, 0, 0)) & rm.sphere(2)
    assert gather(alone, "data", 0.0).node is alone
    turned = (rm.union(*objects(9)) - rm.plane()).rotate(0.3).scale(2.0)
    made = gather(turned, "data", 0.0)
    assert len(made.rows) == 1 and any(rows_of(each) is not None for each in all_nodes(made.node))


def test_the_reason_for_text_is_what_was_asked_for():
    node = rm.union(*objects(9))
    assert gather(node, "text", 0.0).reason == "Quality(objects='text')"
    assert gather(node, "auto", 0.0).reason.startswith("no union of")
    assert gather(node, "text", np.inf).reason.startswith("ambient occlusion")


def test_shadows_of_lights_read_the_field_up_to_their_size():
    """The radius of a light is a length; the softness of a sun is an angle, which widens with the way."""
    ball = rm.sphere(2.0)

    def distance(light, **more):
        return exact_distance(rm.Scene(ball, lights=[light], **more))

    cone = {"shadow": True, "penumbra": "cone"}
    size = largest_size(rm.Scene(ball))
    np.testing.assert_allclose(size, 4 * np.sqrt(3))
    assert distance(rm.PointLight((0, 5, 0), radius=0.2, **cone)) == 0.2
    np.testing.assert_allclose(distance(rm.Sun((0, 1, 0), softness=0.2, **cone)), 0.2 * size)
    assert distance(rm.Sun((0, 1, 0), shadow=True, softness=0.2, penumbra="sampled")) == 0.0
    assert distance(rm.PointLight((0, 5, 0), radius=100.0, **cone)) == size
    assert distance(rm.Sun((0, 1, 0)), occlusion=rm.AmbientOcclusion(4, reach=0.7)) == 0.7


def test_a_grid_reserves_what_a_blend_lowers_the_field_by_and_more_beside_a_plane():
    """An unbounded operand that is nearer decides alone, so that the blend is lowered twice."""
    balls = [rm.sphere(0.3).translate((i, 0, 0)) for i in range(8)]
    alone, beside = (located(rm.union(*some, k=0.2)).cells for some in (balls, [*balls, rm.plane(offset=-1)]))
    lowers = 0.25 * 0.2 * 3
    assert alone.less == REACH["quadratic"] * 0.2 + lowers
    assert beside.less == REACH["quadratic"] * 0.2 + 2 * 0.25 * 0.2 * 4


def sway(p):
    return rm.vec3(0.1 * rm.sin(3.0 * p.y + rm.time), 0.0, 0.0)


CHANGING = {
    "warp": lambda node: node.warp(sway),
    "warp by a lambda": lambda node: node.warp(lambda p: 0.1 * rm.sin(3.0 * p.zxy + SPREAD * rm.time)),
    "displacement": lambda node: node.displace_by(lambda p: 0.05 * rm.sin(5.0 * p.x + rm.time)),
}


@pytest.mark.parametrize("kind", CHANGING)
def test_solids_that_functions_of_time_bend_are_rows(kind):
    """Seven are made by calls of their own; their functions are equal. A look-up costs what it does for balls."""
    bent = [CHANGING[kind](rm.sphere(0.2 + 0.01 * i)) for i in range(7)]
    node = rm.union(*[bent[i % 7].translate((i % 7 - 3, i // 7 - 3, 0)) for i in range(42)])
    balls = rm.union(*[rm.sphere(0.3).translate((i % 7, i // 7, rm.sin(rm.time + i))) for i in range(42)])
    (rows,) = gather(node, "auto", 0.0).rows
    assert len(rows) == 42 and len(rows.forms) == 1
    assert counted(node) < counted(balls) + 30
    at = np.concatenate(
        [points(50, 3.0), np.random.default_rng(2).integers(-2, 3, (100, 3)) * (1, 1, 0) + points(100, 0.25)]
    )
    for time in (0.0, 0.7, 40.0):
        with bound({"spread": 1.3}, time):
            near = assert_same(node, at)
        assert near.mean() > 0.1
    assert gather(node, "auto", 0.0, live=False).data == 0


def counted(node):
    """Operations of a look-up among rows, and of one object."""
    found = located(node)
    return operations([found.field.body], turns=False) + operations([found.rows.forms[0].columns.field.body])


def objects_and_checks():
    checks = rm.checker((1, 0, 0), (0, 0, 1), 0.5, axis="y")
    return rm.union(*objects(60, materials=True)) | rm.plane(offset=-3).material(rm.Material(color=checks))


def test_gradients_and_materials_find_the_nearest_object_once():
    """On hardware, no loop computes gradients, and the material takes its distance from what finds the row."""
    text = assemble(plan(rm.Scene(objects_and_checks()), device=HARDWARE)).text("color")
    gradient, material = (text.split(head)[1].split("\n}\n")[0] for head in (" objects_gradient(", " material_at("))
    assert "for (" not in gradient and gradient.count("objects_found(") == 1
    assert material.count("objects_found(") == 1 and "objects(" not in material


def test_software_finds_gradients_in_the_loop_over_distances():
    """Where both sides of a branch are executed, the forms stand once in what is done at a hit."""
    text = assemble(plan(rm.Scene(objects_and_checks()), device=SOFTWARE)).text("color")
    assert "objects_found(" not in text and "for (" in text.split(" objects_gradient(")[1].split("\n}\n")[0]


@pytest.mark.parametrize("device", [SOFTWARE, HARDWARE], ids=["software", "hardware"])
def test_the_gradient_of_one_form_is_evaluated_for_each_object(device):
    node = rm.union(*objects(60, materials=True), k=0.1)
    part = assemble(plan(rm.Scene(node), device=device)).text("color").split(" objects_part(")[1].split("\n}\n")[0]
    assert " = field_gradient(" not in part and " ? field_gradient(" in part, "as a side of a choice only"


@pytest.mark.parametrize("together", [1, 8])
def test_gradients_do_not_depend_on_the_class_of_the_device(together):
    """Near surfaces, and where the field is a bound only, in one loop and in loops of each form."""
    gathered = gather(rm.union(*objects(60)), "data", 0.3)
    (rows,) = gathered.rows
    prices = replace(STANDARD, forms_together=together)
    made = [ObjectsInCells(gathered.rows, prices, branches).located(rows).field for branches in (False, True)]
    software, hardware = (evaluator([companion(f)(*f.params)], f.params)(points(400, 4.0))[0] for f in made)
    np.testing.assert_array_equal(software, hardware)


def test_facts_of_a_scene_that_is_made_again_are_derived_together(monkeypatch):
    """What `remembered` knows of an equal solid asks nothing of this one; its facts were then derived node by node."""
    asked = []
    derive = derivation.facts_of_members
    monkeypatch.setattr(derivation, "facts_of_members", lambda *given: asked.append(1) or derive(*given))
    kept = []
    for _ in range(2):
        asked.clear()
        balls = [rm.sphere(0.3).translate((i, 0, 0)) for i in range(64)]
        kept.append(rm.Scene(rm.union(*balls), lights=[rm.Sun()]))
        plan(kept[-1])
        assert 0 < len(asked) < 8
