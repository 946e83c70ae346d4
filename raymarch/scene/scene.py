"""A scene: a solid with camera, lights, sky and settings."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raymarch.conveniences import carried_out_by
from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.convert import belongs, described, instance, integer, optional, short
from raymarch.expr.node import Expr, const
from raymarch.expr.walk import find
from raymarch.scene.ambient_occlusion import AmbientOcclusion
from raymarch.scene.camera import Camera, Pose, framed_box
from raymarch.scene.fields import GREY
from raymarch.scene.fog import Atmosphere
from raymarch.scene.framing import WIDE, Framed, frame_of, is_hollow
from raymarch.scene.light import Light, sample_of
from raymarch.scene.light_kinds import KINDS, Sun
from raymarch.scene.material import Material
from raymarch.scene.parameter import ParamValue, Spec, Values, specs_in
from raymarch.scene.post import PostEffect
from raymarch.scene.quality import Quality
from raymarch.scene.sky import Sky
from raymarch.scene.tone import ToneMapping
from raymarch.scene.value import Value, value
from raymarch.sdf.definition import PLACED
from raymarch.sdf.domain import ColorLike
from raymarch.sdf.facts import Facts, around
from raymarch.sdf.labels import rows_of, seen_labels
from raymarch.sdf.node import Node
from raymarch.sdf.node import all_nodes as all_nodes
from raymarch.sdf.placement import offset_of
from raymarch.sdf.same import remembered

if TYPE_CHECKING:
    from PIL.Image import Image

HORIZON = 1e4
"""Rays in an unbounded scene are traced to this many times its scale. The horizon is then cut far below a pixel."""


DEFAULT, PHYSICAL_DEFAULT = Material(), Material(albedo=GREY)
"""Materials of nodes without a material. The second is used if all given materials are physical."""


DEEPEST = {"path": 16, "whitted": 4}
"""Maximum number of bounces of each integrator."""


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")


@value
class Scene(Value):
    """A solid with camera, lights, sky, fog and quality. Immutable; `scene.replace(...)` gives a changed copy.

    Parameters
    ----------
    node : the solid, a 3D node.
    camera : Camera. None is a camera that sees the whole scene.
    lights : sequence of Sun, PointLight, SpotLight, SphereLight and RectLight, or of a kind of your own, see
        docs/extending.md. None is one sun without shadow; [] is no light.
    sky : Sky, or a colour (linear RGB). None is a uniform blue.
    fog : Fog or Medium, or None.
    quality : Quality. None is the default quality.
    occlusion : AmbientOcclusion of ambient light, or None.
    tone : ToneMapping from linear light to a picture. None clips values above 1.
    bounces : maximum number of indirect bounces, for reflections, light between surfaces and from the sky, and glass.

        - With `Quality(integrator="path")`, the default, 0 to 16. One random path is traced per sample, so the
          picture needs `Quality(samples=...)` or several frames. Reflections of lights onto diffuse surfaces are
          blurred to avoid fireflies.
        - With `Quality(integrator="whitted")`, 0 to 4. All rays reflected and refracted by mirrors and glass are
          traced, without random choices.

        None is 6 if a material transmits, else 0. With "whitted" it is 4 if a material transmits or mirrors. The
        reference `rm.truth` has the Whitted integrator, but no path tracing.
    post : post effects in order. They change the finished picture in linear light, before tone mapping.

    Raises
    ------
    SceneError : an argument of another type or outside its range.

    Examples
    --------
    >>> scene = rm.Scene(rm.sphere() | rm.plane(offset=-1), lights=[rm.Sun(shadow=True)])
    >>> scene.replace(lights=[]).lights
    ()
    """

    BELONGS: ClassVar[str] = "rm.render(...)"
    node: Node
    camera: Camera
    lights: tuple[Light, ...]
    sky: Sky
    fog: Atmosphere | None
    quality: Quality
    occlusion: AmbientOcclusion | None
    bounces: int
    post: tuple[PostEffect, ...]
    tone: ToneMapping = field(metadata={"planned": False})  # applied to the finished frame
    of_a_node: bool = field(metadata={"planned": False})  # the user gave a bare node

    def __init__(
        self,
        node: Node,
        camera: Camera | None = None,
        lights: Iterable[Light] | None = None,
        sky: Sky | ColorLike | None = None,
        fog: Atmosphere | None = None,
        quality: Quality | None = None,
        occlusion: AmbientOcclusion | None = None,
        tone: ToneMapping | None = None,
        bounces: int | None = None,
        post: Iterable[PostEffect] = (),
    ) -> None:
        several_nodes = isinstance(node, list | tuple) and node and all(isinstance(part, Node) for part in node)
        solid = instance("Scene: node", node, Node, "rm.union(*nodes)" if several_nodes else "a node such as sphere()")
        if solid.dimension != 3:
            legal = "a solid; extrude or revolve it first"
            raise SceneError(f"Scene: {solid.name} is flat", legal=legal, where=solid.where)
        *names, last = (f"{kind.__name__}(...)" for kind in KINDS)
        kinds = f"{', '.join(names)} or {last}"
        given: tuple[Light, ...] = _several("lights", [Sun()] if lights is None else lights, Light, kinds, "[Sun()]")
        effects: tuple[PostEffect, ...] = _several("post", post, PostEffect, "Bloom(...)", "[Bloom()]")
        for light in given:
            if type(light) not in KINDS:
                sample_of(light)
        for part in all_nodes(solid):
            rows = rows_of(part)
            for label in (part.label,) if rows is None else rows.labels:
                if not isinstance(label, Material | None):
                    raise SceneError(f"Scene: material = {described(label)}", legal="Material(...)", where=part.where)
        curves = "ToneMapping(...), such as ToneMapping('aces')"
        presets = "Quality(...), such as Quality.preset('fine')"
        shading = "AmbientOcclusion(...) or None"
        chosen = Quality() if quality is None else instance("Scene: quality", quality, Quality, presets)
        count = optional(integer, "Scene: bounces", bounces, 0, DEEPEST["path"], "an integer from 0 to 16, or None")
        deepest = DEEPEST[chosen.integrator]
        if count is not None and count > deepest:
            what = f"Scene: bounces = {count} with Quality(integrator='whitted'): {2 ** (count + 1) - 1} rays a pixel"
            raise SceneError(what, legal=f"up to {deepest}, or Quality(integrator='path')")
        if count is None:
            mirrors = chosen.integrator == "whitted"
            called_for = any(m.transmits or (mirrors and m.mirrors) for m in _labels(solid))
            count = min(6, deepest) if called_for else 0
        self._set(
            node=solid,
            camera=Camera() if camera is None else instance("Scene: camera", camera, Camera, "Camera(...)"),
            lights=given,
            sky=sky if isinstance(sky, Sky) else Sky() if sky is None else Sky(sky),
            fog=optional(instance, "Scene: fog", fog, Atmosphere, "one Fog(...), one Medium(...) or None"),
            quality=chosen,
            occlusion=optional(instance, "Scene: occlusion", occlusion, AmbientOcclusion, shading),
            tone=ToneMapping() if tone is None else instance("Scene: tone", tone, ToneMapping, curves),
            bounces=count,
            post=effects,
            of_a_node=False,
        )
        if self.fog is not None:
            self.fog.check(len(given))

    def _repr_png_(self) -> bytes:
        """The picture of the scene, for notebooks; drawn by `raymarch.export`, a layer above this package."""
        drawn: bytes = carried_out_by("png")(self)
        return drawn

    @property
    def planned(self) -> tuple[Any, ...]:
        """The key of a plan: all fields except those marked `planned=False`, and the user's line for messages."""
        return (*self.planned_without(), self.where)

    def planned_without(self, *left_out: str) -> tuple[Any, ...]:
        """The fields that a plan depends on, except some: the same for all versions of a scene that differ in these."""
        read = [part.name for part in fields(self) if part.metadata.get("planned", True)]
        return tuple(getattr(self, name) for name in read if name not in left_out)

    @property
    def materials(self) -> tuple[Material, ...]:
        """Every visible material. Index 0 is the default, for nodes without a material."""
        return _materials(self.node)

    @property
    def path_traced(self) -> bool:
        """True if the scene is path traced."""
        return self.bounces > 0 and self.quality.integrator == "path"

    @property
    def whitted(self) -> bool:
        """True if Whitted ray tracing applies: the integrator is set, and a material mirrors or transmits."""
        smooth = any(m.transmits or m.mirrors for m in _labels(self.node))
        return self.bounces > 0 and self.quality.integrator == "whitted" and smooth

    @property
    def bouncing(self) -> bool:
        """True if rays bounce: by paths, or by Whitted ray tracing."""
        return self.path_traced or self.whitted

    @property
    def motion_blur(self) -> bool:
        """True if the scene reads time, and the camera's shutter is open for some of it."""
        return self.camera.opens and bool(find(self.expressions(), "time"))

    @property
    def parameters(self) -> dict[str, Spec]:
        """All parameters of the scene, by name."""
        return specs_in(self.expressions())

    def show(
        self, size: tuple[int, int] = (640, 360), time: float = 0.0, params: Mapping[str, ParamValue] | None = None
    ) -> Image:
        """Render the scene and show the picture: in a notebook as the value of a cell, else in the system's viewer.

        Parameters and errors are those of `raymarch.render`.

        Returns
        -------
        Image
            The picture.

        Raises
        ------
        SceneError : there is no display.

        Notes
        -----
        For a window that you can move in, use the command `raymarch view`.
        """
        inline = in_notebook()
        if not inline and sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & {*os.environ}:
            raise SceneError("show: this machine has no display", legal='rm.render(scene).save("picture.png")')
        picture: Image = carried_out_by("render")(self, size, time, params)
        if not inline:
            picture.show()
        return picture

    def expressions(self, camera: bool = True) -> list[Expr]:
        """Every expression in the scene that may read parameters or time. camera : False leaves out the camera's."""
        found = list(_expressions_of(self.node))
        for part in (
            *([self.camera] if camera else []),
            *self.lights,
            *self.materials,
            self.sky,
            *(x for x in (self.fog, self.occlusion) if x),
            *self.post,
        ):
            found += part.expressions
        return found

    @property
    def subject(self) -> Facts | None:
        """The box around all bounded parts."""
        return _bounded_part(self.node)

    @property
    def framed(self) -> Framed | None:
        """What a camera without a position frames, or one without a target looks at; None for any other camera."""
        camera = self.camera
        needed = camera.position is None or camera.target is None or (camera.orthographic and camera.height is None)
        if not needed:
            return None
        found, box = _framed(self.node), None if self.fog is None else self.fog.box
        return found if box is None else found.beside(np.array(box), alone=self.subject is None)

    @property
    def middle(self) -> tuple[NDArray[np.float64], float]:
        """The centre of the `subject` and the length of its diagonal; the origin and 1 without a bounded part."""
        box = self.subject
        return (np.zeros(3), 1.0) if box is None else ((box.lower + box.upper) / 2, float(np.linalg.norm(box.size)))

    @property
    def path_extent(self) -> float:
        """Twice the diagonal of the `subject`, in the measure of `far`: the length that sets the precision of paths."""
        if self.subject is None:
            return 1e30
        return 2.0 * self.middle[1] * (1.0 if self.node.facts.bounded else HORIZON)

    @property
    def ambient_occlusion(self) -> AmbientOcclusion | None:
        """The `occlusion`, with the reach that follows from the size of the scene if none is given."""
        if self.occlusion is None:
            return None
        low, high = framed_box(self.subject)
        size, framed = float(np.linalg.norm(high - low)), self.framed
        if framed is not None and framed.centre is not None and WIDE * framed.diameter < size:
            size = framed.diameter  # of what is seen: the box holds all places and sizes that Params allow
        return self.occlusion.within(size)

    def pose(self, values: Values, aspect: float = 1.0) -> Pose:
        """The camera of one frame; `aspect` is width over height of the picture."""
        return self.camera.pose(values, self.framed, aspect)

    def target(self, values: Values) -> NDArray[np.float64]:
        """The point at which the camera of a frame looks."""
        framed = self.framed
        if self.camera.target is not None:
            return values.of(self.camera.target)
        return np.zeros(3) if framed is None else framed.middle

    def far(self, pose: Pose, values: Values | None = None) -> float:
        """Maximum distance of rays: beyond the scene's box, or `HORIZON` times the scale of an unbounded scene.

        values : of a frame. Rays then reach bounded solids that time, or a Param without a range, translates.
        """
        facts = self.node.facts
        if facts.empty:
            return 0.0
        if facts.bounded:
            corners = np.maximum(np.abs(facts.lower - pose.position), np.abs(facts.upper - pose.position))
            return float(np.linalg.norm(corners)) + pose.aperture
        middle, scale = self.middle
        far = HORIZON * (scale + float(np.linalg.norm(pose.position - middle)))
        if values is None:
            return far
        for centre, diameter in self.moved_parts:
            with bound(values.params, values.time):
                (moved,) = evaluator([centre], ())()
            far = max(far, float(np.linalg.norm(np.ravel(moved) - pose.position)) + diameter)
        return far

    @property
    def moved_parts(self) -> list[tuple[Expr, float]]:
        """Centre and diameter of the boxes of bounded solids that time, or a Param without a range, translates."""
        return [
            (offset + 0.5 * (box.lower + box.upper), float(np.linalg.norm(box.size)))
            for box, offset in _moved_parts(self.node)
        ]


@remembered
def _expressions_of(root: Node) -> list[Expr]:
    """The expressions of a solid, each once."""
    found: dict[Expr, None] = {}
    for node in all_nodes(root):
        found.update((v, None) for v in node.params.values() if isinstance(v, Expr) and not v.is_constant)
        if node.definition.arity != "many":  # the body of a user's definition may read parameters itself
            found[node.definition.template(len(node.children), node.params).body] = None
    return list(found)


@remembered
def _labels(root: Node) -> list[Any]:
    """The visible labels of a solid, each once."""
    seen = seen_labels(root)
    given: dict[Any, None] = {}
    for node in all_nodes(root):
        given[node.label] = None
        if (rows := rows_of(node)) is not None:
            given.update(dict.fromkeys(rows.labels))
    return [label for label in given if label in seen]


@remembered
def _materials(root: Node) -> tuple[Material, ...]:
    given = _labels(root)
    default = PHYSICAL_DEFAULT if given and all(m.physical for m in given) else DEFAULT
    return (default, *(m for m in given if m != default))


def scene_of(node: Node) -> Scene:
    """A default scene of a node, with the user's line of the node."""
    made = Scene(node)
    made._set(where=node.where, of_a_node=True)
    return made


def check_scene(what: str, given: object) -> None:
    """SceneError unless `given` is a Scene. `what` names the operation, such as "truth"."""
    if not isinstance(given, Scene):
        raise SceneError(f"{what} of {described(given)}", legal="a Scene")


def as_scene(what: str, given: object) -> Scene:
    """A Scene, or the default scene of a solid; SceneError for anything else. `what` names the operation."""
    if isinstance(given, Node):
        return scene_of(given)
    if not isinstance(given, Scene):
        raise SceneError(f"{what} of {described(given)}", legal="a Scene or a solid")
    return given


def _several(name: str, values: Any, kind: Any, legal: str, example: str) -> tuple[Any, ...]:
    """The elements of an argument, checked."""
    if not isinstance(values, Iterable) or isinstance(values, Expr | np.generic | np.ndarray):
        one = f"{type(values).__name__}(...)" if isinstance(values, kind) else f"{short(values)}{belongs(values)}"
        raise SceneError(f"Scene: {name} = {one}", legal=f"a list of them, such as {example}")
    return tuple(instance(f"Scene: {name}", value, kind, legal) for value in values)


def _operands(root: Node) -> Iterator[Node]:
    """The largest parts of a solid that are bounded or no union, each once."""
    pending, seen = [root], {id(root)}
    while pending:
        node = pending.pop()
        together = node.definition.associative or node.placed_as == "blend" or node.label is not None
        if node.facts.bounded or not together or not node.children:
            yield node
            continue
        for child in node.children:
            if id(child) not in seen:
                seen.add(id(child))
                pending.append(child)


@remembered
def _moved_parts(root: Node) -> list[tuple[Facts, Expr]]:
    """Bounded solids whose translation has no bounds, so that they have none: their box and their offset."""
    found = []
    for node in _operands(root):
        inner, offset = node, const(np.zeros(3))
        while not inner.facts.bounded and (moved := offset_of(inner)) is not None:
            inner, offset = inner.children[0], offset + moved
        if inner is not node and inner.facts.bounded and not inner.facts.empty:
            found.append((inner.facts, offset))
    return found


@remembered
def _framed(root: Node) -> Framed:
    return frame_of(root, [node for node in _operands(root) if node.facts.bounded and not node.facts.empty])


def is_cut_away(root: Node) -> bool:
    """True if samples of all bounded parts find no surface: differences and intersections left nothing of them."""
    parts = [node for node in _operands(root) if node.facts.bounded and not node.facts.empty]
    return bool(parts) and all(is_hollow(node) for node in parts)


def _bounded(root: Node) -> Iterator[Node]:
    """The largest bounded parts that hold something, also of a union with an unbounded part that was moved as a whole:
    each is then moved alone. What moves without bounds is none."""
    for node in _operands(root):
        if node.facts.bounded:
            if not node.facts.empty:
                yield node
        elif node.placed_as in PLACED and len(node.children) == 1:
            moved = (Node(node.definition, (part,), node.params) for part in _bounded(node.children[0]))
            yield from (part for part in moved if part.facts.bounded)


@remembered
def _bounded_part(root: Node) -> Facts | None:
    """The box around the largest bounded parts; None if there are none."""
    boxes = [node.facts for node in _bounded(root)]
    return around(boxes) if boxes else None
