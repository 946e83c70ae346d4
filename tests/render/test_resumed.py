"""A march over many passes: the same picture as in one, spread over frames, and never begun anew without need."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.gpu.clock import Clock
from raymarch.gpu.context import Context
from raymarch.gpu.renderer import Renderer
from raymarch.plan import lights, plan
from raymarch.scene.quality import TRACERS
from tests.support.compared import same_texels

SIZE = (96, 54)
EVERYTHING = ("color", "depth", "normal", "material")


@cache
def scene(angle: float = 0.0, **quality: Any) -> rm.Scene:
    ring = rm.union(rm.torus(0.7, 0.2).rotate(1.2, "x"), rm.sphere(0.4), k=0.2)
    place = (3.4 * np.sin(angle), 0.8, 3.4 * np.cos(angle))
    return rm.Scene(
        ring | rm.plane(offset=-0.8),
        rm.Camera(place, (0, -0.1, 0), fov=50),
        lights=[rm.Sun(shadow=True)],
        quality=rm.Quality(**quality),
    )


@pytest.fixture(scope="module")
def opened(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, context=egl) as made:
        yield made


@pytest.fixture
def renderer(opened: Renderer) -> Renderer:
    """It has the programs of the tests before, and no history."""
    opened.forget()
    return opened


@pytest.mark.parametrize("tracer", [t for t in TRACERS if t != "auto"])
@pytest.mark.parametrize("schedule", ["single", "cones"])
@pytest.mark.parametrize("steps_per_pass", [4, 7])
def test_many_passes_draw_the_picture_of_one(
    renderer: Renderer, tracer: str, schedule: str, steps_per_pass: int
) -> None:
    """Bit for bit: the state that is carried from pass to pass is all that a march knows. Counts take in the shares of
    cones, which are summed in another order."""
    everything = (*EVERYTHING, "iterations", "evaluations", "residual", "fallbacks", "done", "reach")
    whole = renderer.render(scene(tracer=tracer, schedule=schedule), outputs=everything)
    parts = renderer.render(scene(tracer=tracer, schedule=schedule, steps_per_pass=steps_per_pass), outputs=everything)
    assert parts.complete and sum(t.name == "march" for t in parts.timings) > 1
    for name in everything:
        ulps = 2 if schedule == "cones" and name in ("iterations", "evaluations") else 0
        np.testing.assert_allclose(parts.array(name), whole.array(name), rtol=ulps * 2.0**-23, err_msg=name)


@pytest.mark.parametrize("schedule", ["single", "cones"])
def test_passes_keep_the_stretch_for_which_bounds_are_asked(renderer: Renderer, schedule: str) -> None:
    heart = rm.implicit(
        lambda p: (rm.dot(p, p) - 1) ** 3 - p.x**2 * p.y**3 + 0.1 * p.z**2, bounds=((-2,) * 3, (2,) * 3)
    )
    given = scene(tracer="advance", schedule=schedule, max_steps=2000).replace(node=heart | rm.plane(offset=-1.5))
    whole = renderer.render(given, outputs=("depth", "residual"))
    split = given.replace(quality=given.quality.replace(steps_per_pass=4))
    parts = renderer.render(split, outputs=("depth", "residual"))
    assert sum(t.name == "march" for t in parts.timings) > 1
    for name in ("depth", "residual"):
        np.testing.assert_array_equal(parts.array(name), whole.array(name))


def test_the_passes_end_when_all_rays_have_arrived(renderer: Renderer) -> None:
    few = renderer.render(scene(steps_per_pass=16))
    marched = [t for t in few.timings if t.name == "march"]
    assert len(marched) < 512 / 16
    assert few.iterations.max() > 16 * (len(marched) - 1)


@cache
def street(**quality: Any) -> rm.Scene:
    """A solid under ten lights, with all that is added before lights: emission, the sky's light and its occlusion."""
    glow = rm.Material(emission=(0.1, 0.0, 0.0), color=(0.4, 0.6, 0.8))
    place = rm.torus(0.7, 0.2).material(glow)
    lamps = [rm.PointLight((np.sin(k), 1, np.cos(k)), intensity=0.1, shadow=k % 2 == 0) for k in range(9)]
    return rm.Scene(
        rm.union(place, rm.plane(offset=-0.4), k=0.1),
        rm.Camera((0, 1.5, 3), (0, 0, 0)),
        lights=[*lamps, rm.RectLight((0, 2, 0), shadow=True)],
        sky=rm.Sky((0.2, 0.3, 0.4), light=True),
        occlusion=rm.AmbientOcclusion(),
        fog=rm.Fog((0.5, 0.5, 0.5), 0.05),
        quality=rm.Quality(**quality),
    )


@cache
def disc(**quality: Any) -> rm.Scene:
    """A street under two lights that are written as code, of which one has several samples; a fixed camera."""
    made = street(**quality)
    lights = [made.lights[0], rm.Sun(shadow=True, softness=0.3, penumbra="sampled"), made.lights[-1]]
    return made.replace(lights=lights, occlusion=rm.AmbientOcclusion(3, strength=rm.Param("strength", 0.7)))


@pytest.mark.parametrize(
    ("made", "more", "count"),
    [
        (street, {}, 15),
        (street, {"samples": 2, "schedule": "cones"}, 15),
        (street, {"light_samples": 3}, 35),
        (disc, {"light_samples": 3}, 10),
        (lambda **quality: disc(**quality).replace(lights=[]), {}, 3),
    ],
)
def test_light_of_several_frames_makes_the_picture_of_one(
    renderer: Renderer, made: Any, more: dict[str, Any], count: int
) -> None:
    """Bit for bit: the sum goes through float textures in the order of the samples. Surfaces are found once a sample of
    the picture. `count` is the number of samples of light: of occlusion, then of lights, of which each has as many
    places in a loop over rows."""
    more = {**more, "temporal": "accumulate"}
    whole = renderer.render(made(**more))
    each = 4 if count > 4 else 2
    scene = made(**more, lights_per_pass=each)
    frames = []
    for _ in range(40):
        frames.append(renderer.render(scene, within=0.0))
        if frames[-1].complete:
            break
    samples = more.get("samples", 1)
    drawn = [timing.name for frame in frames for timing in frame.timings]
    assert renderer.history.light.count == count
    assert len(frames) == samples * (-(-count // each) - 1) + 1  # the next sample begins in the same frame
    assert drawn.count("surface") == samples
    assert all([t.name for t in frame.timings].count("light") == 1 for frame in frames[-2:])
    same_texels(renderer, frames[-1].color, whole.color)
    assert np.abs(frames[0].color - whole.color).max() > 0.01


def test_other_arrays_beside_the_picture(renderer: Renderer) -> None:
    """They do not end the split of light, and their rays go through the centres of pixels."""
    given = {"temporal": "accumulate", "samples": 2}
    whole = renderer.render(street(**given), outputs=EVERYTHING)
    frames = [renderer.render(street(**given, lights_per_pass=8), outputs=EVERYTHING, within=0.0) for _ in range(3)]
    assert [frame.complete for frame in frames] == [False, False, True]
    for name in EVERYTHING:
        same_texels(renderer, frames[-1].array(name), whole.array(name))


@pytest.mark.parametrize(("budget", "most"), [(20.0, 8), (4.0, 45)])
def test_a_budget_chooses_how_much_light_a_pass_adds(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, budget: float, most: int
) -> None:
    """A clock by which a pass of k samples of light takes 4 + k ms for all rows, and any other 1. Frames learn that,
    and take no more than their budget, for which a pass may be drawn over several frames; the first one does not know
    it yet. The first draws of programs count for nothing."""

    def clock(self: Clock, draw: Any) -> float:
        del self
        draw()
        call = draw.__self__
        samples = call.uniforms.get("u_end_sample", 0) - call.uniforms.get("u_first_sample", 0)
        return (4.0 + samples) * (call.part[3] / SIZE[1] if call.part else 1.0) if samples else 1.0

    monkeypatch.setattr(Clock, "time", clock)
    lamps = [rm.PointLight((np.sin(k), 1, np.cos(k)), intensity=0.02) for k in range(60)]
    scene = street(lights_per_pass="auto", temporal="accumulate").replace(lights=lamps, occlusion=None)
    frames = []
    while not frames or not frames[-1].complete:
        frames.append(renderer.render(scene, within=budget))
    took = [sum(t.draw for t in frame.timings) for frame in frames]
    assert max(took[2:]) <= 1.1 * budget and took[0] <= max(22.0, budget) and len(frames) < most
    assert np.median(took) > 0.6 * budget
    whole = renderer.render(scene.replace(quality=rm.Quality(temporal="accumulate")))
    same_texels(renderer, frames[-1].color, whole.color)


def test_cells_find_the_lights_that_the_loop_over_all_adds(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit, whole and in pieces, with lights that move and some without a range."""
    lamps = [rm.PointLight((0.4 * k - 4 + rm.time, 0.5, np.sin(k)), intensity=0.3, range=1.5) for k in range(20)]
    more = [rm.Sun(intensity=0.1), rm.RectLight((0, 1, 0), range=2.0, shadow=True)]
    given = {"lights": [*lamps[:9], *more, *lamps[9:]]}
    scene = street(lights_per_pass=3, temporal="accumulate").replace(**given)
    found = []
    for time in (0.0, 0.7):
        renderer.forget()
        found.append(renderer.render(scene, time).color)
        renderer.forget()
        frames = [renderer.render(scene, time, within=0.0)]
        while not frames[-1].complete:
            frames.append(renderer.render(scene, time, within=0.0))
        assert 1 < len(frames) < 22 / 3  # passes follow the longest list
        same_texels(renderer, frames[-1].color, found[-1])
    blurred = scene.replace(camera=scene.camera.replace(shutter=0.5), quality=scene.quality.replace(samples=3))
    assert any(renderer.render(blurred, 0.7, within=0.0).complete for _ in range(40))  # rows differ between its samples
    monkeypatch.setattr(lights, "in_cells", lambda *_: False)
    with Renderer(SIZE, "egl") as other:
        for time, color in zip((0.0, 0.7), found, strict=True):
            other.forget()
            same_texels(other, other.render(scene, time).color, color)
    assert np.abs(found[0] - found[1]).max() > 0.01


def test_a_frame_without_a_picture_is_complete_although_light_is_left(renderer: Renderer) -> None:
    scene = street(lights_per_pass=1, temporal="accumulate")
    found = [renderer.render(scene, outputs=(name,), within=0.0).complete for name in ("color", "depth", "color")]
    assert found == [False, True, False]


def test_lights_without_a_budget_are_one_pass(renderer: Renderer) -> None:
    made = renderer.render(street(lights_per_pass=4))
    assert [t.name for t in made.timings] == ["surface", "light", "color"] and made.complete
    same_texels(renderer, made.color, renderer.render(street()).color)
    few = street(lights_per_pass="auto")
    for other in (few.replace(lights=few.lights[:1], occlusion=None), few.replace(bounces=1)):
        assert not plan(other).lights_split
    with pytest.raises(SceneError, match="lights_per_pass = 4 with temporal = 'reproject'"):
        rm.Quality(lights_per_pass=4, temporal="reproject")
    with pytest.raises(SceneError, match="lights_per_pass = 'few'"):
        rm.Quality(lights_per_pass="few")


def test_progress_is_told_to_the_end(renderer: Renderer) -> None:
    told: list[float] = []
    renderer.render(scene(steps_per_pass=8), progress=told.append)
    assert told == sorted(told) and told[-1] == 1.0


def test_steps_per_pass_are_for_one_ray_a_pixel() -> None:
    for other in ({"samples": 2}, {"temporal": "reproject"}):
        with pytest.raises(SceneError, match="steps_per_pass = 8 with"):
            rm.Quality(steps_per_pass=8, **other)  # type: ignore[arg-type]
    for wrong in (3, 60001, 1.5, True):
        with pytest.raises(SceneError, match=f"steps_per_pass = {wrong}"):
            rm.Quality(steps_per_pass=wrong)  # type: ignore[arg-type]
