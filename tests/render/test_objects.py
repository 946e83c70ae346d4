"""Pictures of objects that are rows of a table equal those with all objects as text."""

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.vocabulary import length, vec3
from raymarch.plan import plan
from raymarch.sdf.definition import cube
from raymarch.sdf.domain import Positive

SIZE = (48, 36)
OUTPUTS = ("color", "depth", "normal", "material")


def objects(n, materials=True, size=1.0, origin=(0.0, 0.0, 0.0)):
    rng = np.random.default_rng(5)
    made = []
    for i in range(n):
        if i % 2:
            each = rm.sphere(size * rng.uniform(0.3, 0.5))
        else:
            each = rm.box(size * rng.uniform(0.5, 0.9, 3)).rotate(rng.uniform(0, 3), rng.normal(size=3))
        each = each.translate(size * rng.uniform(-1.2, 1.2, 3) + origin)
        made.append(each.material(rm.Material(color=rng.uniform(0.1, 1, 3))) if materials and i % 3 else each)
    return made


@rm.shape(exactness="bound", bounds=lambda radius: cube(vec3(radius)))
def lump(p, radius: Positive = 1.0):
    """A shape whose spread is not stated."""
    return 0.5 * (length(p) - radius)


def frames(renderer, node, outputs=("color",), **scene):
    """The same scene as data and as text."""
    quality = scene.pop("quality", rm.Quality())
    made = rm.Scene(node, **scene)
    return [
        renderer.render(made.replace(quality=quality.replace(objects=choice)), outputs=outputs)
        for choice in ("data", "text")
    ]


def assert_equal(data, text, edges=3, levels=1, geometry=False):
    """No pixel differs but by rounding; on `edges` silhouettes a ray may pass on the other side."""
    other = np.abs(np.asarray(data.image(), int) - np.asarray(text.image(), int)).max(axis=2)
    assert np.sum(other > levels) <= edges
    if not geometry:
        return
    assert np.sum(np.isfinite(data.depth) != np.isfinite(text.depth)) <= edges
    hit = np.isfinite(data.depth) & np.isfinite(text.depth)
    assert np.sum(np.abs(data.depth[hit] - text.depth[hit]) > 1e-3 * text.depth[hit]) <= edges
    assert np.sum(np.abs(data.normal[hit] - text.normal[hit]).max(axis=-1) > 0.02) <= edges
    assert np.sum(data.material != text.material) <= edges
    assert hit.any()


@pytest.fixture(scope="module")
def renderer():
    with rm.Renderer(size=SIZE) as made:
        yield made


CAMERA = rm.Camera(position=(3.5, 2.5, 4.5), target=(0, 0, 0))
FLOOR = rm.plane(offset=-1.5).material(rm.Material(color=(0.6, 0.6, 0.7)))


def test_hard_union_with_materials_on_a_floor_in_shadow(renderer):
    node = FLOOR | rm.union(*objects(10))
    assert_equal(*frames(renderer, node, OUTPUTS, camera=CAMERA, lights=[rm.Sun(shadow=True)]), geometry=True)


@pytest.mark.parametrize("stretched", [lambda n: n.scale((1, 1.6, 0.7)), lambda n: n.shear(0.6, "x", "y")])
def test_objects_that_are_stretched_together(renderer, stretched):
    node = FLOOR | stretched(rm.union(*objects(10)))
    made = frames(renderer, node, OUTPUTS, camera=CAMERA, lights=[rm.Sun(shadow=True)])
    assert_equal(*made, geometry=True)


def test_blend_with_materials(renderer):
    node = rm.union(*objects(7), k=0.3)
    assert_equal(*frames(renderer, node, OUTPUTS, camera=CAMERA), geometry=True)


def test_ambient_occlusion_reads_the_exact_field(renderer):
    node = FLOOR | rm.union(*objects(6, materials=False))
    sky = rm.Sky((0.5, 0.6, 0.8), light=True)
    assert_equal(*frames(renderer, node, camera=CAMERA, occlusion=rm.AmbientOcclusion(reach=0.6), sky=sky))


def test_occlusion_on_a_floor_that_is_moved_with_the_objects(renderer):
    """The scene then has no bounded part, and the reach is longer than the objects are large."""
    node = (rm.plane(offset=-0.8) | rm.union(*objects(6, materials=False, size=0.5))).translate((0, 0.2, 0))
    sky = rm.Sky((0.5, 0.6, 0.8), light=True)
    assert_equal(*frames(renderer, node, camera=CAMERA, occlusion=rm.AmbientOcclusion(reach=2.0), sky=sky))


def test_the_floor_of_a_blend_keeps_its_material_beyond_the_cells(renderer):
    node = rm.union(FLOOR, rm.plane((0, 0, 1), -4.0).material(rm.Material(color=(0.9, 0.2, 0.1))), *objects(7), k=0.3)
    assert_equal(*frames(renderer, node, OUTPUTS, camera=CAMERA), geometry=True)


def test_soft_shadows(renderer):
    """The penumbra depends on where a ray samples the field; the steps in far cells are shorter."""
    node = FLOOR | rm.union(*objects(6, materials=False))
    assert_equal(*frames(renderer, node, camera=CAMERA, lights=[rm.Sun(shadow=True, softness=0.1)]), levels=8)


def test_objects_in_a_mirror(renderer):
    mirror = rm.plane((0, 0, 1), -2.0).material(rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1.0, roughness=0.0))
    parts = [each.material(rm.Material(albedo=(0.7, 0.4, 0.2))) for each in objects(5, materials=False)]
    node = mirror | rm.union(*parts)
    quality = rm.Quality(integrator="whitted")
    assert_equal(*frames(renderer, node, camera=CAMERA, bounces=1, quality=quality), edges=8)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_other_units_far_from_the_origin(renderer, size):
    origin = np.array([3e3, 0.0, -2e3]) * size
    node = rm.union(*objects(6, size=size, origin=origin))
    camera = rm.Camera(position=origin + size * np.array([3.5, 2.5, 4.5]), target=origin)
    assert_equal(*frames(renderer, node, camera=camera))


def test_a_distant_camera(renderer):
    camera = rm.Camera(position=(2000.0, 1500.0, 2500.0), target=(0, 0, 0), fov=0.08)
    assert_equal(*frames(renderer, rm.union(*objects(6)), camera=camera), edges=6)


def test_patterns_move_with_their_objects(renderer):
    checked = rm.Material(color=rm.checker((0.9, 0.9, 0.9), (0.1, 0.1, 0.6), 0.2))
    node = rm.union(*[rm.box(0.8).material(checked).rotate(i).translate((i - 2.0, 0, 0)) for i in range(5)])
    assert_equal(*frames(renderer, node, camera=rm.Camera(position=(1, 2, 6), target=(0, 0, 0))))


def test_textures_and_relief_move_with_their_objects(renderer):
    """They depend on the footprint and the normal in the space of each object."""
    picture = np.random.default_rng(1).uniform(0.1, 0.9, (8, 8, 3))
    normals = rm.triplanar(0.4 * picture + (0.3, 0.3, 0.6), size=0.5)
    one = rm.Material(color=rm.triplanar(picture, size=0.4), normal=normals)
    two = rm.Material(color="orange", height=lambda p: rm.sin(8 * p.x) * rm.sin(9 * p.y), height_scale=0.05)
    nodes = [
        node.material((one, two)[i // 2 % 2]).rotate(0.3 * i, (1, 2, 3)) for i, node in enumerate(objects(4, False))
    ]
    node = rm.union(*nodes).rotate(0.7, (1, -2, 3)).scale(0.9)
    assert_equal(*frames(renderer, node, camera=CAMERA), edges=6, levels=6)


@pytest.mark.parametrize(
    "color", [rm.checker((0.9, 0.9, 0.9), (0.1, 0.1, 0.6), 0.3), (rm.Param("red", 0.6, 0.1, 1.0), 0.2, 0.3)]
)
@pytest.mark.parametrize("blended", [False, True])
def test_some_objects_inherit_a_material_that_is_no_row_of_numbers(renderer, color, blended):
    many = rm.union(*objects(7), k=0.2 * blended)
    placed = many.translate((0.2, 0.1, 0.0)) if blended else many
    assert_equal(*frames(renderer, placed.material(rm.Material(color=color)), OUTPUTS, camera=CAMERA), geometry=True)


def test_instances_equal_nodes(renderer):
    rng = np.random.default_rng(0)
    places = rng.uniform(-1.2, 1.2, (9, 3))
    colors = [rm.Material(color=rng.uniform(0.1, 1, 3)) for _ in range(3)]
    tree = rm.cylinder(0.1, 0.6).material(rm.Material(color=(0.4, 0.2, 0.1))) | rm.sphere(0.3).translate((0, 0.4, 0))
    made = rm.instances(tree, places, (colors, np.arange(9) % 3))
    node = rm.union(*[tree.translate(p).material(colors[i % 3]) for i, p in enumerate(places)])
    scene = {"camera": CAMERA, "quality": rm.Quality(objects="text")}
    text = renderer.render(rm.Scene(node, **scene), outputs=OUTPUTS)
    data = renderer.render(rm.Scene(made, camera=CAMERA), outputs=OUTPUTS)
    assert_equal(data, text, geometry=True)
    truth = rm.truth(rm.Scene(made, camera=CAMERA), size=(16, 12))
    other = rm.truth(rm.Scene(node, camera=CAMERA), size=(16, 12))
    np.testing.assert_allclose(truth.depth, other.depth, rtol=1e-9)
    assert np.array_equal(truth.material, other.material)


def test_the_cache_notices_changed_data(renderer):
    """Equal objects compile nothing; other numbers give another picture."""
    rng = np.random.default_rng(0)
    places = rng.uniform(-1, 1, (40, 3))

    def picture(given):
        return np.asarray(renderer.render(rm.Scene(rm.instances(rm.box(0.3), given), camera=CAMERA)).image())

    first = picture(places)
    assert np.array_equal(picture(places.copy()), first)
    assert not np.array_equal(picture(places + np.array([0.3, 0.0, 0.0])), first)


def test_moving_objects_equal_text(renderer):
    """The same program draws all frames; a slider and time move the rows."""
    lift = rm.Param("lift", 0.0, -1.0, 1.0)
    rng = np.random.default_rng(8)
    made = []
    for i in range(12):
        x, y, z, a = rng.uniform(-1.2, 1.2, 4)
        each = rm.sphere(0.4) if i % 2 else rm.box(0.6).rotate(a * rm.time, (1, 2, 0))
        material = rm.Material(color=rng.uniform(0.1, 1, 3))
        made.append(each.translate((x, y + lift * x, z + 0.3 * rm.sin(rm.time + a))).material(material))
    scene = rm.Scene(rm.union(*made), camera=CAMERA, lights=[rm.Sun(shadow=True)])
    data, text = (scene.replace(quality=rm.Quality(objects=choice)) for choice in ("data", "text"))
    for time, value in ((0.0, 0.0), (1.3, 0.0), (1.3, 0.8)):
        at = {"time": time, "params": {"lift": value}, "outputs": OUTPUTS}
        compiled = renderer.compiled
        frame = renderer.render(data, **at)
        assert time == 0.0 or renderer.compiled == compiled
        assert_equal(frame, renderer.render(text, **at), geometry=True)


def test_instances_of_a_grid(renderer):
    axis = np.linspace(-1.0, 1.0, 12)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    ball = rm.grid(np.sqrt(x * x + y * y + z * z) - 0.7, size=1.0)
    points = np.array([(0, 0, 0), (1.2, 0.2, -1), (-1, 0.4, 0.3)])
    camera = rm.Camera((1, 2, 5), (0, 0, 0))
    scenes = [rm.Scene(node | rm.plane(offset=-0.5), camera) for node in (rm.instances(ball, points), at(ball, points))]
    assert_equal(*(renderer.render(scene, outputs=OUTPUTS) for scene in scenes), geometry=True)


@pytest.mark.parametrize("k", [0.0, 0.1])
def test_solids_of_unknown_spread_are_no_rows(renderer, k):
    """Without it nothing bounds the field outside of the cells."""
    points = np.random.default_rng(1).uniform(-2, 2, (4, 3))
    node = rm.union(*[lump(0.5 + 0.1 * i).translate(tuple(p)) for i, p in enumerate(points)], **({"k": k} if k else {}))
    assert_equal(*frames(renderer, node, outputs=OUTPUTS), geometry=True)
    with pytest.raises(SceneError, match="instances of lump, which is of unknown spread"):
        rm.instances(lump(0.5), points)


def at(node, points):
    return rm.union(*[node.translate(tuple(point)) for point in points])


@pytest.mark.parametrize("uneven", [False, True])
def test_objects_with_matrices_of_their_own_become_rows(uneven: bool) -> None:
    """Turned and scaled by one factor, or unevenly; by their proof."""
    random = np.random.default_rng(1)
    placed = []
    for _ in range(70):
        matrix = np.eye(4)
        turned, _ = np.linalg.qr(random.normal(size=(3, 3)))
        matrix[:3, :3] = turned * (random.uniform(0.2, 0.4, 3) if uneven else 0.3)
        matrix[3, :3] = random.uniform(-3, 3, 3)
        placed.append(rm.torus(1, 0.3).transform(matrix))
    scene = rm.Scene(rm.union(*placed), rm.Camera((0, 0, 12), (0, 0, 0)))
    assert plan(scene).gathered.rows
    with rm.Renderer((48, 27)) as renderer:
        frame = renderer.render(scene, outputs=("depth",))
    assert np.isfinite(frame.depth).sum() > 80
    assert rm.prove(scene, frame).share == 1.0
