"""Proofs of hard shadows: the scenes of other tests are proved, and faults of a picture of shadows are contradicted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.cli.commands import main
from raymarch.errors import SceneError
from raymarch.proof import proof as module
from raymarch.proof import shadows
from raymarch.proof.search import CONTRADICTED, OPEN, PROVED
from raymarch.proof.shadows import NOT_ASKED, lit_pixels
from raymarch.scene.parameter import Values

SIZE = (32, 18)


CAMERA = rm.Camera((1.0, 1.5, 4.0), (0, 0.4, 0))
SUN, LAMP = rm.Sun((-0.6, 1.0, -0.9), shadow=True), rm.PointLight((-1.0, 1.6, 1.0), shadow=True)


def scene(*lights: Any) -> rm.Scene:
    solid = rm.sphere(0.5).translate((0, 0.5, 0)) | rm.box((0.3, 1.2, 0.3)).translate((0.8, 0.6, -0.2)) | rm.plane()
    return rm.Scene(solid, CAMERA, list(lights) or [SUN])


def test_a_sun_and_a_lamp() -> None:
    """Lights without a shadow, and soft ones, are not asked for."""
    lights = rm.Sun((0, 1, 0)), LAMP, rm.Sun((1, 1, 0), shadow=True, softness=0.1), SUN
    found = rm.prove(scene(*lights), size=SIZE, shadows=True)
    assert [(each.light, each.name) for each in found.shadows] == [(1, "PointLight"), (3, "Sun")]
    for each in found.shadows:
        assert each.count(CONTRADICTED) == 0 and each.count(PROVED) > 0.97 * each.asked > 200
        assert np.all(each.state[~np.isfinite(found.depth)] == NOT_ASKED)
        assert str(each) in str(found)
    assert found.as_dict()["shadows"][1]["asked"] == found.shadows[1].asked
    assert rm.prove(scene(), size=SIZE).shadows == ()


def test_a_lamp_out_of_reach_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """So of a thousand lamps with ranges only those are drawn that may light a pixel."""
    drawn: list[Any] = []

    def noted(given: rm.Scene, lights: Any, *more: Any) -> Any:
        drawn.extend(lights)
        return lit_pixels(given, lights, *more)

    monkeypatch.setattr(module, "lit_pixels", noted)
    far, behind = rm.PointLight((0, 9, 0), shadow=True, range=2.0), rm.PointLight((0, -1, 0), shadow=True, range=0.9)
    shares: list[float] = []
    above = scene(far, LAMP, behind).replace(camera=rm.Camera((1.0, 3.0, 3.0), (0, 0.2, 0), fov=30))
    found = rm.prove(above, size=(16, 9), shadows=True, pixels="whole", progress=shares.append)
    assert drawn == [[LAMP]] and [each.asked > 0 for each in found.shadows] == [False, True, False]
    assert shares == sorted(shares) and shares[-1] == 1.0 and any(1 / 3 < share < 2 / 3 for share in shares)


def shifted(lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.roll(lit, 2, axis=1)


def row_of_lamps(count: int) -> list[rm.PointLight]:
    return [rm.PointLight((1.5 * i - 3.0, 0.9, 1.0), shadow=True, range=1.4) for i in range(count)]


def test_many_lamps_are_drawn_in_few_pictures_and_judged_as_each_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those whose ranges do not meet share a colour of one picture."""
    drawn: list[Any] = []

    def noted(given: rm.Scene, lights: Any, *more: Any) -> Any:
        drawn.append([len(own) for own in lights])
        return lit_pixels(given, lights, *more)

    monkeypatch.setattr(module, "lit_pixels", noted)
    lamps = [*row_of_lamps(5), LAMP, SUN]
    found = rm.prove(scene(*lamps), size=SIZE, shadows=True)
    assert sum(map(sum, drawn)) == 7 and len(drawn) == 2 and max(map(max, drawn)) >= 3
    assert all(each.asked > 10 and each.unsearched == 0 for each in found.shadows)
    for index in (1, 5):
        (alone,) = rm.prove(scene(lamps[index]), size=SIZE, shadows=True).shadows
        np.testing.assert_array_equal(found.shadows[index].state, alone.state)


def test_the_search_for_ways_to_lights_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ways beyond are open, and the text says so."""
    monkeypatch.setattr(shadows, "MOST", 300)
    monkeypatch.setattr(shadows, "TILE", 100)
    shares: list[float] = []
    found = rm.prove(scene(SUN, LAMP), size=SIZE, shadows=True, progress=shares.append)
    left = [each.unsearched for each in found.shadows]
    searched = [each.asked - each.unsearched for each in found.shadows]
    assert 100 <= sum(searched) <= 300 and all(
        each.count(OPEN) >= n for each, n in zip(found.shadows, left, strict=True)
    )
    assert "beyond 300 ways to lights" in str(found) and shares == sorted(shares) and shares[-1] == 1.0
    assert sum(each["unsearched"] for each in found.as_dict()["shadows"]) == sum(left) > 100


@pytest.mark.parametrize(
    ("fault", "least"),
    [(np.ones_like, 8), (np.zeros_like, 200), (np.logical_not, 200), (shifted, 7)],
    ids=["no shadow", "no light", "swapped", "moved by two pixels"],
)
def test_a_wrong_shadow_is_contradicted(monkeypatch: pytest.MonkeyPatch, fault: Any, least: int) -> None:
    def spoiled(*given: Any) -> Any:
        lit, depth = lit_pixels(*given)
        return fault(lit), depth

    monkeypatch.setattr(module, "lit_pixels", spoiled)
    (found,) = rm.prove(scene(), size=(24, 14), shadows=True).shadows
    assert found.count(CONTRADICTED) >= least


def test_a_shadow_of_another_solid(monkeypatch: pytest.MonkeyPatch) -> None:
    """The box casts none in the picture."""
    other = scene().replace(node=rm.sphere(0.5).translate((0, 0.5, 0)) | rm.plane())
    monkeypatch.setattr(module, "lit_pixels", lambda given, *more: lit_pixels(other, *more))
    (found,) = rm.prove(scene(), size=SIZE, shadows=True).shadows
    assert found.count(CONTRADICTED) > 5


def test_what_is_hidden_from_shadow_rays_blocks_nothing() -> None:
    ball = rm.sphere(0.5).translate((0, 0.5, 0)).visible(shadow=False)
    (found,) = rm.prove(scene().replace(node=ball | rm.plane()), size=SIZE, shadows=True).shadows
    assert found.count(CONTRADICTED) == found.count(OPEN) == 0 and found.asked > 200


def test_a_thin_blocker_and_a_light_at_a_surface() -> None:
    """Solids thinner than the tolerance darken a picture; a light on a surface is not blocked by it."""
    plate = rm.box((0.6, 1e-4, 0.6)).translate((0, 0.5, 0)) | rm.plane()
    (found,) = rm.prove(scene().replace(node=plate), size=SIZE, shadows=True).shadows
    assert found.count(CONTRADICTED) == 0 and found.count(PROVED) > 0.95 * found.asked
    # far rays pass the ball less deep than their tolerance, and nearer to the light
    touching = scene(rm.PointLight((0, 1.0, 0), shadow=True))
    (found,) = rm.prove(touching, size=SIZE, shadows=True).shadows
    assert found.count(CONTRADICTED) == 0


@pytest.mark.parametrize(("width", "rise"), [(0.35, 0.35), (0.25, 0.52), (0.25, 0.6)])
def test_what_stands_beside_a_hit_darkens_it(width: float, rise: float) -> None:
    """Posts a third of a pixel wide: rays to a low sun that start 0.8 pixels along would pass over them. Narrower ones
    lie between the offset and the first sample, which is too near to them to prove that part empty."""
    pixel = 8.0 * 2.0 * np.tan(np.radians(20.0)) / 14.0
    posts = rm.box((width * pixel, 1.2 * pixel, 3.0 * pixel)).repeat((1.3 * pixel, None, 5.0 * pixel), (12, 1, 4))
    low = rm.Sun((-np.sqrt(1.0 - rise * rise), rise, 0.03), shadow=True)
    above = rm.Scene(posts | rm.plane(), rm.Camera((0, 8, 0.1), (0, 0, 0)), [low], quality=rm.Quality(analytic=False))
    (found,) = rm.prove(above, size=(25, 14), shadows=True).shadows
    assert found.count(CONTRADICTED) == 0 and found.count(PROVED) > 0.85 * found.asked > 200


def test_parameters_of_other_lights_and_of_the_sky_keep_their_values() -> None:
    """A picture of one light has none of them."""
    lamp = rm.PointLight((-1, rm.Param("height", 1.6, 1, 2), 1), shadow=True)
    lit = scene(SUN, lamp).replace(sky=rm.Sky((rm.Param("red", 0.1, 0, 1), 0, 0)))
    given = {"height": 1.2, "red": 0.5}
    moved = rm.prove(lit, size=SIZE, shadows=True, params=given)
    fixed = rm.prove(scene(SUN, rm.PointLight((-1, 1.2, 1), shadow=True)), size=SIZE, shadows=True)
    for one, other in zip(moved.shadows, fixed.shadows, strict=True):
        np.testing.assert_array_equal(one.state, other.state)


def test_the_camera_in_a_solid_asks_for_no_shadow() -> None:
    inside = rm.Scene(rm.sphere(2.0), rm.Camera((0, 0, 1), (0, 0, 0)), [SUN])
    (found,) = rm.prove(inside, size=(16, 9), shadows=True).shadows
    assert found.asked == 0


def test_the_command(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "a.py"
    file.write_text(
        "import raymarch as rm\n"
        "ball = rm.sphere(0.5).translate((0, 0.5, 0))\n"
        "scene = rm.Scene(ball | rm.plane(), lights=[rm.Sun((1, 2, 1), shadow=True)])\n"
    )
    with pytest.raises(SystemExit) as ended:
        main(["prove", str(file), "--size", "32x18", "--shadows"])
    assert ended.value.code == 0 and "hard shadows of Sun 0 proved" in capsys.readouterr().out


def test_bad_input() -> None:
    with pytest.raises(SceneError, match="prove: shadows"):
        rm.prove(scene(), size=(8, 8), shadows="yes")  # type: ignore[arg-type]


def test_a_pixel_whose_picture_of_the_light_has_another_hit_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a silhouette either of two hits may be right, and either may be dark."""

    def elsewhere(*given: Any) -> Any:
        lit, depth = lit_pixels(*given)
        rows = np.arange(len(lit)) % 2 == 0
        lit[rows], depth[rows] = False, 0.5 * depth[rows]
        return lit, depth

    monkeypatch.setattr(module, "lit_pixels", elsewhere)
    (found,) = rm.prove(scene(), size=SIZE, shadows=True).shadows
    assert found.count(CONTRADICTED) == 0 and found.count(PROVED) > 100
    assert np.all(found.state[::2] == NOT_ASKED)


def test_a_hit_on_the_far_side_of_an_edge_is_dark_without_a_blocker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within the tolerance of the proved hit the other face is drawn, which faces away from the light."""
    box = rm.box((1.0, 1.0, 1.0)).rotate(0.7, "y")
    above = rm.Scene(box, rm.Camera((2, 0.5, 4), (0, 0, 0)), [rm.Sun((1.0, 0.5, 0.3), shadow=True)])
    moved = []

    def over_the_edge(given: rm.Scene, light: Any, size: tuple[int, int], *more: Any) -> Any:
        lit, depth = lit_pixels(given, light, size, *more)
        seen = rm.truth(above, size)
        deeper = depth + 1.8 * above.pose(Values({}, 0.0), size[0] / size[1]).pixel(size[1]) * depth
        hit = np.isfinite(depth)
        points = seen.origin[hit] + deeper[hit][:, None] * seen.direction[hit]
        away = np.zeros_like(lit[..., 0])
        normals = box.gradient(points)
        towards = np.sum(normals * seen.direction[hit], axis=1) < 0.0
        away[hit] = towards & (normals @ np.array([1.0, 0.5, 0.3]) < 0.0)
        moved.append(int((away & lit[..., 0]).sum()))
        return np.where(away[..., None], False, lit), np.where(away, deeper, depth)

    monkeypatch.setattr(module, "lit_pixels", over_the_edge)
    (found,) = rm.prove(above, size=(48, 36), tolerance="2px", shadows=True).shadows
    assert moved[0] > 2 and found.count(CONTRADICTED) == 0 and found.asked > 10


def test_a_hit_behind_the_rim_of_a_ball_is_not_lit_from_within(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ray passes the ball by less than the tolerance, and the normal of its hit faces away from the camera."""
    frame = type("", (), {"depth": np.array([[5.005]])})()
    monkeypatch.setattr(module, "lit_pixels", lambda *_: (np.zeros((1, 1, 3), bool), frame.depth))
    ball = rm.sphere(1.0).translate((-1.0005, 0, 0)).visible(shadow=False)
    for x, asked in ((-1.0, 0), (1.0, 1)):
        lit = rm.Scene(ball, rm.Camera((0, 0, 5), (0, 0, 0)), [rm.PointLight((x, 0, 0), shadow=True)])
        found = rm.prove(lit, frame, tolerance=0.01, shadows=True)
        assert found.grazing.all() and found.shadows[0].asked == asked
