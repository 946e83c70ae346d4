"""Random sequences of frames on one renderer, each compared bit for bit with a renderer that drew nothing else.

python -m tests.lab.frames --sequences 200 [--seed 1] [--scene NAME] [--shrink]

A sequence changes parameters, time, camera, size and requested arrays, draws two scenes in turn, interrupts frames by a
budget or an exception, and reads arrays of earlier frames. A picture that accumulates samples must be one of those that
a new renderer draws when it repeats the frame. A sequence that fails is printed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import hypothesis.strategies as st
import numpy as np
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test

import raymarch as rm
from raymarch.gpu import Frame, Renderer
from raymarch.gpu.context import Context, open_context
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values, set_values

SIZES = ((24, 16), (17, 23))
TIMES = (0.0, 0.5, 2.0)
VALUES = (0.0, 0.4, 1.0)
"""Of the parameters `a` and `b`, which every scene has."""
ASKED = (("color",), ("depth",), ("color", "depth"), ("color", "slice"), ("normal", "position"))
COMPARED = ("depth", "normal", "material", "position", "slice")
A, B = rm.Param("a", 0.4, 0.0, 1.0), rm.Param("b", 0.4, 0.0, 1.0)
ACCUMULATE = rm.Quality(temporal="accumulate")


def solids(x: Any = 0.0, **material: Any) -> rm.Node:
    blend = rm.union(rm.sphere(0.6).translate((x, 0, 0)), rm.box((0.8, 0.8, 0.8)), k=0.2)
    return blend.material(rm.Material((0.9, 0.5, 0.2), **material)) | rm.plane(offset=-0.8)


def balls(x: Any) -> rm.Node:
    """Enough of them to be rows of a texture."""
    places = [(i % 8 - 3.5, 0.2 * (i % 3) - 0.2, i // 8 - 2.0) for i in range(40)]
    moved = [(px + x, py + 0.1 * (i % 5) * x, pz) for i, (px, py, pz) in enumerate(places)]
    row = [rm.box(0.5).translate(place).material(rm.Material((0.9, 0.02 * i, 0.3))) for i, place in enumerate(moved)]
    return rm.union(*row) | rm.plane(offset=-0.5)


def lamps(x: Any, near: Any, count: int = 20) -> list[rm.Light]:
    return [
        rm.PointLight((0.4 * i - 4, 0.8 + 0.1 * (i % 4), x), intensity=0.4, range=near, shadow=i % 3 == 0)
        for i in range(count)
    ]


def camera(**given: Any) -> rm.Camera:
    return rm.Camera(**{"position": (0.5, 0.8, 4.0), "target": (0, 0, 0), **given})


def _scenes() -> dict[str, rm.Scene]:
    sun = [rm.Sun(shadow=True)]
    still, moving = solids(0.2), solids(rm.sin(rm.time) + A)
    return {
        "moving": rm.Scene(moving, camera(fov=40 + 20 * B), lights=sun),
        "cones": rm.Scene(moving, camera(fov=40 + 20 * B), sun, quality=ACCUMULATE.replace(schedule="cones")),
        "rows": rm.Scene(balls(A * rm.cos(rm.time)), camera(position=(B, 2, 5)), sun, quality=ACCUMULATE),
        "lights": rm.Scene(still, camera(), lamps(A + rm.time, 0.3 + B), quality=ACCUMULATE.replace(lights_per_pass=3)),
        "steps": rm.Scene(
            solids(A * rm.time), camera(), lamps(1.0, 0.5 + B), quality=ACCUMULATE.replace(steps_per_pass=8)
        ),
        "lights in steps": rm.Scene(
            solids(A),
            camera(),
            lamps(rm.time, 0.5 + B),
            quality=ACCUMULATE.replace(steps_per_pass=8, lights_per_pass=4),
        ),
        "lens": rm.Scene(still, camera(aperture=0.3 * A, focus=3 + B), sun, quality=ACCUMULATE.replace(samples=2)),
        "shutter": rm.Scene(
            solids(A * rm.sin(3 * rm.time)), camera(shutter=B), sun, quality=ACCUMULATE.replace(samples=3)
        ),
        "shutter of a camera": rm.Scene(
            still, camera(position=(0, 0.8 + A * rm.sin(rm.time), 4), shutter=0.1 + B), sun, quality=ACCUMULATE
        ),
        "shutter of rows": rm.Scene(
            balls(rm.sin(2 * rm.time)), camera(position=(0, 2, 5), shutter=A), sun, quality=rm.Quality(samples=3)
        ),
        "shutter of lights": rm.Scene(
            still, camera(shutter=A), lamps(rm.time, 0.5 + B), quality=ACCUMULATE.replace(lights_per_pass=5, samples=2)
        ),
        "bloom": rm.Scene(
            solids(A, emission=(4 * B, 3, 1)),
            camera(),
            sun,
            post=[rm.Bloom(0.1 + A, 0.05 + 0.1 * B)],
            quality=ACCUMULATE,
        ),
        "paths": rm.Scene(
            solids(A, metalness=1.0, roughness=0.1 + 0.5 * B), camera(), sun, bounces=2, quality=ACCUMULATE
        ),
        "sky": rm.Scene(still, camera(), [], sky=rm.Sky((A, 0.5, B), light=True), quality=ACCUMULATE),
        "fog": rm.Scene(still, camera(), sun, fog=rm.Fog((A, 0.5, 0.5), 2 + 3 * B), quality=ACCUMULATE),
        "front": rm.Scene(
            moving,
            camera(projection="orthographic", height=2 + 2 * B, near=2 + 2 * A),
            sun,
            quality=ACCUMULATE.replace(schedule="cones"),
        ),
        "reprojected": rm.Scene(moving, camera(fov=40 + 20 * B), sun, quality=rm.Quality(temporal="reproject")),
        "reprojected lights": rm.Scene(still, camera(), lamps(A, 0.5 + B), quality=rm.Quality(temporal="reproject")),
        "reprojected rows": rm.Scene(
            balls(A), camera(position=(B, 2, 5)), sun, quality=rm.Quality(temporal="reproject")
        ),
    }


SCENES: Mapping[str, rm.Scene] = _scenes()


@dataclass(frozen=True)
class State:
    """What a frame shows."""

    scene: str
    size: tuple[int, int]
    time: float = 0.0
    params: tuple[tuple[str, float], ...] = (("a", 0.4), ("b", 0.4))
    turned: bool = False

    @property
    def given(self) -> dict[str, Any]:
        scene, values = SCENES[self.scene], values_of(self)
        pose = scene.pose(values, self.size[0] / self.size[1])
        return {
            "time": self.time,
            "params": {k: v for k, v in self.params if k in scene.parameters},
            "pose": turned(pose) if self.turned else None,
        }


def values_of(state: State) -> Values:
    scene = SCENES[state.scene]
    return set_values(scene.parameters, {k: v for k, v in state.params if k in scene.parameters}, state.time, None)


def turned(pose: Pose) -> Pose:
    """The camera, moved a little."""
    return replace(pose, position=pose.position + np.array([0.1, 0.05, 0.0]))


def drawn(renderer: Renderer, state: State, **given: Any) -> Frame:
    return renderer.render(SCENES[state.scene], **state.given, **given)


@cache
def shared() -> Context:
    """The context of new renderers."""
    return open_context("egl")


@cache
def series(state: State, frames: int) -> list[np.ndarray]:
    """The pictures of a new renderer that repeats a frame."""
    with Renderer(state.size, context=shared()) as fresh:
        return [drawn(fresh, state).color for _ in range(frames)]


@cache
def arrays(state: State) -> dict[str, np.ndarray]:
    """The other arrays of a frame, of a new renderer."""
    with Renderer(state.size, context=shared()) as fresh:
        frame = drawn(fresh, state, outputs=COMPARED)
        return {name: frame.array(name) for name in COMPARED}


@cache
def transparent(state: State, frames: int) -> np.ndarray:
    """The transparent picture of a new renderer that repeats a frame."""
    with Renderer(state.size, context=shared()) as fresh:
        for _ in range(frames):
            frame = drawn(fresh, state)
        return np.asarray(frame.image(alpha=True))


CHANGES = st.tuples(st.sampled_from(("", "time", "a", "b", "turned", "scene")), st.integers(1, 2))


def _next(values: tuple[float, ...], value: float, by: int) -> float:
    return values[(values.index(value) + by) % len(values)]


class Stop(Exception):
    """Interrupts a frame."""


class Frames(RuleBasedStateMachine):
    """A renderer, and what it must show."""

    names: tuple[str, ...] = tuple(SCENES)

    def __init__(self) -> None:
        super().__init__()
        self.renderer = Renderer(SIZES[0], "egl")
        self.thread = ThreadPoolExecutor(1)
        self.drawn = 0
        self.at: int | None = None
        self.held: list[tuple[State, Frame]] = []

    @initialize(data=st.data())
    def begin(self, data: st.DataObject) -> None:
        names = st.sampled_from(self.names)
        self.pair = (data.draw(names, "scene"), data.draw(names, "other"))
        self.state = State(self.pair[0], SIZES[0])

    def change(self, new: tuple[str, int]) -> None:
        """Let the following frames show something else: the next value of a part, or the one after that."""
        part, by = new
        given = dict(self.state.params)
        changed: dict[str, Any] = {
            "": {},
            "time": {"time": _next(TIMES, self.state.time, by)},
            "turned": {"turned": not self.state.turned},
            "scene": {"scene": self.pair[self.state.scene == self.pair[0]]},
            **{name: {"params": tuple({**given, name: _next(VALUES, given[name], by)}.items())} for name in given},
        }[part]
        after = replace(self.state, **changed)
        if after != self.state:
            self.state, self.at = after, None

    @rule(size=st.sampled_from(SIZES))
    def resize(self, size: tuple[int, int]) -> None:
        if size != self.renderer.size:
            self.held.clear()
            self.renderer.resize(size)
            self.state, self.at = replace(self.state, size=size), None

    @rule()
    def forget(self) -> None:
        self.renderer.forget()
        self.at = None

    @rule(new=CHANGES, outputs=st.sampled_from(ASKED), progress=st.booleans(), thread=st.booleans())
    def draw(self, new: tuple[str, int], outputs: tuple[str, ...], progress: bool, thread: bool) -> None:
        self.change(new)
        given: dict[str, Any] = {"outputs": outputs}
        if progress:
            given["progress"] = lambda share: None

        def work() -> Frame:
            return drawn(self.renderer, self.state, **given)

        self.check(self.thread.submit(work).result() if thread else work(), outputs)

    @rule(new=CHANGES)
    def draw_color(self, new: tuple[str, int]) -> None:
        self.change(new)
        last = self.at
        self.check(drawn(self.renderer, self.state), ("color",))
        if last is not None and self.accumulates and SCENES[self.state.scene].quality.steps_per_pass is None:
            assert self.at == last + 1, f"sample {self.at} after {last}"

    @rule(new=CHANGES)
    def draw_within(self, new: tuple[str, int]) -> None:
        self.change(new)
        frame = drawn(self.renderer, self.state, within=0.0)
        self.at = None
        if frame.complete:
            self.check(frame, ("color",))

    @rule()
    def draw_until_complete(self) -> None:
        self.at = None
        if SCENES[self.state.scene].quality.temporal != "accumulate":
            return
        for _ in range(200):
            frame = drawn(self.renderer, self.state, within=0.0)
            if frame.complete:
                self.check(frame, ("color",))
                return
        raise AssertionError("200 frames and not complete")

    @rule(calls=st.integers(0, 2))
    def interrupt(self, calls: int) -> None:
        left = [calls]

        def stop(share: float) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise Stop

        try:
            drawn(self.renderer, self.state, progress=stop)
        except Stop:
            self.at = None

    @rule(new=CHANGES)
    def hold(self, new: tuple[str, int]) -> None:
        self.change(new)
        frame = drawn(self.renderer, self.state, outputs=("normal",))
        self.held.append((self.state, frame))

    @precondition(lambda self: self.held)
    @rule(color=st.booleans())
    def read_a_held_frame(self, color: bool) -> None:
        state, frame = self.held.pop(0)
        self.at = None
        for name in COMPARED:
            same(frame.array(name), arrays(state)[name], f"{name} of an earlier frame, {state}")
        if color and not self.reprojects:
            self.find(frame.color, state)

    @precondition(lambda self: not self.reprojects)
    @rule()
    def draw_transparent(self) -> None:
        frame = drawn(self.renderer, self.state)
        number = self.find(frame.color, self.state)
        self.at = None
        same(np.asarray(frame.image(alpha=True)), transparent(self.state, number), f"transparency of {self.state}")

    @rule()
    def doubt(self) -> None:
        drawn(self.renderer, self.state).doubts(steps=True)
        self.at = None

    @precondition(lambda self: self.reprojects)
    @rule()
    def settle(self) -> None:
        for _ in range(60):
            frame = drawn(self.renderer, self.state)
        right = series(self.state, 60)[-1]
        apart = np.abs(frame.color - right)
        assert apart.max() <= 0.25 * max(1.0, right.max()) and np.sqrt(np.mean(apart**2)) <= 0.02, (
            f"{self.state}: {apart.max():.3g} after 60 frames, rms {np.sqrt(np.mean(apart**2)):.3g}"
        )

    @property
    def accumulates(self) -> bool:
        return SCENES[self.state.scene].quality.temporal == "accumulate"

    @property
    def reprojects(self) -> bool:
        return SCENES[self.state.scene].quality.temporal == "reproject"

    def check(self, frame: Frame, outputs: tuple[str, ...]) -> None:
        for name in outputs:
            if name != "color":
                same(frame.array(name), arrays(self.state)[name], f"{name} of {self.state}")
            elif not self.reprojects:
                self.at = self.find(frame.color, self.state)
            else:
                assert np.isfinite(frame.color).all()

    def find(self, color: np.ndarray, state: State) -> int:
        """The number of frames after which a new renderer shows this picture."""
        self.drawn += 1
        frames = 1 if SCENES[state.scene].quality.temporal == "off" else 3
        while True:
            found = series(state, frames)
            for number, right in enumerate(found, 1):
                if np.array_equal(color, right):
                    return number
            if frames > self.drawn + 3 or SCENES[state.scene].quality.temporal == "off":
                apart = min(float(np.abs(color - right).max()) for right in found)
                raise AssertionError(f"{state}: the colour differs by {apart:.3g} from each of {len(found)} frames")
            frames *= 3

    def teardown(self) -> None:
        self.renderer.close()
        self.thread.shutdown()


def same(found: np.ndarray, right: np.ndarray, what: str) -> None:
    equal = np.array_equal(found, right, equal_nan=found.dtype.kind == "f")
    assert equal, f"{what}: {np.mean(found != right):.1%} of the numbers differ"


def run(
    sequences: int, steps: int, names: tuple[str, ...] = tuple(SCENES), number: int = 1, shrink: bool = False
) -> None:
    """Raises AssertionError for a sequence with a wrong frame."""
    chosen = type("Chosen", (Frames,), {"names": names})
    phases = (Phase.generate, Phase.shrink) if shrink else (Phase.generate,)
    kept = settings(
        max_examples=sequences,
        stateful_step_count=steps,
        deadline=None,
        database=None,
        phases=phases,
        suppress_health_check=list(HealthCheck),
    )
    run_state_machine_as_test(seed(number)(chosen), settings=kept)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sequences", type=int, default=200)
    parser.add_argument("--steps", type=int, default=25)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scene", choices=list(SCENES), action="append")
    parser.add_argument("--shrink", action="store_true", help="make a sequence that fails shorter, which takes minutes")
    given = parser.parse_args(arguments)
    run(given.sequences, given.steps, tuple(given.scene or SCENES), given.seed, given.shrink)
    print(f"{given.sequences} sequences of up to {given.steps} steps, no wrong frame")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
