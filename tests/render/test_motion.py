"""Histories of what moves: never worse than a single frame, and no worse where nothing changes."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound, evaluator
from raymarch.gpu.context import Context
from raymarch.gpu.prepare import frame_uniforms, prepare
from raymarch.gpu.renderer import Renderer
from raymarch.scene.parameter import Values
from tests.hard.rows_motion import MOTIONS, errors_of

KEEP = rm.Quality(temporal="reproject")


@pytest.fixture(scope="module")
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer((80, 60), context=egl) as made:
        yield made


@pytest.mark.parametrize("name", [name for name in MOTIONS if name != "shadow of what is out of sight"])
def test_what_moves_is_never_worse_than_in_a_single_frame(renderer: Renderer, name: str) -> None:
    (found,) = errors_of(renderer, name, (9,))
    assert found.moving <= 0.95 * found.moving_alone
    assert found.still <= 1.05 * found.still_alone + 0.5 / 255


def test_a_shadow_that_sweeps_over_still_ground_is_not_worse_either(renderer: Renderer) -> None:
    """Over several frames: where edges lie in their pixels makes much of the error of one."""
    each = errors_of(renderer, "shadow of what is out of sight", range(8, 13))
    assert sum(e.moving**2 for e in each) <= 0.95 * sum(e.moving_alone**2 for e in each)


ANGLE, SIZE = rm.Param("angle", 0.0, -4, 4), rm.Param("size", 1.0, 0.5, 2)
PLACE = rm.Param("place", (0.0, 0.0, 0.0), -4, 4)


def placed(p: np.ndarray, angle: float, size: float, place: tuple[float, ...]) -> np.ndarray:
    """Points of a part, scaled, turned about y and moved, by NumPy."""
    c, s = math.cos(angle), math.sin(angle)
    return size * p @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + place


def test_points_are_led_back_by_the_transforms_of_their_part() -> None:
    """A part that is scaled, turned and moved at once, beside ground that is not."""
    part = rm.box((1, 0.6, 0.8)).scale(SIZE).rotate(ANGLE, "y").translate(PLACE)
    scene = rm.Scene(part | rm.plane(offset=-6), rm.Camera((0, 0, 12)), quality=KEEP)
    ready = prepare(scene)
    (before,) = (f for f in ready.plan.further if f.name == "previous_position")
    own = np.random.default_rng(1).uniform(-0.5, 0.5, (200, 3))
    was = {"angle": 0.3, "size": 1.2, "place": (0.1, 0.2, -0.3)}
    now = {"angle": 0.9, "size": 0.9, "place": (0.6, -0.1, 0.4)}
    twins = {name: now[leaf.data.name] for name, leaf in ready.plan.twins.items()}
    with bound({**was, **twins}, 0.0):
        found = evaluator([before.body], before.params)(placed(own, **now))[0]
        ground = np.random.default_rng(2).uniform(-4, 4, (200, 3)) * (1, 0, 1) - (0, 6, 0)
        still = evaluator([before.body], before.params)(ground)[0]
    np.testing.assert_allclose(found, placed(own, **was), atol=1e-12)
    assert np.array_equal(still, ground)
    uniforms = frame_uniforms(ready, Values(now, 0.0), (8, 6))
    assert {uniforms[ready.shader.parameters[name]] for name in twins if name == "now angle"} == {0.9}


def test_only_what_moves_pays(renderer: Renderer) -> None:
    """A scene of numbers has no such pass, nor one whose camera alone moves; another draws it when a value changes."""

    def passes(scene: rm.Scene) -> list[str]:
        return [chosen.name for chosen in prepare(scene).plan.passes]

    x = rm.Param("x", 0.0, -1, 1)
    still = rm.Scene(rm.sphere() | rm.plane(offset=-1), rm.Camera((x, 1, 4)), quality=KEEP)
    assert "before" not in passes(still)
    assert "previous_position" not in prepare(still).texts["color"]
    moving = rm.Scene(rm.sphere().translate((x, 0, 0)), rm.Camera((0, 1, 4)), quality=KEEP)
    assert passes(moving)[-4:] == ["sample", "before", "color", "mean"]
    assert "before" not in passes(moving.replace(quality=rm.Quality()))
    renderer.forget()
    drawn = [[t.name for t in renderer.render(moving, params={"x": v}).timings] for v in (0.0, 0.0, 0.2, 0.2)]
    joined = [["color"], ["mean"], ["before", "color"], ["mean"]]
    assert [[name for name in names if name not in ("cone", "sample")] for names in drawn] == joined
    (*_, mean) = renderer.draw_calls(moving, params={"x": 0.2})
    read = {name for name in mean.program.uniforms if name.startswith("u_")}
    assert read == {"u_history", "u_color", "u_surface"}, "a picture that stays asks nothing of what moves"


def test_many_lights_that_move_leave_no_ghost(renderer: Renderer) -> None:
    """Lights as rows of a texture: those of the frame before are kept beside those of this one."""
    x = rm.Param("x", -1.0, -2, 2)
    lights = [rm.PointLight((x + 0.05 * k, 1.5, 1.0), intensity=0.5, shadow=True) for k in range(10)]
    node = rm.sphere(0.5) | rm.plane(offset=-0.5)
    scene = rm.Scene(node, rm.Camera((0, 4, 4), (0, 0, 0)), lights, quality=KEEP)
    renderer.forget()
    for _ in range(8):
        renderer.render(scene, params={"x": -1.0})
    after = renderer.render(scene, params={"x": 1.0}).color
    truth = renderer.render(scene.replace(quality=rm.Quality(samples=64)), params={"x": 1.0}).color
    alone = renderer.render(scene.replace(quality=rm.Quality()), params={"x": 1.0}).color
    assert np.sqrt(np.mean((after - truth) ** 2)) <= np.sqrt(np.mean((alone - truth) ** 2))
