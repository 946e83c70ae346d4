"""Generated code of a shader that computes the values of a frame itself: camera, start of the march, hoisted values.

A renderer computes them in float64, once per frame, and passes them as uniforms. A standalone shader computes them in
float32, for each ray.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.function import Function
from raymarch.expr.glsl import TIME, constant, literal
from raymarch.expr.node import Operand, const, expr, var
from raymarch.expr.srgb import ENCODE
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import max, tan
from raymarch.plan import Plan
from raymarch.scene.camera import VIEW, corners_of, distance_to_see, framed_box, half_extent
from raymarch.scene.scene import HORIZON
from raymarch.shader.chunk import Chunk, Lines, Values

Array = NDArray[Any]

ASPECT = var("aspect", FLOAT)
"""Width over height of the picture."""

HOST = ("iResolution", "iTime", "iMouse", "iFrame", "iChannel0")
"""Names that Shadertoy defines."""

BY = "the camera"

FRAME = ("u_side", "u_start", "u_pixel", "u_far", "u_sample", "u_near", "u_clip_far", "u_lens")
"""Uniforms of a renderer that are variables of a standalone shader."""


class Setup:
    """The function `set_frame`, which sets the values of a frame.

    Parameters
    ----------
    values : gets the functions that compute the camera and the hoisted values.
    inputs : GLSL expressions of the host for the values that are uniforms otherwise, by the name of the uniform.
    """

    def __init__(self, plan: Plan, values: Values, inputs: Mapping[str, str]) -> None:
        self._plan, self._inputs = plan, inputs
        camera, where, origin = plan.given.camera, plan.given.camera.where, const(plan.origin)
        low, high = framed_box(plan.given.subject)
        target = const((low + high) / 2) if camera.target is None else camera.target

        def text(name: str, value: Operand) -> str:
            return values.text(f"camera_{name}", expr(value), where)

        self._size = "u_half_height" if camera.orthographic else "u_tan_half_fov"
        half = None if camera.height is None else camera.height * 0.5
        if not camera.orthographic:
            self._extent = text("tan_half_fov", tan(camera.fov * (np.pi / 360.0)))
        elif half is not None:
            self._extent = text("half_height", half)
        else:
            away = const(VIEW) if camera.position is None else camera.position - target
            half = half_extent(corners_of(low, high, target, away, camera.up), ASPECT)
            values.functions.append(Function("camera_half_height", (ASPECT,), half, where=where))
            self._extent = "camera_half_height(u_resolution.x / u_resolution.y)"
        self._clip: dict[str, str] = {}
        if camera.lens:
            focus = f"distance(u_camera_position, {text('target', target - origin)})"
            self._lens = (
                text("aperture", camera.aperture),
                focus if camera.focus is None else text("focus", camera.focus),
            )
        if camera.clips:
            self._clip["u_near"] = text("near", camera.near)
            self._clip["u_clip_far"] = "1.0e30" if camera.far is None else text("far", camera.far)
        self._target = text("target", target - origin)
        self._up = text("up", camera.up)
        if camera.position is not None:
            self._position = text("position", camera.position - origin)
        else:
            backward = constant(const(VIEW / np.linalg.norm(VIEW)))
            if half is None:
                corners = corners_of(low, high, target, VIEW, camera.up)
                distance = distance_to_see(corners, tan(camera.fov * (np.pi / 360.0)), ASPECT)
            else:
                distance = 2.0 * max(float(np.linalg.norm(high - low)), 2.0 * half)
            values.functions.append(Function("camera_distance", (ASPECT,), distance, where=where))
            self._position = f"{self._target} + {backward} * camera_distance(u_resolution.x / u_resolution.y)"
        self._hoisted = {
            name: values.text(name.replace(" ", "_"), value, where) for name, value in plan.hoisted.items()
        }
        unbounded = not plan.scene.node.facts.bounded and not plan.scene.node.facts.empty
        self._moved = [
            (text(f"moved_{i}", centre), diameter)
            for i, (centre, diameter) in enumerate(plan.scene.moved_parts if unbounded else ())
        ]
        values.functions += [plan.given.tone.function, ENCODE]

    def promised(self) -> dict[str, Callable[[], Chunk]]:
        """The names of the functions and those that they need, before it is known which uniforms the shader has."""
        field = "ray_field" if "ANALYTIC" in self._plan.variants else "field"
        needs = {field, "place_camera", self._size, "u_pixel", "u_far", *self._clip}
        needs |= {"u_lens"} if "LENS" in self._plan.variants else set()
        needs |= set() if "OWN_START" in self._plan.variants else {"u_side"}
        return {
            "set_frame": lambda: Chunk("set_frame", frozenset(needs), frozenset({"set_frame"}), ()),
            "begin_sample": lambda: Chunk("begin_sample", frozenset(), frozenset({"begin_sample"}), ()),
            **{name: partial(Chunk, "Shadertoy", frozenset(), frozenset(HOST), ()) for name in HOST},
        }

    def chunks(
        self, parameters: Mapping[str, str], uses_time: bool, given: frozenset[str]
    ) -> dict[str, Callable[[], Chunk]]:
        """The functions `set_frame` and `begin_sample`.

        parameters : GLSL names of the parameters, by name. given : all names that the shader defines.
        """

        def begin_sample() -> Chunk:
            text = Lines(BY)
            text.add("void begin_sample(int index) {")
            if "u_sample" in given:
                text.add("    u_sample = index;")
            text.add("}")
            return text.chunk("begin_sample")

        return {"set_frame": partial(self._frame, parameters, uses_time, given), "begin_sample": begin_sample}

    def _frame(self, parameters: Mapping[str, str], uses_time: bool, given: frozenset[str]) -> Chunk:
        text = Lines(BY)
        text.add("// Sets the values of the frame.")
        text.add("void set_frame() {")
        for name, value in self._inputs.items():
            if name != TIME or uses_time:
                text.add(f"    {name} = {value};")
        for name, value in self._hoisted.items():
            if name in parameters:
                text.add(f"    {parameters[name]} = {value};")
        by_page = any(chosen.name == "samples" for chosen in self._plan.passes)  # the page counts its samples
        if "u_sample" in given and "begin_sample" not in given and not by_page:
            text.add("    u_sample = 0;")
        text.add(f"    {self._size} = {self._extent};")
        text.add(f"    place_camera({self._position}, {self._target}, {self._up});")
        text.add(f"    u_pixel = 2.0 * {self._size} / u_resolution.y;")
        text.add(f"    u_far = {self._far()};")
        for centre, diameter in self._moved:
            text.add(f"    u_far = max(u_far, distance(u_camera_position, {centre}) + {literal(diameter)});")
        if self._plan.given.camera.lens:
            aperture, focus = self._lens
            text.add(f"    u_lens = vec2({aperture}, {focus});")
            text.add("    u_far += u_lens.x;")
            for i, chosen in enumerate(self._plan.passes):
                if chosen.sharp:  # as `raymarch.gpu.draw_calls.CENTRE`
                    text.add(f"    if (PASS == {i}) u_lens = vec2(0.0, 1.0);")
        for name, value in self._clip.items():
            text.add(f"    {name} = {value};")
        if "OWN_START" not in self._plan.variants:
            call = "ray_field({}, true)" if "ANALYTIC" in self._plan.variants else "field({})"
            text.add(f"    float at_camera = {call.format('u_camera_position')};")
            text.add("    u_side = at_camera < 0.0 ? -1.0 : 1.0;")
        if "u_start" in given:
            text.add("    vec3 size = abs(u_camera_position);")
            text.add("    float empty = abs(at_camera) * 0.999999 - 1.0e-6 * max(size.x, max(size.y, size.z));")
            text.add("    u_start = vec4(0.0, 0.0, 0.0, empty < 1.0e30 ? max(empty, 0.0) : 0.0);")
        text.add("}")
        made = text.chunk("set_frame")
        own = {*self._inputs.values(), *parameters.values(), TIME, "PASS", *HOST}
        return replace(made, needs=made.needs - own)

    def _far(self) -> str:
        """The greatest distance of rays, as `Scene.far` defines it."""
        scene = self._plan.scene
        facts = scene.node.facts
        if facts.empty:
            return "0.0"
        if facts.bounded:
            lower, upper = constant(const(facts.lower)), constant(const(facts.upper))
            return f"length(max(abs({lower} - u_camera_position), abs({upper} - u_camera_position)))"
        subject = scene.subject
        scale = 1.0 if subject is None else float(np.linalg.norm(subject.size))
        middle = np.zeros(3) if subject is None else (subject.lower + subject.upper) / 2
        return f"{literal(HORIZON)} * ({literal(scale)} + distance(u_camera_position, {constant(const(middle))}))"
