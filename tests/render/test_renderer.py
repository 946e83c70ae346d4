"""The renderer as a machine: what it makes, what it makes only when asked, what it keeps, what it refuses."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.reference import reference
from raymarch.errors import DeviceError, SceneError
from raymarch.gpu import resource_cache as module
from raymarch.gpu import tiles
from raymarch.gpu.context import Context
from raymarch.gpu.frame import srgb
from raymarch.gpu.probe import probe_with
from raymarch.gpu.program import Program
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.targets import Target
from raymarch.plan import OUTPUTS, plan
from tests.support.analytic import ULP, View, edges, hit_sphere

DTYPES = {
    "color": np.float32,
    "depth": np.float32,
    "normal": np.float32,
    "iterations": np.int32,
    "evaluations": np.float32,
    "residual": np.float32,
    "fallbacks": np.int32,
    "done": np.bool_,
    "reach": np.float32,
    "material": np.int32,
    "slice": np.float32,
    "position": np.float32,
    "shading_normal": np.float32,
    "cycles": np.float32,
}
DEEP = {"color": (3,), "normal": (3,), "slice": (2,), "position": (3,), "shading_normal": (3,)}
RED = rm.Material((1.0, 0.0, 0.0))


def scene(**parts: Any) -> rm.Scene:
    camera = parts.pop("camera", rm.Camera((0, 0, 5), (0, 0, 0), fov=40))
    return rm.Scene(parts.pop("node", rm.sphere()), camera, **parts)


class Counted:
    """Counts what a renderer makes on the device, and what is released again."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.programs: list[Program] = []
        self.targets: list[Target] = []
        self.draws: list[str] = []
        counted = self

        class CountedProgram(Program):
            def __init__(self, *args: Any) -> None:
                super().__init__(*args)
                counted.programs.append(self)

            def draw(self, *args: Any) -> None:
                counted.draws.append(self.name)
                super().draw(*args)

        class CountedTarget(Target):
            def __init__(self, *args: Any) -> None:
                super().__init__(*args)
                counted.targets.append(self)

        monkeypatch.setattr(module, "Program", CountedProgram)
        monkeypatch.setattr(module, "Target", CountedTarget)

    @property
    def textures(self) -> int:
        return sum(target.attachments for target in self.targets if not target.released)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch, egl: Context) -> Iterator[tuple[Counted, Renderer]]:
    counts = Counted(monkeypatch)
    with Renderer((32, 24), "egl") as made:
        yield counts, made
    assert all(p.released for p in counts.programs) and all(t.released for t in counts.targets)


# Arrays.


def test_arrays_have_the_shapes_and_types_that_they_promise(renderer: Renderer) -> None:
    dtypes = dict(DTYPES)
    if "GL_ARB_shader_clock" not in renderer.context.gl.extensions:
        del dtypes["cycles"]
    frame = renderer.render(scene(), outputs=list(dtypes))
    assert set(OUTPUTS) == set(DTYPES)
    for name, dtype in dtypes.items():
        values = getattr(frame, name)
        assert values.dtype == dtype, name
        assert values.shape == (120, 160, *DEEP.get(name, ())), name
        assert np.array_equal(values, frame.array(name), equal_nan=True)
        assert values.flags.writeable and values.flags.c_contiguous
    hit = np.isfinite(frame.depth)
    assert 0.1 < hit.mean() < 0.9
    assert np.all(np.isposinf(frame.depth[~hit])) and np.all(frame.normal[~hit] == 0)
    assert np.all(frame.material[~hit] == -1) and np.all(frame.material[hit] == 0)
    assert np.all(np.abs(np.linalg.norm(frame.normal[hit], axis=-1) - 1) <= 4 * ULP)
    assert np.all(frame.evaluations[hit] >= 1) and np.all(frame.iterations <= frame.evaluations + 1)
    assert np.all(frame.residual[hit] >= 0) and frame.residual[hit].max() < 0.01
    assert np.all(frame.residual[~hit] == 0)
    assert np.all(np.isfinite(frame.color))


def test_the_top_of_the_picture_is_row_zero_and_its_left_column_zero(renderer: Renderer) -> None:
    up = renderer.render(scene(node=rm.sphere(0.3).translate((0, 1, 0))), outputs=("depth",))
    right = renderer.render(scene(node=rm.sphere(0.3).translate((1, 0, 0))), outputs=("depth",))
    rows, _ = np.nonzero(np.isfinite(up.depth))
    _, columns = np.nonzero(np.isfinite(right.depth))
    assert rows.max() < 60 and columns.min() >= 80
    image = np.asarray(renderer.render(scene(node=rm.sphere(0.3).translate((1, 1, 0)))).image())
    differs = (image != image[0, 0]).any(axis=-1)
    rows, columns = np.nonzero(differs)
    assert rows.max() < 60 and columns.min() >= 80


def test_an_image_is_srgb_of_the_colours(renderer: Renderer) -> None:
    frame = renderer.render(scene(sky=(0.5, 0.001, 2.0), lights=[]))
    image = frame.image()
    assert image.mode == "RGB" and image.size == (160, 120)
    # IEC 61966-2-1 by hand: 255 (1.055 0.5^(1/2.4) - 0.055) = 187.5, 255 * 12.92 * 0.001 = 3.3, clipped.
    assert image.getpixel((0, 0)) == (188, 3, 255) and image.getpixel((80, 60)) == (0, 0, 0)


def test_srgb_of_every_kind_of_number() -> None:
    values = np.array([0, 1, -1, 2, np.nan, np.inf, -np.inf, 0.0031308, 0.0031309, 0.2140, 1e-30])
    assert srgb(values).tolist() == [0, 255, 0, 255, 0, 255, 0, 10, 10, 127, 0]
    ramp = srgb(np.linspace(0, 1, 10_001))
    assert np.all(np.diff(ramp.astype(int)) >= 0) and set(ramp.tolist()) == set(range(256))


def test_materials_are_indices_into_the_scene(renderer: Renderer) -> None:
    left, right = rm.sphere(0.5).translate((-0.7, 0, 0)), rm.sphere(0.5).translate((0.7, 0, 0)).material(RED)
    made = scene(node=left | right)
    frame = renderer.render(made, outputs=("material",))
    assert set(np.unique(frame.material[:, :80])) == {-1, 0}
    assert set(np.unique(frame.material[:, 80:])) == {-1, made.materials.index(RED)} == {-1, 1}


# Only what is asked for.


def test_a_plain_scene_takes_one_program_and_one_texture(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    frame = renderer.render(scene())
    frame.image()
    assert len(counts.programs) == 1 and counts.textures == 1 and counts.draws == ["color"]


def test_geometry_is_rendered_once_and_when_first_asked_for(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    frame = renderer.render(scene())
    assert counts.draws == ["color"] and [t.name for t in frame.timings] == ["color"]
    depth = frame.depth
    assert counts.draws == ["color", "geometry"] and len(counts.programs) == 2 and counts.textures == 4
    for name in ("normal", "material", "iterations", "evaluations", "residual", "depth"):
        frame.array(name)
    assert frame.depth is depth and counts.draws == ["color", "geometry"]
    assert [t.name for t in frame.timings] == ["color", "geometry"]


def test_colour_is_not_rendered_if_only_geometry_is_asked_for(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    frame = renderer.render(scene(), outputs="depth")  # type: ignore[arg-type]  # one name will do
    assert counts.draws == ["geometry"] and counts.programs[0].uniforms
    _ = frame.color
    assert counts.draws == ["geometry", "color"]


def test_both_ahead_are_two_passes_of_one_text(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    ahead = renderer.render(scene(), outputs=("normal", "color", "depth"))
    assert counts.draws == ["color", "geometry"]
    assert np.array_equal(ahead.color, renderer.render(scene()).color)
    assert np.array_equal(ahead.depth, renderer.render(scene(), outputs=("depth",)).depth)


def test_a_lazy_array_is_of_the_same_moment(renderer: Renderer) -> None:
    radius = rm.Param("radius", 1.0, 0.5, 1.5)
    made = scene(node=rm.sphere(radius).translate((0.1 * rm.time, 0, 0)))
    frame = renderer.render(made, time=3.0, params={"radius": 0.6})
    renderer.render(made, time=0.0)
    ahead = renderer.render(made, time=3.0, params={"radius": 0.6}, outputs=("depth",))
    assert frame.time == 3.0 and np.array_equal(frame.depth, ahead.depth)


def test_no_program_is_made_for_what_does_not_change_the_text(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    radius, gaze = rm.Param("radius", 1.0, 0.5, 1.5), rm.Param("gaze", (0.0, 0.0, 5.0))
    made = scene(
        node=rm.sphere(radius).translate((rm.time, 0, 0)),
        camera=rm.Camera(gaze, (rm.time, 0, 0)),
        lights=[rm.Sun((rm.time, 1, 1), intensity=radius)],
    )
    first = renderer.render(made)
    assert first.timings[0].compile > 0 and first.timings[0].first
    pictures = [first.color]
    for time, params in ((1.0, {}), (1.0, {"radius": 0.7}), (2.0, {"radius": 0.7, "gaze": (1.0, 1.0, 4.0)})):
        frame = renderer.render(made, time, params)
        assert frame.timings[0].compile == 0 and not frame.timings[0].first
        pictures.append(frame.color)
    again = rm.Scene(made.node, rm.Camera((9, 8, 7), (0, 0, 0), fov=10), made.lights)
    renderer.render(again)
    assert len(counts.programs) == 1
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))


def test_the_program_used_longest_ago_is_freed(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    renderer.kept = 2
    a, b, c = (scene(node=rm.sphere(r)) for r in (0.5, 0.7, 0.9))
    before = renderer.render(a).color
    renderer.render(b)
    renderer.render(a)  # now b is the one used longest ago
    renderer.render(c)
    assert [p.released for p in counts.programs] == [False, True, False]
    renderer.render(a)
    assert len(counts.programs) == 3
    again = renderer.render(b)
    assert len(counts.programs) == 4 and again.timings[0].first and again.timings[0].compile > 0
    assert [p.released for p in counts.programs] == [False, True, True, False]
    assert np.array_equal(renderer.render(a).color, before) and len(counts.programs) == 4


# Lifetime and sizes.


def test_a_closed_renderer_says_so(egl: Context) -> None:
    with Renderer((8, 8), "egl") as made:
        frame = made.render(scene())
    for use in (lambda: made.render(scene()), lambda: frame.depth, lambda: made.resize((4, 4)), lambda: made.size):
        with pytest.raises(DeviceError, match=r"closed|released"):
            use()
    assert frame.color.shape == (8, 8, 3) and frame.image().size == (8, 8)
    made.close()
    made.close()


def test_a_renderer_draws_at_another_size_after_resize(counted: tuple[Counted, Renderer]) -> None:
    counts, renderer = counted
    old = renderer.render(scene(), outputs=("color", "depth"))
    renderer.resize((16, 50))
    assert renderer.size == (16, 50) and counts.textures == 1
    new = renderer.render(scene(), outputs=("color", "depth"))
    assert new.color.shape == (50, 16, 3) and new.depth.shape == (50, 16) and new.size == (16, 50)
    assert len(counts.programs) == 2, "a program does not depend on the size"
    renderer.resize((32, 24))
    assert np.array_equal(renderer.render(scene()).color, old.color)


def test_an_array_that_was_not_made_before_a_resize_is_refused(counted: tuple[Counted, Renderer]) -> None:
    _, renderer = counted
    frame = renderer.render(scene())
    renderer.resize((10, 10))
    with pytest.raises(DeviceError, match=r"draws \(10, 10\) now, the frame is \(32, 24\)"):
        _ = frame.depth
    renderer.resize((32, 24))
    assert frame.depth.shape == (24, 32)


BAD_SIZES = [(0, 24), (24, 0), (-1, 5), (10**6, 8), (8, 10**6), (1.5, 2), ("8", 8), 8, None, (8, 8, 8), (True, 8)]


@pytest.mark.parametrize("size", BAD_SIZES, ids=repr)
def test_a_size_that_cannot_be_drawn_is_refused(size: Any, counted: tuple[Counted, Renderer]) -> None:
    _counts, renderer = counted
    fault = DeviceError if isinstance(size, tuple) and 10**6 in size else SceneError
    with pytest.raises(fault, match=r"an integer from 1 to \d+|\(width, height\)"):
        Renderer(size, "egl")
    with pytest.raises(fault):
        renderer.resize(size)
    with pytest.raises(fault) as caught:
        rm.render(scene(), size=size, backend="egl")
    assert caught.value.where is not None and caught.value.where.file == __file__
    assert renderer.size == (32, 24) and renderer.render(scene()).color.shape == (24, 32, 3)


def test_the_longest_row_is_drawn(counted: tuple[Counted, Renderer]) -> None:
    _, renderer = counted
    width, height = renderer.context.limits.picture
    for size in ((width, 1), (1, height)):
        renderer.resize(size)
        frame = renderer.render(scene(lights=[]))
        assert frame.color.shape == (size[1], size[0], 3) and np.isfinite(frame.color).all()
    with pytest.raises(DeviceError, match=f"width = {width + 1}.*from 1 to {width}"):
        renderer.resize((width + 1, 1))


def test_render_gives_an_image_in_one_go(egl: Context) -> None:
    image = rm.render(scene(node=rm.sphere(rm.Param("r", 1, 0.5, 2))), (20, 10), 0.0, {"r": 0.5}, "egl")
    assert image.mode == "RGB" and image.size == (20, 10)


def test_render_takes_samples_in_place_of_those_of_the_scene():
    smooth = rm.render(scene(), (20, 10), samples=4)
    assert smooth.tobytes() == rm.render(scene(quality=rm.Quality(samples=4)), (20, 10)).tobytes()
    assert smooth.tobytes() != rm.render(scene(), (20, 10)).tobytes()


def test_a_picture_is_the_same_each_time_and_in_each_renderer(renderer: Renderer) -> None:
    made = scene(node=rm.union(rm.sphere(), rm.box((3, 0.5, 0.5)), k=0.2), lights=[rm.Sun(shadow=True)])
    pictures = [renderer.render(made, outputs=("color", "depth")) for _ in range(2)]
    with Renderer((160, 120), "egl") as other:
        pictures.append(other.render(made, outputs=("color", "depth")))
    for frame in pictures[1:]:
        assert np.array_equal(frame.color, pictures[0].color) and np.array_equal(frame.depth, pictures[0].depth)


# Tiles.


@pytest.mark.parametrize("tile", [32, 64, 128, 1000])
def test_tiles_are_the_whole_bit_for_bit(renderer: Renderer, monkeypatch: pytest.MonkeyPatch, tile: int) -> None:
    made = scene(
        node=rm.union(rm.sphere(), rm.torus(1.5, 0.3).rotate(1, "x"), k=0.2) | rm.plane(offset=-1).material(RED),
        lights=[rm.Sun(shadow=True), rm.PointLight((1, 2, 3), shadow=True)],
    )
    renderer.resize((200, 133))
    whole = renderer.render(made, outputs=("color", "depth"))
    renderer._edges.clear()  # with which another tile ended
    monkeypatch.setattr(tiles, "EDGE", tile)
    monkeypatch.setattr(tiles, "SHORT", -1.0)
    monkeypatch.setattr(tiles, "LONG", np.inf)
    told: list[float] = []
    tiled = renderer.render(made, outputs=("color", "depth"), progress=told.append)
    for name in set(OUTPUTS) - {"cycles"}:  # which differ from draw to draw
        assert np.array_equal(whole.array(name), tiled.array(name), equal_nan=name in ("slice", "position")), name
    passes = -(-200 // tile) * -(-133 // tile)
    assert told == sorted(told) and len(told) == 2 * passes and told[0] > 0 and told[-1] == 1.0


def test_the_top_is_drawn_first() -> None:
    parts = list(tiles.tiles_of((70, 120), 50))
    assert parts[0] == (0, 70, 50, 50) and parts[1] == (50, 70, 20, 50) and parts[-1] == (50, 0, 20, 20)
    covered = np.zeros((120, 70), int)
    for x, y, width, height in parts:
        covered[y : y + height, x : x + width] += 1
    assert np.all(covered == 1)


@pytest.mark.parametrize(("took", "widths"), [(10.0, [128, 256, 512]), (40.0, [128, 128, 128]), (90.0, [128, 64, 32])])
def test_tiles_grow_and_shrink_with_the_time_they_take(took: float, widths: list[int]) -> None:
    drawn: list[tiles.Tile] = []
    told: list[float] = []

    def draw(tile: tiles.Tile) -> float:
        drawn.append(tile)
        return took

    assert tiles.draw_in_tiles((2000, 1500), draw, told.append) == took * len(drawn)
    heights = list(dict.fromkeys(y + height for _, y, _, height in drawn))  # the top of each row of tiles
    assert [drawn[0][3], heights[0] - heights[1], heights[1] - heights[2]] == [128, 128, widths[1]]
    covered = np.zeros((1500, 2000), int)
    for x, y, width, height in drawn:
        covered[y : y + height, x : x + width] += 1
    assert np.all(covered == 1) and told == sorted(told) and told[-1] == 1.0


def test_later_frames_begin_with_the_tiles_that_the_last_one_ended_with() -> None:
    known, counts = tiles.Edge(), []
    for took in (2.0, 2.0, 90.0, 90.0):
        drawn: list[float] = []

        def draw(_: tiles.Tile, took: float = took, drawn: list[float] = drawn) -> float:
            drawn.append(took)
            return took

        tiles.draw_in_tiles((1920, 1080), draw, lambda share: None, known)
        counts.append(len(drawn))
    assert counts[0] > 20 and counts[1] == 1 and counts[2] == 1 and counts[3] > 1


def test_a_fault_in_the_progress_report_leaves_the_renderer_usable(renderer: Renderer) -> None:
    before = renderer.render(scene()).color

    def stop(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        renderer.render(scene(), progress=stop)
    assert np.array_equal(renderer.render(scene()).color, before)


# Times.


def test_times_are_told_by_pass(renderer: Renderer) -> None:
    made = scene(node=rm.sphere(0.987654))
    frame = renderer.render(made, outputs=("color", "depth"))
    assert [t.name for t in frame.timings] == ["color", "geometry"]
    assert all(t.draw > 0 and t.compile > 0 and t.first for t in frame.timings)
    assert frame.milliseconds == sum(t.draw for t in frame.timings)
    again = renderer.render(made, outputs=("color", "depth"))
    assert all(t.draw > 0 and t.compile == 0 and not t.first for t in again.timings)


# Refusals.


@pytest.mark.parametrize(
    ("use", "words"),
    [
        (lambda r: r.render(rm.sphere), ("render of <function sphere", "a Scene")),
        (lambda r: r.render(None), ("render of None", "a Scene")),
        (lambda r: r.render(scene(), outputs=("deep",)), ("outputs: 'deep'", "color, depth, normal")),
        (lambda r: r.render(scene(), outputs=5), ("outputs = 5", "color, depth, normal")),
        (lambda r: r.render(scene(), params={"r": 1}), ("unknown parameter 'r'", "no Param")),
        (lambda r: r.render(scene(), time=float("nan")), ("time = nan", "finite")),
        (lambda r: r.render(scene(), time=None), ("time = None", "finite")),
        (lambda r: r.render(scene()).array("deep"), ("'deep'", "color, depth, normal")),
        (lambda r: r.render(scene(camera=rm.Camera((0, 0, 0)))), ("position = target", "two different points")),
        (lambda r: rm.render(rm.circle(), (8, 8)), ("circle is flat", "extrude or revolve")),
        (lambda r: plan(rm.sphere()), ("plan of <sphere", "a Scene")),
        (lambda r: probe_with(r, rm.sphere()), ("probe of <sphere", "a Scene")),
        (lambda r: reference(rm.sphere(), (8, 8)), ("reference of <sphere", "a Scene")),
    ],
    ids=range(13),
)
def test_bad_input_is_refused(renderer: Renderer, use: Any, words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        use(renderer)
    for word in words:
        assert word in str(caught.value)
    assert caught.value.where is not None and caught.value.where.file == __file__


def test_a_solid_is_drawn_in_a_default_scene(renderer: Renderer) -> None:
    solid = rm.torus().twist(1.0)
    assert np.array_equal(renderer.render(solid).color, renderer.render(rm.Scene(solid)).color)
    assert np.array_equal(rm.truth(solid, (8, 8)).color, rm.truth(rm.Scene(solid), (8, 8)).color)


# Effects that are seen.


def test_fog_lets_a_share_of_the_light_through(renderer: Renderer) -> None:
    plain, hue, density = scene(), (0.2, 0.9, 0.4), 0.3
    clear = renderer.render(plain, outputs=("color", "depth"))
    foggy = renderer.render(scene(fog=rm.Fog(hue, density)), outputs=("color", "depth"))
    assert np.array_equal(clear.depth, foggy.depth)
    hit = np.isfinite(clear.depth)
    share = np.exp(-density * clear.depth[hit].astype(np.float64))[:, None]
    expected = share * clear.color[hit] + (1 - share) * np.array(hue)
    assert np.abs(foggy.color[hit] - expected).max() <= 8 * ULP
    assert np.array_equal(foggy.color[~hit], clear.color[~hit])
    none = renderer.render(scene(fog=rm.Fog(hue, 0.0))).color
    assert np.abs(none - clear.color).max() <= 4 * ULP
    thick = renderer.render(scene(fog=rm.Fog(hue, 1e6))).color
    assert np.abs(thick[hit] - hue).max() <= ULP


@pytest.mark.parametrize(
    "node",
    [
        rm.sphere() & rm.sphere().translate((5, 0, 0)),
        rm.sphere() - rm.sphere(2),
        rm.plane() & rm.plane((0, -1, 0), -1),
    ],
)
@pytest.mark.parametrize("lights", [None, [], [rm.Sun(shadow=True)]])
def test_an_empty_scene_is_its_sky(renderer: Renderer, node: rm.Node, lights: Any) -> None:
    frame = renderer.render(scene(node=node, lights=lights, sky=(0.25, 0.5, 0.75)), outputs=("color", "depth"))
    assert np.all(frame.color == (0.25, 0.5, 0.75)) and np.all(np.isposinf(frame.depth))
    assert np.all(frame.material == -1)


def test_no_light_leaves_things_black(renderer: Renderer) -> None:
    made = scene(node=rm.sphere().material(RED), lights=[], sky=(0.25, 0.5, 0.75))
    frame = renderer.render(made, outputs=("color", "depth", "normal"))
    hit = np.isfinite(frame.depth)
    assert hit.any() and np.all(frame.color[hit] == 0) and np.all(frame.color[~hit] == (0.25, 0.5, 0.75))
    assert np.all(np.abs(np.linalg.norm(frame.normal[hit], axis=-1) - 1) <= 4 * ULP)


def test_a_light_at_the_surface_gives_no_infinity(renderer: Renderer) -> None:
    for x in (0.9, 0.999999, 1.0, 1.000001, 1.1):
        for shadow in (False, True):
            made = scene(lights=[rm.PointLight((0, 0, x), shadow=shadow)])
            assert np.isfinite(renderer.render(made).color).all()


def test_egl_and_osmesa_draw_alike(renderer: Renderer) -> None:
    view = View((0, 0, 5), (0, 0, 0), 40.0, (160, 120))
    made = scene(lights=[rm.Sun(shadow=True)], fog=rm.Fog())
    one = renderer.render(made)
    try:
        with Renderer((160, 120), "osmesa") as other:
            two = other.render(made, outputs=("color", "depth"))
    except DeviceError as error:
        pytest.skip(str(error))
    inner = ~edges(np.isfinite(hit_sphere(view.origin, view.directions, (0, 0, 0), 1.0)).astype(int))
    assert np.abs(np.asarray(one.image(), int) - np.asarray(two.image(), int))[inner].max() <= 1
    assert np.array_equal(np.isfinite(one.depth)[inner], np.isfinite(two.depth)[inner])


def test_a_renderer_plans_the_functions_of_a_scene_once(monkeypatch):
    calls = []

    def counted(*args, **named):
        calls.append(args)
        return plan(*args, **named)

    monkeypatch.setattr("raymarch.gpu.prepared_scenes.plan", counted)
    scene = rm.Scene(rm.union(rm.box(1), rm.sphere(), k=0.1))
    with rm.Renderer((16, 9)) as renderer:
        for epsilon in (0.5, 0.1, 0.02):
            made = scene.replace(quality=rm.Quality(epsilon=epsilon))
            assert renderer.prepared(made).plan.epsilon == epsilon
        assert len(calls) == 1
        renderer.prepared(scene.replace(quality=rm.Quality(normals="central")))
        renderer.prepared(scene, ("depth",))
        renderer.prepared(scene.replace(lights=[]))
        assert len(calls) == 4
