"""Proofs of pictures: what is right is proved, what is wrong is contradicted, and bad input is refused."""

from __future__ import annotations

import pickle
import re
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.gpu.part import PicturePart
from raymarch.proof.parts import Operands
from raymarch.scene.parameter import Values
from raymarch.sdf.definition import cube
from raymarch.sdf.domain import Positive
from raymarch.truth.large import field_of

SIZE = (48, 27)


BOX = (rm.box((1.6, 1.6, 1.6)).round(0.1) - rm.sphere(1.1)).rotate(0.6, "y").translate((-1.3, 0, 0))
RING = rm.union(rm.torus(0.8, 0.3), rm.sphere(0.6), k=0.3).rotate(1.1, "x").translate((1.3, 0.2, 0))
SCENE = rm.Scene(BOX | RING | rm.plane(offset=-0.9), camera=rm.Camera((1.5, 2.5, 6.5), (0, 0, 0)))


@cache
def truth_of(scene: rm.Scene = SCENE) -> rm.Truth:
    return rm.truth(scene, SIZE, outputs=("depth", "normal"))


def depth_of(scene: rm.Scene = SCENE) -> np.ndarray:
    return truth_of(scene).depth.copy()


@cache
def proof_of_the_truth() -> rm.Proof:
    return rm.prove(SCENE, with_depth(depth_of()))


def with_depth(depth: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(depth=depth)


def test_all_hits_of_a_picture_are_proved() -> None:
    found = rm.prove(SCENE, size=SIZE)
    assert found.share == 1.0 and found.contradicted == found.open == 0
    assert np.all(found.evaluations.mean() < 20)
    hit = np.isfinite(found.depth)
    assert np.all(found.low[hit] >= (found.depth - found.within)[hit] * (1 - 1e-12))
    assert str(found).startswith("1,296 of 1,296 pixels proved at 48x27: nothing deeper than 0.05 px")
    assert found.as_dict()["proved"] == 1296 and found.image().size == SIZE
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.state, found.state) and repr(again) == repr(found)


def test_the_reference_is_proved_within_a_millionth_of_a_pixel() -> None:
    found = rm.prove(SCENE, truth_of(), tolerance="1e-6px")
    assert found.contradicted == 0 and found.share > 0.99


@pytest.mark.parametrize("pixels", [-0.2, 0.2, 3.0, 40.0])
def test_hits_that_are_moved_are_contradicted(pixels: float) -> None:
    depth = depth_of()
    proof = proof_of_the_truth()
    hit = np.isfinite(depth)
    few = np.zeros_like(hit)
    few[1::4, 1::4] = True
    hit &= few
    moved = rm.prove(SCENE, with_depth(np.where(hit, depth + pixels * proof.within / 0.05, depth)))
    steep = hit & (np.abs(np.einsum("ijk,ijk->ij", *_normals_and_directions())) > 0.5)
    assert np.all(moved.state[steep] == 1)
    # a grazing ray is still near the surface there, and none of the moved hits passes for one on the ray
    assert np.all((moved.state > 0) | moved.grazing | ~hit)
    assert not proof.grazing.any()


def test_a_hit_that_is_early_or_late_on_a_grazing_ray_is_told_apart() -> None:
    """The ray sinks 1 in 100: a hit moved by 10 tolerances along it is off by a tenth of one in space."""
    scene = rm.Scene(rm.plane(), camera=rm.Camera((0, 1, 0), (0, 0, -100), fov=1e-4))
    depth = np.full((3, 3), float(np.hypot(1, 100)))
    for off in (-0.5, 0.0, 0.5):
        found = rm.prove(scene, with_depth(depth * (1.0 + off / depth)), tolerance=0.05)
        assert found.share == 1.0 and found.grazing.all() == (off != 0.0) == found.grazing.any()
    assert "for 9 of them in space, but not along the ray, which grazes it" in str(found)


def _normals_and_directions() -> tuple[np.ndarray, np.ndarray]:
    return truth_of().normal, truth_of().direction


def test_a_part_that_is_missing_is_contradicted() -> None:
    without = rm.Scene(BOX | rm.plane(offset=-0.9), camera=SCENE.camera)
    found = rm.prove(SCENE, with_depth(depth_of(without)))
    missing = depth_of(without) > depth_of() + 10 * found.within
    same = depth_of(without) == depth_of()
    assert missing.sum() > 50 and np.mean(found.state[missing] == 1) > 0.95
    assert np.all(found.state[same] == 0)
    _, directions = _normals_and_directions()
    for row, column in np.argwhere(
        missing & (found.state == 0)
    ):  # a sliver: the ray meets the ring less deep than that
        along = depth_of()[row, column] + np.linspace(-0.1, 1.0, 10_001)[:, None]
        depth = -RING.distance(np.array([1.5, 2.5, 6.5]) + along * directions[row, column]).min()
        assert 0.0 < depth < found.within[row, column]


def test_a_part_that_is_not_there_is_contradicted() -> None:
    without = rm.Scene(BOX | rm.plane(offset=-0.9), camera=SCENE.camera)
    found = rm.prove(without, with_depth(depth_of()))
    invented = depth_of() < depth_of(without) - 10 * found.within
    same = depth_of(without) == depth_of()
    assert np.all(found.state[invented] == 1) and np.all(found.state[same] == 0)


def test_a_wrong_bound_is_contradicted() -> None:
    """The field is three times as steep as it states: rays step through the solid."""

    @rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
    def steep_ball(p: Any, radius: Positive = 1.0) -> Any:
        """A ball whose field is too large."""
        return 8.0 * (rm.length(p) - radius)

    scene = rm.Scene(steep_ball(0.3), camera=rm.Camera((0, 0, 4)))
    found = rm.prove(scene, size=SIZE)
    assert found.contradicted > 0


def test_a_camera_inside_of_a_solid() -> None:
    room = rm.Scene(rm.box((4, 4, 4)) - rm.sphere(0.5).translate((5, 0, 0)), camera=rm.Camera((0, 0, 1), (0.3, 0.2, 0)))
    found = rm.prove(room, size=SIZE)
    assert np.isfinite(found.depth).all() and found.share == 1.0


def test_other_cameras() -> None:
    for camera in (
        rm.Camera((1.5, 2.5, 6.5), (0, 0, 0), projection="orthographic"),
        rm.Camera((1.5, 2.5, 6.5), (0, 0, 0), near=5.0, far=9.0),
    ):
        found = rm.prove(SCENE.replace(camera=camera), size=SIZE)
        assert found.share > 0.999 and found.open == 0, camera


def test_time_and_parameters() -> None:
    height = rm.Param("height", 0.2, 0, 2)
    ball = rm.sphere(0.5).translate((rm.sin(rm.time), height, 0)) | rm.plane(offset=-1)
    scene = rm.Scene(ball, camera=rm.Camera((0, 1, 5), (0, 0, 0)))
    with rm.Renderer(SIZE) as renderer:
        frame = renderer.render(scene, 0.7, {"height": 1.1}, outputs=("depth",))
    assert rm.prove(scene, frame, params={"height": 1.1}).share == 1.0
    assert rm.prove(scene, with_depth(frame.depth)).contradicted > 0


@pytest.mark.parametrize(
    ("frame", "within", "words"),
    [
        (SimpleNamespace(), "0.05px", "which has no depth"),
        (with_depth(np.zeros(4)), "0.05px", "shape"),
        (with_depth(np.full((4, 4), np.nan)), "0.05px", "NaN"),
        (with_depth(np.full((4, 4), -1.0)), "0.05px", "below 0"),
        (None, "0px", "above 0"),
        (None, "half", "tolerance"),
        (None, "5 cm", "a length such as 0.01 in the scene's unit"),
        (None, "nan px", "tolerance"),
        (None, None, "tolerance"),
        (None, -1.0, "tolerance"),
    ],
)
def test_bad_input_is_one_line(frame: object, within: object, words: str) -> None:
    with pytest.raises(SceneError, match=words) as fault:
        rm.prove(SCENE, frame, tolerance=within)  # type: ignore[arg-type]
    assert "\n" not in str(fault.value)


def test_other_bad_arguments_are_one_line() -> None:
    scene, frame = rm.Scene(rm.sphere(rm.Param("r", 1, 0.5, 2))), with_depth(np.ones((2, 2)))
    timed = SimpleNamespace(depth=frame.depth, time="noon")
    for given, words in (
        ({"progress": 3}, "prove: progress = 3"),
        ({"frame": timed}, "time = 'noon'"),
        ({"params": {"q": 1}}, "unknown parameter 'q'"),
        ({"params": {"r": 9}}, "parameter 'r' = 9"),
        ({"frame": np.ones((2, 2))}, "frame = .*, which has no depth"),
        ({"size": (3, 2)}, r"depth of 2x2 pixels for size = \(3, 2\)"),
        ({"frame": None, "size": (16384, 16384)}, r"size = \(16384, 16384\) \(at most 16,777,216 pixels"),
        ({"frame": None, "size": (8.5, 4)}, "width = 8.5"),
        ({"frame": None, "size": ("a", "b")}, r"size = \('a', 'b'\) \(\(width, height\)"),
        ({"frame": None, "size": (None, None)}, r"size = \(None, None\) \(\(width, height\)"),
        ({"size": 2}, r"size = 2 \(\(width, height\)"),
        ({"tolerance": "1e400px"}, "tolerance = '1e400px'"),
        ({"pixels": 3}, "pixels = 3"),
    ):
        with pytest.raises(rm.RaymarchError, match=words) as fault:
            rm.prove(scene, **{"frame": frame, **given})
        assert "\n" not in str(fault.value)


def test_sizes_and_tolerances_in_other_forms() -> None:
    frame = truth_of()
    for given in ({"size": SIZE}, {"tolerance": " 0.05 px "}, {"tolerance": np.float32(0.01)}, {"tolerance": "0.01"}):
        assert rm.prove(SCENE, frame, **given).contradicted == 0
    assert rm.prove(SCENE, frame, tolerance=np.float32(0.25)).tolerance == "0.25"


def test_without_a_hit_the_sentence_speaks_of_none() -> None:
    away = rm.prove(rm.Scene(rm.sphere(), rm.Camera((0, 0, 5), (0, 0, 9))), size=(4, 3))
    assert "12 of 12 pixels proved at 4x3: no hit is reported, and nothing deeper than 0.05 px" in str(away)


def test_a_picture_of_something_else_is_refused() -> None:
    """By one line, where the picture knows what it shows; other colours and other nodes of the same field are no
    difference."""
    moving = rm.sphere(rm.Param("r", 1.0, 0.5, 2.0)).translate((rm.sin(rm.time), 0, 0))
    scene = rm.Scene(moving | rm.plane(offset=-1), SCENE.camera)
    red = rm.sphere(rm.Param("r", 1.0, 0.5, 2.0)).translate((rm.sin(rm.time), 0, 0)).material(rm.Material((1, 0, 0)))
    same = scene.replace(node=red | rm.plane(offset=-1), lights=[rm.Sun((0, 1, 0))])
    with rm.Renderer((8, 6)) as renderer:
        frame = renderer.render(scene, 0.5, {"r": 1.5}, outputs=("depth",))
        turned = renderer.render(
            scene, outputs=("depth",), pose=scene.replace(camera=rm.Camera((0, 0, 9))).pose(Values({}, 0.0), 8 / 6)
        )
        part = renderer.render(scene, outputs=("depth",), part=PicturePart((16, 12)))
    reference = rm.truth(scene, (8, 6), 0.5, {"r": 1.5}, ("depth",))
    for picture in (frame, reference):
        assert rm.prove(same, picture, params={"r": 1.5}, time=0.5).contradicted == 0
        for other, how, words in (
            (scene, {"params": {"r": 1.0}, "time": 0.5}, "shows the solid at time = 0.5 with {'r': 1.5}"),
            (scene, {"params": {"r": 1.5}, "time": 0.6}, "shows the solid at time = 0.5 with {'r': 1.5}"),
            (scene.replace(node=rm.sphere()), {"time": 0.5}, "shows another solid"),
            (scene.replace(camera=rm.Camera((0, 0, 9))), {"params": {"r": 1.5}}, "shows another camera"),
        ):
            with pytest.raises(SceneError, match="prove: the frame " + re.escape(words)) as fault:
                rm.prove(other, picture, **how)
            assert "\n" not in str(fault.value)
        sent = pickle.loads(pickle.dumps(picture))  # knows its depth alone
        assert rm.prove(scene.replace(node=rm.sphere()), sent, time=0.5).contradicted > 0
    for picture, words in ((turned, "shows another camera"), (part, "is a part of one of (16, 12)")):
        with pytest.raises(SceneError, match=re.escape(words)):
            rm.prove(scene, picture)


def test_what_keeps_pixels_open_is_named() -> None:
    code = "float bumpy(vec3 p) { return length(p) - 1.0; }"
    solid = rm.glsl_node(code, "bumpy", bounds=((-1, -1, -1), (1, 1, 1)), twin=lambda p: np.linalg.norm(p, axis=1) - 1)
    found = rm.prove(rm.Scene(solid, camera=rm.Camera((0, 0, 4))), size=SIZE)
    assert found.open > 0 and any("GLSL of your own" in reason for reason in found.reasons)
    assert found.assumed == ()


def test_an_estimate_that_ends_rays_before_its_surface_is_named() -> None:
    @rm.shape(exactness="estimate", bounds=lambda: cube(1.0))
    def flat(p: Any) -> Any:
        """A ball whose field is small far from it."""
        return 0.02 * (rm.length(p) - 1.0)

    found = rm.prove(rm.Scene(flat().translate((0, 0.1, 0)) | rm.plane(offset=-1), camera=SCENE.camera), size=(24, 14))
    assert found.contradicted > 5 and found.estimates == ("flat",) == tuple(found.as_dict()["estimates"])
    assert f"{found.contradicted} contradicted (rays end where an estimate is small: flat)" in str(found)


@pytest.mark.parametrize("radius, wrong", [(1.0, False), (1.02, True)])
def test_glsl_of_the_user_is_proved_by_its_twin(radius: float, wrong: bool) -> None:
    """And by the constant that the user states. The proof names both; a twin with other values is contradicted."""
    code = "float bumpy(vec3 p) { return 2.0 * (length(p) - 1.0); }"
    box = ((-1, -1, -1), (1, 1, 1))
    solid = rm.glsl_node(code, "bumpy", "exact", 2.0, box, lambda p: 2.0 * (np.linalg.norm(p, axis=1) - radius))
    for node in (solid, solid.twist(0.5) ^ rm.cone()):
        found = rm.prove(rm.Scene(node, camera=rm.Camera((0.5, 1, 4))), size=SIZE)
        assert found.assumed == ("bumpy: its twin, and its Lipschitz constant 2",)
        assert found.contradicted > 100 if wrong else found.share == 1.0


def test_a_choice_by_a_distance_of_exactly_0() -> None:
    """Inside, the first of the two distances of a box frame is 0, and stays 0 when it is rounded outwards."""
    assert rm.prove(rm.box_frame((1.6, 1.2, 1.4), 0.15), size=(32, 32)).share == 1.0


def test_choices_that_are_open_along_many_stretches() -> None:
    """The value of a fold is not known along them, also at their centres, but at places around: these rays go on."""
    camera = rm.Camera((-1.59060528, -0.91013131, 0.81977176), fov=52)
    assert rm.prove(rm.Scene(rm.tetrahedron(), camera), size=(48, 48)).share == 1.0


def test_where_nothing_is_shown_nothing_is_contradicted() -> None:
    """A sheet of no thickness holds no point for certain, and no range along the ray is free of it."""
    sheet = rm.sphere() ^ rm.sphere()
    found = rm.prove(sheet, with_depth(rm.truth(rm.sphere(), size=(16, 16)).depth), size=(16, 16))
    assert found.contradicted == 0 and found.open > 0


def test_a_shape_that_solves_an_equation_is_proved_by_its_constant_which_is_named() -> None:
    scene = rm.Scene(rm.ellipsoid((2.0, 1.0, 1.4)) | rm.plane(offset=-1), camera=SCENE.camera)
    found = rm.prove(scene, size=SIZE)
    assert found.share == 1.0 and found.assumed == ("ellipsoid: its Lipschitz constant 1",)
    assert rm.prove(SCENE, size=(4, 4)).assumed == ()


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_part_of_a_pixel_that_is_covered_lies_between_its_bounds(projection: Any) -> None:
    width, height, samples = 24, 14, 8
    camera = rm.Camera((1.5, 2.5, 6.5), (0, 0, 0), projection=projection)
    scene = rm.Scene(BOX | RING, camera=camera)
    fine = rm.truth(scene, (width * samples, height * samples), outputs=("depth",)).depth
    part = np.isfinite(fine).reshape(height, samples, width, samples).mean(axis=(1, 3))
    coarse = fine[samples // 2 :: samples, samples // 2 :: samples]
    found = rm.prove(scene, with_depth(coarse), pixels="whole")
    assert found.coverage is not None
    low, high = found.coverage
    assert np.all((low <= part) & (part <= high)) and np.any(low == 1.0) and np.any(high == 0.0)
    edge = (part > 0.0) & (part < 1.0)
    assert np.mean((high - low)[edge]) < 0.3 and np.mean((high - low)[~edge]) < 0.01
    assert "pixels are covered" in str(found)
    with pytest.raises(SceneError, match="pixels"):
        rm.prove(scene, pixels="half")  # type: ignore[arg-type]


def test_100_000_objects_ask_those_on_a_ray_alone() -> None:
    """With hits in closed form."""
    places = np.random.default_rng(1).uniform(-100, 100, (100_000, 3)).astype(np.float32).astype(np.float64)
    scene = rm.Scene(rm.instances(rm.box(1.0), places), camera=rm.Camera((0.3, 0.2, 150), (0, 0.1, 0)))
    origins, directions = scene.pose(Values({}, 0.0), 16 / 9).rays(np.arange(16), np.arange(9)[:, None], (16, 9))
    depth = np.full((9, 16), np.inf)
    for i, j in np.ndindex(9, 16):
        sides = [
            (places + half - np.broadcast_to(origins, (9, 16, 3))[i, j]) / directions[i, j] for half in (-0.5, 0.5)
        ]
        enter, leave = np.minimum(*sides).max(axis=1), np.maximum(*sides).min(axis=1)
        depth[i, j] = np.min(enter, where=enter <= leave, initial=np.inf)
    found = rm.prove(scene, with_depth(depth))
    assert np.isfinite(depth).sum() > 100 and found.share == 1.0 and found.evaluations.mean() < 20


def test_a_vector_times_itself_is_enclosed() -> None:
    """So gradient noise has its weights."""
    ball = rm.implicit(lambda p: rm.dot(p * p, (1.0, 2.0, 1.0)) - 1.0, 1.5)
    assert rm.prove(ball, rm.truth(ball, size=(7, 4), outputs=("depth",))).proved == 28


@pytest.mark.parametrize(
    "solid",
    [
        rm.box((0.9, 0.5, 0.7)).repeat_mirrored(2.0, (3, 1, 1)),
        rm.intersection(rm.box((0.9, 0.5, 0.7)), rm.box((0.9, 0.6, 0.7)), k=0.3, blend="stairs"),
    ],
    ids=["number of a cell", "face of a step"],
)
def test_a_value_on_a_border_of_cells(solid: rm.Node) -> None:
    """The remainder of a whole number, and of a value that is one along a whole face: points have both sides, too."""
    found = rm.prove(rm.Scene(solid, rm.Camera((1.2, 1.5, 2.5))), size=(32, 18))
    assert found.share == 1.0 and found.evaluations.mean() < 20


def test_hidden_from_shadows_alone_objects_are_asked_one_by_one() -> None:
    """So a ray asks the objects whose boxes it meets, in place of all."""
    places = np.random.default_rng(2).uniform(-3, 3, (200, 3))
    seen = rm.instances(rm.sphere(0.2), places).visible(shadow=False)
    solid, values = seen | rm.plane(offset=-4), Values({}, 0.0)
    assert len(Operands(solid, values, "camera", whole=False)) == 201
    assert len(Operands(solid, values, "shadow", whole=False)) == 2
    scene = rm.Scene(solid, rm.Camera((0, 1, 9)))
    plain = scene.replace(node=rm.instances(rm.sphere(0.2), places) | rm.plane(offset=-4))
    found, other = (rm.prove(each, size=(16, 9)) for each in (scene, plain))
    assert found.share == 1.0 and np.array_equal(found.evaluations, other.evaluations)
    points = np.random.default_rng(3).uniform(-4, 4, (50, 3))
    assert np.array_equal(*(field_of(each, values).distance(points) for each in (scene, plain)))


def test_a_loop_reads_rows_of_a_table_one_by_one() -> None:
    """Products of whole numbers are exact: the first of three rows of a face is no neighbour of the last face's."""
    found = rm.prove(rm.Scene(rm.rounded_hull(), rm.Camera((0.5, 1.0, 3.0), (0, 0, 0))), size=(12, 12))
    assert found.share == 1.0 and found.evaluations.mean() < 10.0
