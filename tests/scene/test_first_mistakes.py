"""What a first scene often gets wrong, and the one line that it is told."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError, UnknownNameError
from raymarch.gpu import vouch
from raymarch.plan.unused import unused
from raymarch.scene.file import load
from raymarch.scene.parameter import Values
from raymarch.scene.reading import touching_glass

BALL, FLOOR = rm.sphere(), rm.plane(offset=-1)
COUNT = rm.Param("mistaken count", 3, 1, 5)
MASKED = np.ma.array(np.zeros((2, 3)), mask=[[0, 0, 0], [1, 1, 1]])
GLASS = rm.Material(transmission=1)
RISING = np.arange(27.0).reshape(3, 3, 3)


class Tensor:
    """An array of another library."""

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray[Any, Any]:
        return np.array([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: range(COUNT), "counts nothing"),
        (lambda: f"{COUNT:.2f}", "no digits to format"),
        (lambda: BALL.distance(MASKED), "3 masked values"),
        (lambda: rm.box(MASKED[1]), "box: size"),
        (lambda: BALL.hull, "hull\\(points\\)"),
    ],
)
def test_it_is_refused_with_the_cure(wrong: Callable[[], Any], words: str) -> None:
    with pytest.raises((SceneError, UnknownNameError), match=words):
        wrong()


def test_noise_of_numbers_and_arrays() -> None:
    points = np.random.default_rng(0).uniform(-9, 9, (5, 2))
    found = rm.value_noise(points)
    one = [float(rm.value_noise(tuple(point))) for point in points]
    assert np.shape(found) == (5,) and np.ptp(one) > 0.1 and np.array_equal(found, one)


def test_an_array_of_another_library_is_an_array() -> None:
    given: Any = Tensor()
    assert rm.box(given) == rm.box((1, 2, 3)) and BALL.translate(given) == BALL.translate((1, 2, 3))
    assert BALL.distance(given) == BALL.distance((1, 2, 3))


@pytest.mark.parametrize(
    "scene, words",
    [
        (rm.Scene(BALL.material(GLASS)), "a sky of one colour"),
        (rm.Scene(BALL | FLOOR, lights=[rm.Sun((0.2, -1, 0))]), "from below the floor"),
    ],
)
def test_what_looks_flat_is_said(scene: rm.Scene, words: str) -> None:
    assert any(words in doubt for doubt in unused(scene))
    cured = scene.replace(lights=[rm.Sun()], sky=rm.GradientSky())
    assert not any(words in doubt for doubt in unused(cured))


def test_a_black_picture_is_said() -> None:
    black = np.zeros((4, 4, 3))
    assert "no light (lights=[Sun()]" in str(vouch.dark(black, rm.Scene(BALL, lights=[])))
    assert "too weak" in str(vouch.dark(black, rm.Scene(BALL)))
    black[:2] = 0.5
    assert vouch.dark(black, rm.Scene(BALL, sky=(0, 0, 0))) is None


@pytest.mark.parametrize(
    "light, tone, words",
    [
        (rm.Sun(intensity=0.01), rm.ToneMapping(), "all surfaces are nearly black, at most"),
        (rm.Sun(), rm.ToneMapping(exposure=-8), "all surfaces are nearly black, at most"),
        (rm.Sun(), rm.ToneMapping(exposure=5), "all surfaces are nearly white, at least 255 of 255"),
    ],
)
def test_surfaces_of_one_tone_are_said_with_an_exposure(light: rm.Light, tone: rm.ToneMapping, words: str) -> None:
    scene = rm.Scene(BALL | FLOOR, rm.Camera((0, 2, 5), (0, 0, 0)), lights=[light], tone=tone)
    with rm.Renderer((48, 27)) as renderer:
        (doubt,) = renderer.render(scene).doubts()
        assert words in doubt
        cured = rm.ToneMapping(exposure=float(doubt.partition("exposure=")[2].strip(")")))
        assert not renderer.render(scene.replace(tone=cured)).doubts()
        assert not renderer.render(scene.replace(node=(BALL | FLOOR).material(rm.Material.unlit("white")))).doubts()


def test_a_floor_that_is_just_white_gets_an_exposure_that_changes_it() -> None:
    floor = rm.plane().material(rm.Material((1, 1, 1), specular=0, ambient=0))
    scene = rm.Scene(floor, rm.Camera((0, 9, 0.1), (0, 0, 0)), lights=[rm.Sun((0, 1, 0))])
    with rm.Renderer((48, 27)) as renderer:
        (doubt,) = renderer.render(scene).doubts()
    assert "nearly white" in doubt and "exposure=-0.5" in doubt


def test_the_exposure_that_ends_white_is_that_of_the_light() -> None:
    """It was moved by the exposure that the scene has already, and ended nothing."""
    scene = rm.Scene(BALL | FLOOR, rm.Camera((0, 2, 5), (0, 0, 0)), lights=[rm.Sun(intensity=9)])
    with rm.Renderer((48, 27)) as renderer:
        found = [renderer.render(scene.replace(tone=rm.ToneMapping(exposure=e))).doubts()[0] for e in (0, 1)]
        aces = renderer.render(scene.replace(tone=rm.ToneMapping("aces"), lights=[rm.Sun(intensity=300)])).doubts()[0]
    assert "(lights of less intensity, or rm.ToneMapping(exposure=" in aces
    assert "clipped to white surfaces" in found[0] and found[0].partition("(")[2] == found[1].partition("(")[2]


def test_an_emission_of_255_is_said() -> None:
    with pytest.warns(rm.SceneWarning, match="divide it by 255"):
        rm.Material(emission=(255, 0, 0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rm.Material(emission=(60, 40, 0))


@pytest.mark.parametrize(
    "turn, words",
    [
        (lambda: BALL.rotate(-20, "x"), r"math.radians\(-20\)"),
        (lambda: BALL.rotate(72), r"math.radians\(72\)"),
        (lambda: BALL.rotate(90 * rm.time), r"angle / time = 90 radians per second .*math.radians\(90\)"),
        (lambda: rm.circle().extrude(1, twist=90), r"extrude: twist = 90 .*math.radians\(90\)"),
        (lambda: rm.isosurface(RISING, -1), "level = -1 is below all values, 0 at least"),
        (lambda: rm.grid(RISING + 1), "no distance is negative, 1 at least"),
    ],
)
def test_it_is_warned_of(turn: Callable[[], Any], words: str) -> None:
    with pytest.warns(rm.SceneWarning, match=words):
        turn()


def test_usual_angles_are_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for angle in (7, 8.25, -2.4, 3.14159, 1.5 * rm.time, rm.time, rm.time * COUNT):
            BALL.rotate(angle)
        rm.box().twist(20)
        rm.isosurface(RISING, 1.5)


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: rm.union(BALL, FLOOR, k=0.1, blend="fillet"), "did you mean 'round'?"),
        (lambda: rm.Camera(projection="ortho"), "did you mean 'orthographic'?"),
        (lambda: rm.Quality(integrator="raytracing"), "did you mean 'whitted'?"),
        (lambda: rm.noise((0, 0, 0)), r"rm.value_noise\(p\) and rm.fbm\(p\) are numbers"),
        (lambda: rm.Material(color=np.ones((3, 3, 3, 3))), r"rm.colormap\(values\(p\), 'viridis'\)"),
        (lambda: rm.colormap(rm.sampled(RISING)), r"the function value .*lambda p: colormap\(values\(p\)\)"),
    ],
)
def test_names_and_data_of_other_tools_are_answered(wrong: Callable[[], Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        wrong()


def test_a_color_may_be_an_array_of_expressions() -> None:
    mixed = rm.Material(color=lambda p: np.array([np.sin(p.x), 0.2, 0.4]))
    assert mixed == rm.Material(color=lambda p: (rm.sin(p.x), 0.2, 0.4))


@pytest.mark.parametrize(
    "text, words",
    [
        ("rm.Material.glass()", r"a.py:2: Material has no 'glass' \(Material\(...\), Material.unlit\)"),
        ("box()", r"a.py:2: name 'box' is not defined \(rm.box, with import raymarch as rm\)"),
        ("np.pi", r"a.py:2: name 'np' is not defined \(import numpy as np\)"),
        ("0\nfrom raymarch import cube", r"a.py:3: raymarch has no 'cube' \(did you mean rm.box"),
    ],
)
def test_a_file_fails_in_our_words(text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        load("a.py", f"import raymarch as rm\nscene = {text}\n".encode())


def test_a_solid_that_a_param_moves_far_is_framed_where_it_is() -> None:
    far, size = rm.Param("far", 0.5, -100, 100), rm.Param("size", 1, 1e-3, 1e3)
    for node, most in ((rm.sphere(0.5).translate((far, 0, 0)) | rm.box(1), 2.5), (rm.box(1).scale(size), 2.5)):
        scene = rm.Scene(node, occlusion=rm.AmbientOcclusion())
        assert scene.framed is not None and 1 < scene.framed.diameter < most
        assert scene.ambient_occlusion is not None and scene.ambient_occlusion.reach is not None
        assert float(scene.ambient_occlusion.reach) < most / 4
    near = rm.Param("near", 0.5, -2, 2)
    both = rm.Scene(rm.sphere(0.5).translate((near, 0, 0))).framed
    assert both is not None and both.diameter > 5


def test_an_endless_solid_that_is_narrow_is_seen_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rm.studio(rm.infinite_cylinder()), rm.studio(rm.infinite_cone())
    columns = rm.infinite_cylinder(0.3).repeat((2, None, 2))
    with pytest.warns(rm.SceneWarning, match="a cube of edge"):
        rm.studio(columns)


def test_what_is_cut_away_is_said() -> None:
    def said(scene: rm.Scene, **values: float) -> str:
        return str(vouch.nothing_visible(scene, Values(values), (scene.pose(Values(values)), (64, 40))))

    cube, shrink = rm.box(1), rm.Param("shrink", 0.0, 0.0, 0.49)
    nothing = (BALL - rm.sphere(2), cube - cube, cube ^ cube, cube & cube.translate((1, 0, 0)))
    for node in (*nothing, rm.morph(rm.torus(1, 0.2), rm.box((0.2, 3, 0.2)))):
        assert "nothing is left of the solid" in said(rm.Scene(node)), node
    inset = rm.Scene(rm.box(1).offset(-shrink) - rm.sphere(0.1))
    assert "nothing is left" in said(inset, shrink=0.45) and "nothing is left" not in said(inset, shrink=0.1)
    thin = (cube & cube.translate((0.9999, 0, 0)), rm.sphere(1) - rm.sphere(0.9999), rm.box((1e6, 1, 1)))
    for node in thin:
        assert "thinner than a pixel" in said(rm.Scene(node)), node
    wide = rm.Camera((0, 0, 5), (0, 0, 0), projection="orthographic", height=1e4)
    assert "thinner than a pixel" in said(rm.Scene(cube, wide))
    assert "another target" in said(rm.Scene(cube, rm.Camera((0, 0, 5), (9, 0, 0))))


def test_a_picture_of_one_color_is_one() -> None:
    even = np.full((20, 20, 3), 0.4)
    assert vouch.has_one_color(even) and not vouch.has_one_color(0 * even)
    even[:3] = 0.2
    assert not vouch.has_one_color(even)


def test_a_scene_without_light_is_said_however_small_it_is() -> None:
    seen = np.full((20, 20, 3), 0.4)
    seen[:2, :5] = 0.0
    assert "the scene has no light" in str(vouch.dark(seen, rm.Scene(BALL, lights=[])))
    assert vouch.dark(seen, rm.Scene(BALL.material(rm.Material.unlit("red")), lights=[])) is None
    assert vouch.dark(seen, rm.Scene(BALL)) is None


def test_clear_glass_in_a_studio_is_without_noise() -> None:
    clear, frosted = (rm.studio(BALL.material(rm.Material(transmission=1, roughness=r))) for r in (0, 0.3))
    assert clear.quality.integrator == "whitted" and vouch.noisy(clear) is None
    assert "glass is noisy with 4 random paths a pixel" in str(vouch.noisy(frosted))
    assert vouch.noisy(frosted.replace(quality=rm.Quality(samples=64))) is None


@pytest.mark.parametrize("node", [rm.circle().extrude(1), rm.rectangle(1).revolve(1), rm.star().extrude(1, twist=1)])
def test_glass_may_be_extruded(node: rm.Node) -> None:
    """Profiles were measured as solids, which failed."""
    scene = rm.Scene(node.material(GLASS), sky=rm.GradientSky())
    assert touching_glass(scene, scene.node) == set()


@pytest.mark.parametrize("paint", [rm.Material("white"), rm.Material(albedo="white"), rm.Material("ivory")])
def test_white_is_not_clipped_in_a_studio(paint: rm.Material) -> None:
    scene = rm.studio(BALL.material(paint))
    assert float(scene.tone.exposure) < 0 and float(rm.studio(BALL).tone.exposure) == 0
    with rm.Renderer((48, 27)) as renderer:
        frame = renderer.render(scene)
        assert not frame.doubts()
        assert np.mean(np.asarray(frame.image()).min(axis=2) == 255) < 0.01
