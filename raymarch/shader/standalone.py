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
from raymarch.expr.glsl import TIME
from raymarch.expr.node import Operand, const, expr, var
from raymarch.expr.pieces import constant, literal
from raymarch.expr.srgb import ENCODE
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import max, normalize, tan
from raymarch.plan import Plan
from raymarch.scene.camera import distance_to_see, half_extent, outermost, seen_at
from raymarch.scene.framing import CUBE, VIEW, Framed
from raymarch.scene.scene import HORIZON
from raymarch.shader.chunk import Chunk, Lines, Mapped, Values

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
        framed = plan.given.framed or Framed(CUBE)
        target = const(framed.middle) if camera.target is None else camera.target
        points = [const(point) - target for point in framed.points]
        place_of = framed.position if camera.automatic else None
        view = const(VIEW) if camera.view_from is None else camera.view_from

        def text(name: str, value: Operand) -> str:
            return values.text(f"camera_{name}", expr(value), where)

        self._size = "u_half_height" if camera.orthographic else "u_tan_half_fov"
        half = None if camera.height is None else camera.height * 0.5
        if not camera.orthographic:
            extent = text("tan_half_fov", tan(camera.fov * (np.pi / 360.0)))
        elif half is not None:
            extent = text("half_height", half)
        else:
            away = view if camera.position is None else camera.position - target
            half = half_extent(outermost(seen_at(points, away, camera.up)), ASPECT)
            values.functions.append(Function("camera_half_height", (ASPECT,), half, where=where))
            extent = "camera_half_height(u_resolution.x / u_resolution.y)"
        self._clip: dict[str, str] = {}
        aperture = focus = ""
        if camera.lens:
            focus = f"distance(u_camera_position, {text('target', target - origin)})"
            aperture = text("aperture", camera.aperture)
            focus = focus if camera.focus is None else text("focus", camera.focus)
        if camera.clips:
            self._clip["u_near"] = text("near", camera.near)
            self._clip["u_clip_far"] = "1.0e30" if camera.far is None else text("far", camera.far)
        place = text("target", target - origin)
        up = text("up", camera.up)
        if camera.position is not None or place_of is not None:
            at = const(place_of) if camera.position is None else camera.position
            position = text("position", at - origin)
        else:
            if view.is_constant:
                backward = constant(const(view.data / np.linalg.norm(view.data)))
            else:
                backward = text("backward", normalize(view))
            if half is None:
                seen = outermost(seen_at(points, view, camera.up))
                distance = distance_to_see(seen, tan(camera.fov * (np.pi / 360.0)), ASPECT)
            else:
                distance = 2.0 * max(framed.diameter, 2.0 * half)
            values.functions.append(Function("camera_distance", (ASPECT,), distance, where=where))
            position = f"{place} + {backward} * camera_distance(u_resolution.x / u_resolution.y)"
        self._camera = {"size": self._size, "extent": extent, "position": position, "target": place, "up": up}
        self._camera |= {"aperture": aperture, "focus": focus}
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
        begin = ["void begin_sample(int index) {", *["    u_sample = index;"] * ("u_sample" in given), "}"]
        return {
            "set_frame": partial(self._frame, parameters, uses_time, given),
            "begin_sample": lambda: Chunk.of("begin_sample", [Mapped(line, BY) for line in begin]),
        }

    def _frame(self, parameters: Mapping[str, str], uses_time: bool, given: frozenset[str]) -> Chunk:
        plan, text = self._plan, Lines(BY)
        by_page = any(chosen.name == "samples" for chosen in plan.passes)  # the page counts its samples
        first = "u_sample" in given and "begin_sample" not in given and not by_page
        values = {name: value for name, value in self._inputs.items() if name != TIME or uses_time}
        values |= {parameters[name]: value for name, value in self._hoisted.items() if name in parameters}
        sharp = [i for i, chosen in enumerate(plan.passes) if chosen.sharp]  # as `raymarch.gpu.draw_calls.CENTRE`
        far = "    u_far = max(u_far, distance(u_camera_position, {}) + {});"
        text.template(
            "set_frame",
            {
                **{name: name in plan.variants for name in ("LENS", "OWN_START", "ANALYTIC")},
                "START": "u_start" in given,
            },
            given=_assigned(values | ({"u_sample": "0"} if first else {})),
            **self._camera,
            far=self._far(),
            moved="\n".join(far.format(centre, literal(diameter)) for centre, diameter in self._moved),
            sharp="\n".join(f"    if (PASS == {i}) u_lens = vec2(0.0, 1.0);" for i in sharp),
            clip=_assigned(self._clip),
        )
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
        middle, scale = scene.middle
        return f"{literal(HORIZON)} * ({literal(scale)} + distance(u_camera_position, {constant(const(middle))}))"


def _assigned(values: Mapping[str, str]) -> str:
    """The lines that assign texts to variables."""
    return "\n".join(f"    {name} = {value};" for name, value in values.items())
