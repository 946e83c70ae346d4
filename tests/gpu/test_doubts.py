"""Doubts of a frame in Python: a warning, or an error of a strict renderer."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import vouch
from raymarch.plan import plan
from raymarch.scene.parameter import Values


@pytest.fixture
def renderer(context):
    with rm.Renderer((64, 40), context=context) as made:
        yield made


AWAY = rm.Camera((0, 0, 5), (0, 0, 10))


def test_a_value_out_of_its_range_is_a_warning_at_the_callers_line(renderer):
    scene = rm.Scene(rm.sphere(1 + 0.1 * rm.time))
    assert renderer.render(scene).warnings == []
    with pytest.warns(rm.RenderWarning, match=r"radius = -4.0 at time = -50 \(a number > 0\)") as heard:
        frame = renderer.render(scene, time=-50)
    assert heard[0].filename == __file__
    assert len(frame.warnings) == 1
    assert __file__ in frame.warnings[0]


def test_a_value_out_of_its_range_names_its_own_line(renderer):
    """Also of a solid that equals one of another line."""
    first = rm.Scene(rm.sphere(1 + 0.3 * rm.time))
    second = rm.Scene(rm.sphere(1 + 0.3 * rm.time))
    for scene in (first, second):
        with pytest.warns(rm.RenderWarning, match=f":{scene.node.where.line}: sphere: radius"):
            renderer.render(scene, time=-50)
        with pytest.warns(rm.RenderWarning, match=f":{scene.node.where.line}: sphere: radius"):
            scene.node.distance((0, 0, 0), time=-51)


def test_the_same_words_are_said_once_a_line(renderer):
    scene = rm.Scene(rm.sphere(1 + 0.2 * rm.time))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("default")
        for _ in range(5):
            renderer.render(scene, time=-50)
    assert len(heard) == 1


def test_a_strict_renderer_draws_no_doubtful_picture(context):
    with rm.Renderer((32, 20), context=context, strict=True) as renderer:
        assert renderer.render(rm.Scene(rm.sphere())).color.any()
        for scene, time, words in (
            (rm.Scene(rm.sphere(1 + 0.1 * rm.time)), -50, "radius"),
            (rm.Scene(rm.sphere(), AWAY), 0, "nothing is visible"),
            (rm.Scene(rm.torus(), quality=rm.Quality(max_steps=2)), 0, "ran out of steps"),
        ):
            with pytest.raises(rm.RenderError, match=words):
                renderer.render(scene, time=time)


def test_render_warns_of_an_empty_picture():
    with pytest.warns(rm.RenderWarning, match="nothing is visible"):
        rm.render(rm.Scene(rm.sphere(), AWAY), (32, 20))
    with pytest.raises(rm.RenderError, match="nothing is visible"):
        rm.render(rm.Scene(rm.sphere(), AWAY), (32, 20), strict=True)


@pytest.mark.parametrize(
    ("node", "time", "params", "words"),
    [
        (rm.sphere().translate((10 * rm.time, 0, 0)), 5, {}, r"lies between \(49, -1, -1\) and \(51, 1, 1\)"),
        (rm.sphere().translate((rm.Param("x", 0.0), 0, 0)), 0, {"x": -50.0}, "lies between"),
        (
            rm.sphere().rotate(1, "z").translate((rm.time, 0, 0)) & rm.box(1).scale(1 + rm.time**2),
            8,
            {},
            "lies between",
        ),
        (rm.sphere().translate((rm.time, 0, 0)) & rm.sphere().translate((-rm.time, 0, 0)), 5, {}, "the solid is empty"),
    ],
)
def test_a_solid_that_moved_out_is_doubted(context, node, time, params, words):
    with rm.Renderer((32, 20), context=context, strict=True) as renderer:
        scene = rm.Scene(node, rm.Camera((0, 0, 5), (0, 0, 0)) if time or params else AWAY)
        renderer.render(scene)
        with pytest.raises(rm.RenderError, match=words):
            renderer.render(scene, time=time, params=params)


def of_the_sky(frame, scene):
    light = vouch.sky_light(scene, None, Values({}), frame.pose, frame.size)
    return vouch.beside_sky(frame.color, scene, light)[1]


@pytest.mark.parametrize("sky", [rm.Sky(), rm.GradientSky(), rm.SunSky(), rm.Sky(lambda d: (d.y * d.y, 0.5, 0.2))])
def test_a_picture_of_the_sky_alone_is_known_without_a_pass(renderer, sky):
    for camera in (AWAY, rm.Camera((0, 0, 5), (3, 4, 10), fov=80)):
        scene = rm.Scene(rm.sphere(), camera, sky=sky)
        frame = renderer.render(scene)
        assert np.all(of_the_sky(frame, scene))
        (doubt,) = frame.doubts()
        assert "nothing is visible" in doubt
        seen = rm.Scene(rm.sphere(), rm.Camera((0, 0, 5), (0, 0, 0)), sky=sky)
        frame = renderer.render(seen)
        assert not np.all(of_the_sky(frame, seen))
        assert frame.doubts() == []
        assert [t.name for t in frame.timings] == ["color"], "nothing more was drawn"


def test_doubts_follow_the_camera_and_the_time(renderer):
    moving = rm.Scene(rm.sphere().translate((4 * rm.time, 0, 0)) | rm.sphere(), rm.Camera((4, 0, 0.5), (0, 0, 0)))
    deep = [any("deep inside" in doubt for doubt in renderer.render(moving, time=t).doubts()) for t in (0, 1, 0, 1.1)]
    assert deep == [False, True, False, True]
    still = rm.Scene(rm.sphere(), rm.Camera((0, 0, 5), (0, 0, 0)))
    poses = [still.replace(camera=rm.Camera((0, 0, z), (0, 0, -9))).pose(Values({}), 1.5) for z in (5, 0.5, 5)]
    deep = [any("deep inside" in doubt for doubt in renderer.render(still, pose=pose).doubts()) for pose in poses]
    assert deep == [False, True, False]


EXHAUSTED = rm.Scene(
    rm.sphere() | rm.plane(offset=-1),
    rm.Camera((0, 0.5, 5), (0, 0, 0)),
    quality=rm.Quality(tracer="bracketing", max_steps=20, analytic=False),
)
"""Some of its rays run out of steps."""


@pytest.mark.parametrize(
    ("quality", "post"),
    [
        ({}, []),
        ({"steps_per_pass": 8}, []),
        ({"schedule": "cones"}, []),
        ({}, [rm.Bloom()]),
        ({"analytic": True}, []),
        ({"tracer": "advance", "max_steps": 4}, []),
    ],
)
def test_the_picture_tells_which_rays_ran_out_of_steps(context, quality, post):
    scene = EXHAUSTED.replace(quality=EXHAUSTED.quality.replace(**quality), post=post)
    with rm.Renderer((160, 100), context=context) as renderer:
        frame = renderer.render(scene)
        drawn = [t.name for t in frame.timings]
        share = float(np.mean(~frame.done))
        said = [
            any("ran out of steps, and show the surface" in doubt for doubt in frame.doubts(s)) for s in (None, False)
        ]
        assert said == [share > 0.005, False]
        assert (share > 0.05) == (not quality.get("analytic"))
        assert [t.name for t in frame.timings] == drawn, "nothing more was drawn"
        np.testing.assert_array_equal(renderer.render(scene, outputs=("done",)).done, frame.done)


def test_rays_out_of_steps_of_several_samples_are_those_of_the_whole_picture(context):
    """Some of the rays are marched once more, as wide as in the picture: their share is that of all."""
    scene = EXHAUSTED.replace(quality=EXHAUSTED.quality.replace(samples=2))
    with rm.Renderer((320, 200), context=context) as renderer:
        frame = renderer.render(scene, outputs=("color", "done"))
        share = float(np.mean(~frame.done))
        sparse = renderer._sparse(scene, Values({}), frame.pose).array("done")
        assert sparse.shape == (25, 40)
        assert abs(float(np.mean(~sparse)) - share) < 0.05
        assert share > 0.05
        assert any("ran out of steps" in doubt for doubt in renderer.render(scene).doubts(steps=True))
        np.testing.assert_array_equal(renderer.render(scene).color, frame.color)


def test_what_can_be_shown_ahead_is_not_asked_in_each_frame():
    r = rm.Param("r", 1, 0.5, 2)
    sure = rm.Scene(
        rm.sphere(r) | rm.box((1, 1 + rm.Param("h", 0, 0, 1), 1)).rotate(rm.time),
        rm.Camera((0, 0, 5), (0, 0, 0)),
        [rm.Sun(intensity=r), rm.PointLight((rm.time, 2, 0))],
        fog=rm.Fog(density=rm.Param("fog", 0, 0, 1)),
    )
    assert plan(sure).conditions == []


def test_a_direction_that_is_0_by_default_is_refused():
    with pytest.raises(rm.SceneError, match="direction = 0 with its parameters at their defaults"):
        rm.Sun(rm.Param("to sun", (0, 0, 0)))


def glass(samples: int = 1, **parts):
    ball = rm.sphere().material(rm.Material(transmission=1))
    return rm.Scene(ball, rm.Camera((0, 0, 4)), [], rm.GradientSky(), quality=rm.Quality(samples=samples), **parts)


def test_glass_of_one_path_a_pixel_is_noise(context):
    with rm.Renderer((16, 9), context=context) as renderer:
        assert any("glass is noisy" in doubt for doubt in renderer.render(glass()).doubts())
        assert not renderer.render(glass(2)).doubts()
        (doubt,) = renderer.render(rm.Scene(rm.sphere(), rm.Camera((0, 0, 4)), bounces=1)).doubts()
        assert "path-traced light is noisy" in doubt
        assert not renderer.render(glass(bounces=0)).doubts()
        whitted = glass().replace(quality=rm.Quality(integrator="whitted"), bounces=4)
        assert not renderer.render(whitted).doubts()


@pytest.mark.parametrize(
    ("light", "name"),
    [(rm.RectLight((0, 3, 0)), "RectLight"), (rm.Sun(shadow=True, softness=0.1, penumbra="sampled"), "Sun(penumbra=")],
)
def test_one_random_point_of_a_light_is_noise(context, light, name):
    scene = rm.Scene(rm.sphere(), rm.Camera((0, 0, 4)), [light])
    with rm.Renderer((24, 18), context=context) as renderer:
        (doubt,) = renderer.render(scene).doubts()
        assert doubt.startswith(name) and "noisy with one random point" in doubt
        for quality in (rm.Quality(samples=4), rm.Quality(light_samples=4), rm.Quality(temporal="accumulate")):
            assert not renderer.render(scene.replace(quality=quality)).doubts()


def test_a_camera_inside_a_solid(context):
    away = (100, 0, 0)
    ball, camera = rm.sphere().translate(away), rm.Camera((100, 0.2, 0), (100, 0, -3))
    with rm.Renderer((24, 18), context=context) as renderer:
        (doubt,) = renderer.render(rm.Scene(ball, camera)).doubts()
        assert doubt.startswith("the camera is 0.8 deep inside a solid")
        wall = rm.box(1).translate((100, 0, -4))
        for node in (ball.visible(camera=False) | wall, ball.complement(), ball.shell(0.1)):
            assert not renderer.render(rm.Scene(node, camera)).doubts()
        water = rm.Material(transmission=1)
        for other in (camera.replace(near=0.1), camera.replace(projection="orthographic", height=1.0)):
            assert not renderer.render(rm.Scene(ball, other)).doubts()
        scene = rm.Scene(ball.material(water), camera, quality=rm.Quality(samples=4))
        assert not any("inside" in doubt for doubt in renderer.render(scene).doubts())


@pytest.mark.parametrize("target", [(0, 0, 4), (0, 0, -4), (4, 0.3, 1), (4, 0.3, 2)], ids=str)
def test_a_camera_on_a_surface(context, target):
    """All rays meet it at once, in the reference too."""
    node = rm.box(2) | rm.sphere(0.5).translate((0, 0, 4))
    scene = rm.Scene(node, rm.Camera((0, 0, 1), target), [rm.Sun((1, 2, 1), shadow=True)])
    with rm.Renderer((24, 18), context=context) as renderer:
        frame = renderer.render(scene)
        assert [doubt.what for doubt in frame.doubts()] == ["the camera is on a surface, which all rays meet at once"]
        np.testing.assert_allclose(frame.color, rm.truth(scene, (24, 18)).color, atol=1e-3)
        assert not renderer.render(scene.replace(camera=rm.Camera((0, 0, 1.001), target))).doubts()


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_face_in_the_plane_where_parallel_rays_start(context, turn):
    node = (rm.box(2) | rm.sphere(0.5).translate((0, 0, 4))).rotate(turn, "y")
    out = np.array([np.sin(turn), 0, np.cos(turn)])
    with rm.Renderer((24, 18), context=context) as renderer:
        for away, height, seen in ((1.0, 1.0, True), (1.0, 4.0, False), (1.001, 1.0, False), (0.9, 1.0, False)):
            camera = rm.Camera(away * out, 5 * out, projection="orthographic", height=height)
            found = renderer.render(rm.Scene(node, camera, [rm.Sun((1, 2, 1))])).doubts()
            assert any("on a surface" in doubt for doubt in found) == seen


def lit_floor(intensity, color=(0.8, 0.8, 0.8), **parts):
    node = (rm.plane(offset=-1) | rm.sphere()).material(rm.Material(color, specular=0, **parts))
    return rm.Scene(node, rm.Camera((0, 1, 5), (0, 0, 0)), [rm.Sun((0, 1, 0), intensity=intensity)], sky=(9, 9, 9))


def test_highlights_may_be_white_but_no_twentieth_of_the_picture():
    scene = lit_floor(1)
    for share, few in ((0.04, True), (0.06, False)):
        light = np.full((10, 100, 3), 0.3)
        light[:, : int(100 * share)] = 2.0
        assert (vouch.overexposed(light, scene) is None) == few
        white = (light > 1).all(-1)
        assert (vouch.clipped(white, light, np.zeros((10, 100), int), scene) is None) == few
    assert vouch.overexposed(np.full((10, 100, 3), 1.004), scene) is None  # that is white in 8 bits: nothing is lost


@pytest.mark.parametrize(("given", "reason"), [({"visible": True}, "visible"), ({"penumbra": "sampled"}, "penumbra")])
def test_noise_names_what_was_written(given, reason):
    lamp = rm.SphereLight((0, 2, 0), shadow=True, **given)
    mirror = rm.sphere().material(rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0))
    scene = rm.Scene(mirror, lights=[lamp], quality=rm.Quality(integrator="whitted"))
    assert f"SphereLight({reason}=" in str(vouch.noisy(scene))


def test_a_floor_that_is_clipped_to_white(context):
    with rm.Renderer((32, 18), context=context) as renderer:
        found = renderer.render(lit_floor(4)).doubts()
        assert len(found) == 1 and "clipped to white surfaces" in found[0]
        assert "rm.ToneMapping(exposure=-1.9)" in found[0]  # 0.8 * 4 * (1 + 0.1 of ambient light) is 2^1.8
        for scene in (
            lit_floor(1.1),
            lit_floor(4, (0.8, 0.2, 0.1)),
            lit_floor(0, emission=(5, 5, 5)),
            lit_floor(4).replace(tone=rm.ToneMapping("aces", exposure=-1.5)),
            lit_floor(4).replace(tone=rm.ToneMapping(exposure=-1.9)),
        ):
            assert not renderer.render(scene).doubts()
        (black,) = renderer.render(lit_floor(0).replace(lights=[])).doubts()
        assert "of the picture is black: the scene has no light" in black


@pytest.mark.parametrize(("away", "doubtful"), [(1e3, False), (1e6, True)])
def test_a_camera_from_which_float32_rounds_by_pixels_is_a_doubt(renderer, away, doubtful):
    """From 1e6 the silhouette of the ball is wrong by pixels, from 1e3 by a hundredth of one."""
    fov = float(np.degrees(2 * np.arctan(1.2 / away)))
    towards = np.array((0.48, 0.6, 0.64))
    frame = renderer.render(rm.Scene(rm.sphere(), rm.Camera(tuple(away * towards), (0, 0, 0), fov=fov)))
    assert any("float32 holds points within" in doubt for doubt in frame.doubts()) == doubtful
    beside = rm.Camera(tuple(5.0 * towards), (0, 0, 0), projection="orthographic", height=2.4)
    parallel = renderer.render(rm.Scene(rm.sphere(), beside))
    assert parallel.doubts() == []
    wrong = int(np.sum(np.isfinite(frame.depth) != np.isfinite(parallel.depth)))
    assert (wrong > 20) == doubtful


def test_the_limits_are_those_that_the_help_states():
    words = " ".join(rm.Frame.doubts.__doc__.split())
    assert f"over {100 * vouch.OVEREXPOSED:g} % of the picture" in words
    assert f"more than {100 * vouch.OUT_OF_STEPS:g} % of the rays" in words


@pytest.mark.parametrize("samples", [1, 4])
def test_one_call_says_that_rays_ran_out_of_steps(samples):
    """The share and the cure, also where a pixel is the mean of several rays."""
    with pytest.warns(rm.RenderWarning, match=r"\d+\.\d% of the rays ran out of steps.*max_steps.*20 now"):
        rm.render(EXHAUSTED, size=(96, 60), samples=samples)


def test_what_float32_rounds_is_said_of_solids_that_time_has_moved(renderer):
    """The box of a solid that moves without end is known at a time."""
    moving, there = rm.sphere(0.4).translate((rm.time, 0, 0)), rm.Camera((rm.time, 1, 4), (rm.time, 0, 0))
    assert renderer.render(rm.Scene(moving, there), time=1e3).doubts() == []
    (doubt,) = renderer.render(rm.Scene(moving, there), time=1e6).doubts()
    assert "float32 holds points within" in doubt and "nearer the origin" in doubt
    parallel = rm.Camera((0, 0, 1e6), (0, 0, 0), projection="orthographic", height=4)
    (doubt,) = renderer.render(rm.Scene(rm.box(2), parallel)).doubts()
    assert "a nearer camera, which shows the same" in doubt


def test_faces_that_an_offset_draws_are_said_while_it_draws_them(renderer):
    out = rm.Param("out", 0.0, -0.2, 0.2)
    pair = (rm.box(1) | rm.box(1).translate((1, 0, 0))).offset(out)
    for value, said in ((-0.1, True), (0.1, False), (-0.2, True)):
        doubts = renderer.render(rm.Scene(pair), params={"out": value}).doubts()
        assert any("where parts of union touch" in doubt for doubt in doubts) == said
