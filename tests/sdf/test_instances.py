"""`rm.instances`: arrays against nodes, and what is refused."""

import pickle

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import PlanError, SceneError
from raymarch.plan import plan
from raymarch.sdf.labels import relabelled
from raymarch.sdf.shifted import shifted

PLACES = np.random.default_rng(0).uniform(-2, 2, (12, 3))
SIZES = np.linspace(0.5, 1.5, 12)
AT = np.random.default_rng(1).uniform(-3, 3, (500, 3))
RED, BLUE = rm.Material(color=(1, 0, 0)), rm.Material(color=(0, 0, 1))


def matrices(n, seed=2):
    """Rotations times factors with offsets, for row vectors."""
    random = np.random.default_rng(seed)
    turns = np.linalg.qr(random.normal(size=(n, 3, 3)))[0]
    turns *= np.linalg.det(turns)[:, None, None]
    made = np.zeros((n, 4, 4))
    made[:, :3, :3] = turns * random.uniform(0.5, 2.0, n)[:, None, None]
    made[:, 3, :3] = random.uniform(-2, 2, (n, 3))
    made[:, 3, 3] = 1.0
    return made


def test_positions_and_matrices_equal_nodes():
    box = rm.box((0.3, 0.5, 0.2)).round(0.05)
    given = matrices(9)
    columns = np.swapaxes(given, 1, 2)[:, :3]
    moved = rm.union(*[box.translate(p) for p in PLACES])
    turned = rm.union(*[box.transform(m) for m in given])
    scaled = rm.union(*[box.scale(s).translate(p) for p, s in zip(PLACES, SIZES, strict=True)])
    for made, node in (
        (rm.instances(box, PLACES), moved),
        (rm.instances(box, given), turned),
        (rm.instances(box, columns), turned),
        (rm.instances(box, np.column_stack([PLACES, SIZES])), scaled),
    ):
        np.testing.assert_allclose(made.distance(AT), node.distance(AT), atol=1e-12)
        np.testing.assert_allclose(made.gradient(AT), node.gradient(AT), atol=1e-9)
        np.testing.assert_allclose(made.bounds, node.bounds, atol=1e-12)
        assert made.exactness == node.exactness


def test_arrows_point_along_their_vectors():
    arrow = rm.cylinder(0.1, 1).translate((0.02, 0.5, 0.05))
    axes = np.concatenate([np.eye(3), -np.eye(3), [(1e-9, -1, 0), (0, -1, 1e-9)]])
    vectors = np.concatenate([axes, np.random.default_rng(3).normal(size=(40, 3))])
    points = np.random.default_rng(4).uniform(-2, 2, (50, 3))
    for vector in vectors:
        length = float(np.linalg.norm(vector))
        made = rm.instances(arrow, [[0.5, 1, -2, *vector]])
        axis = rm.instances(rm.capsule((0, 0, 0), (0, 1, 0), 1e-3), [[0.5, 1, -2, *vector]])
        assert np.allclose(axis.distance(np.add((0.5, 1, -2), np.outer([0, 0.5, 1], vector))), -1e-3 * length)
        if vector[1] > -0.999 * length:  # the shortest way to the opposite direction is not unique
            same = arrow.scale(length).orient(vector).translate((0.5, 1, -2))
            np.testing.assert_allclose(made.distance(points), same.distance(points), atol=1e-12)


def test_each_kind_of_array_is_drawn_far_from_the_origin(egl):
    places = np.array([(0.0, 0, 0), (1.5, 0, 0)])
    rows = {
        "positions": places,
        "sizes": np.column_stack([places, [0.5, 0.7]]),
        "vectors": np.column_stack([places, [(1, 1, 0), (0, -0.5, 0)]]),
    }
    with rm.Renderer((24, 16), context=egl) as renderer:
        for array in rows.values():
            near, far = array, array.copy()
            far[:, 0] += 2.0**21
            drawn = [
                renderer.render(rm.Scene(rm.instances(rm.cone(0.5, 1), given), rm.Camera((x, 1, 6), (x, 0, 0)))).color
                for given, x in ((near, 0.0), (far, 2.0**21))
            ]
            np.testing.assert_allclose(*drawn, atol=1e-5)


def test_equal_arrays_are_equal_and_pickled():
    made = rm.instances(rm.box(1), PLACES, ([RED, BLUE], np.arange(12) % 2))
    assert made == rm.instances(rm.box(1), PLACES.copy(), ([RED, BLUE], np.arange(12) % 2))
    assert made != rm.instances(rm.box(1), PLACES + 0.1)
    again = pickle.loads(pickle.dumps(made))
    assert again == made and again.labelled


def test_materials():
    each = rm.instances(rm.sphere(0.2), PLACES[:2], [RED, BLUE])
    assert rm.Scene(each).materials[1:] == (RED, BLUE)
    one = rm.instances(rm.sphere(0.2), PLACES, RED)
    assert rm.Scene(one).materials[1:] == (RED,)
    assert rm.Scene(relabelled(each, lambda m: BLUE)).materials[1:] == (BLUE,)
    kept = rm.instances(rm.sphere(0.2).material(BLUE) | rm.box(0.1), PLACES, RED)
    assert set(rm.Scene(kept).materials[1:]) == {RED, BLUE}


COLORS = np.random.default_rng(3).integers(0, 3, (12, 3)) / 2.0
AS_STRINGS = ["#%02x0000" % (i // 4 * 100) for i in range(12)]


@pytest.mark.parametrize(
    ("given", "of"),
    [
        (COLORS, lambda i: {"color": COLORS[i]}),
        (COLORS.tolist(), lambda i: {"color": COLORS[i]}),
        (AS_STRINGS, lambda i: {"color": AS_STRINGS[i]}),
        (
            {"albedo": COLORS, "roughness": COLORS[:, 0], "metalness": 1, "f0": (0.1, 0.2, 0.3)},
            lambda i: {"albedo": COLORS[i], "roughness": COLORS[i, 0], "metalness": 1, "f0": (0.1, 0.2, 0.3)},
        ),
    ],
    ids=["colours", "a list", "strings", "values"],
)
def test_values_of_each_instance_are_its_material(given, of):
    expected = [rm.Material(**of(i)) for i in range(12)]
    node = rm.instances(rm.sphere(0.2), PLACES, given)
    assert node == rm.instances(rm.sphere(0.2), PLACES, expected)
    assert pickle.loads(pickle.dumps(node)) == node


def test_a_shift_is_exact_far_from_the_origin():
    far = PLACES + 1e7
    near = shifted(rm.instances(rm.box(0.3), far), np.full(3, 1e7))
    np.testing.assert_allclose(near.distance(AT), rm.instances(rm.box(0.3), far - 1e7).distance(AT), atol=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rm.instances(rm.plane(), PLACES), "unbounded"),
        (lambda: rm.instances(rm.circle().repeat(3), PLACES), "unbounded"),
        (lambda: rm.instances(3, PLACES), "a solid"),
        (lambda: rm.instances(rm.sphere(rm.Param("r", 1, 0.1, 2)), PLACES), "without Param"),
        (lambda: rm.instances(rm.box(1), PLACES[:, :2]), r"\(12, 2\)"),
        (lambda: rm.instances(rm.box(1), np.zeros((0, 3))), "one or more"),
        (lambda: rm.instances(rm.box(1), [(0, 0, np.nan)]), "finite"),
        (lambda: rm.instances(rm.box(1), np.swapaxes(matrices(3), 1, 2)), "transpose"),
        (lambda: rm.instances(rm.box(1), matrices(3) * np.array([1, 2, 1, 1])), "rotations"),
        (lambda: rm.instances(rm.box(1), PLACES, [RED]), "1 materials for 12"),
        (lambda: rm.instances(rm.box(1), PLACES, ([RED], np.ones(12, int))), "from 0 to 0"),
        (lambda: rm.Scene(rm.instances(rm.box(1), PLACES, "red")), "Material"),
        (lambda: rm.instances(rm.box(1), PLACES, COLORS[:5]), r"color of shape \(5, 3\) \(shape \(12, 3\)"),
        (lambda: rm.instances(rm.box(1), PLACES, np.ones((12, 4))), "to_hex"),
        (lambda: rm.instances(rm.box(1), PLACES, COLORS * 255), r"object \d+: Material: color = \("),
        (lambda: rm.instances(rm.box(1), PLACES, ["red", "blue"]), "2 values of color for 12 objects"),
        (lambda: rm.instances(rm.box(1), PLACES, {"rough": COLORS[:, 0]}), "did you mean 'roughness'"),
        (lambda: rm.instances(rm.box(1), PLACES, colors=COLORS), "did you mean 'materials'"),
    ],
)
def test_wrong_arguments_are_refused(make, words):
    with pytest.raises(SceneError, match=words) as caught:
        make()
    assert __file__ in str(caught.value)


def test_operators_that_need_the_exact_field_are_refused():
    with pytest.raises(PlanError, match="round of instances"):
        plan(rm.Scene(rm.instances(rm.box(1), PLACES).round(0.1)))
