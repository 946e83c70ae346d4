"""What the window shows: scene, edits, parameters, camera, time, view. Independent of glfw and OpenGL."""

from __future__ import annotations

import linecache
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from raymarch.errors import RaymarchError, SceneError
from raymarch.expr.convert import choice, real
from raymarch.expr.node import Expr
from raymarch.expr.srgb import linear_to_srgb
from raymarch.expr.walk import find, free_variables
from raymarch.gpu.views import VIEWS
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import LEAST_LENGTH, MOST_LENGTH, Spec, Value, Values, set_values
from raymarch.scene.scene import Scene
from raymarch.window import control
from raymarch.window.control import View
from raymarch.window.edits import Edits, editable_material, material_name
from raymarch.window.news import near
from raymarch.window.rebase import rebased
from raymarch.window.shot import Shot, progressive
from raymarch.window.timeline import Timeline

SAVED_SETTINGS = "a file that the window saved"


@dataclass(slots=True)
class State:
    """The scene and everything that the user can change without editing its file.

    file, base : the scene file and its scene. edits : changes of it. scene : the result, which is visible.
    progressive : the scene as the window draws it; see `shot.progressive`.
    specs : its parameters, in the order of the file; those of edited lights and materials follow.
    params : values that differ from the defaults. absent : those of parameters that the file no longer has.
    camera : the user's view.
    moved : whether the user moved the camera; until then it follows the scene's camera.
    timeline : the clock of the scene.
    animated : whether the scene depends on time.
    view : the visible array, one of `raymarch.gpu.views.VIEWS`.
    aspect : width over height of the picture.
    """

    file: Path
    base: Scene
    scene: Scene
    progressive: Scene
    specs: dict[str, Spec]
    params: dict[str, Value]
    camera: View
    timeline: Timeline
    animated: bool
    moved: bool = False
    view: str = "final"
    aspect: float = 1.0
    selected: str | None = None
    edits: Edits = field(default_factory=Edits)
    absent: dict[str, Value] = field(default_factory=dict)

    @property
    def values(self) -> Values:
        """Parameters and time for the renderer."""
        return set_values(self.specs, self.params, self.timeline.time, self.scene.where)

    def pose(self) -> Pose:
        if not self.moved and _moves(self.scene):
            return self.scene.pose(self.values, self.aspect)
        return self._optics(self.camera).pose()

    def _optics(self, camera: View) -> View:
        """A view with the clip planes that the scene has now."""
        return replace(camera, **self.scene.camera.optics(self.values, camera.distance))

    def shot(self) -> Shot:
        """The shot to draw now."""
        time = self.timeline.time if self.animated else 0.0
        samples = self.scene.quality.samples
        return Shot(self.progressive, time, dict(self.params), self.pose(), self.view, samples)

    def with_scene(self, base: Scene, edits: Edits) -> tuple[State, list[str]]:
        """The state with another scene or other edits, and one sentence for each value that had to change.

        Parameters keep their values, clamped to a new range if necessary; also while the file lacks them. A camera that
        the user moved stays; otherwise it follows the camera of the new scene. A value that the file changed is the
        file's, see `rebased`. Raises the errors of the edited scene.
        """
        given, newer = {**self.absent, **self.params}, list[str]()
        if base is not self.base:
            kept = rebased(edits, given, self.base, base)
            edits, given, newer = kept.edits, kept.params, kept.words
        scene = edits.apply(base)
        specs = parameters_in_order(base, scene, self.file)
        made = replace(self, base=base, edits=edits, scene=scene, progressive=progressive(scene), specs=specs)
        own = {**self.absent, **self.base.parameters}
        absent = {name: value for name, value in given.items() if name not in specs and name in own}
        made.animated, made.params, made.absent = _animated(scene), {}, absent
        changes = newer
        for name, value in given.items():
            fitting = _fitted(specs[name], value) if name in specs else None
            if fitting is not None:
                if fitting != value:
                    changes.append(f"{name} = {shown(value)} lies outside its new range; it is {shown(fitting)} now")
                made.params[name] = fitting
        if made.selected not in specs:
            made.selected = None
        projected = scene.camera.orthographic != (made.camera.height is not None)
        if made.moved and scene.camera != self.scene.camera:
            changes.append("the camera is the file's, which is newer")
            projected = True
        placed = scene.camera.position is not None or scene.camera.view_from is not None
        if projected or (not made.moved and placed):
            made.camera, made.moved = home(scene, made.values, made.aspect), False
        return made, changes

    def move(self, camera: View) -> None:
        """Set the camera on behalf of the user."""
        self.camera, self.moved = camera, True

    def hold(self) -> View:
        """The view to start a movement from: the current pose, also of an animated camera."""
        if not self.moved and _moves(self.scene):
            self.camera = home(self.scene, self.values, self.aspect)
        return self._optics(self.camera)

    def reset(self) -> None:
        self.camera, self.moved = home(self.scene, self.values, self.aspect), False

    def set(self, name: str, value: Any) -> None:
        """Set a parameter, clamped to its range. SceneError for an unknown name or a wrong type."""
        if name not in self.specs:
            raise SceneError(f"unknown parameter '{name}'", legal=", ".join(sorted(self.specs)) or "none in this scene")
        spec = self.specs[name]
        fitting = _fitted(spec, value)
        if fitting is None:
            raise SceneError(f"parameter '{name}' = {value!r}", legal=spec.legal)
        self.params[name] = fitting

    def changed(self, name: str) -> bool:
        """True if the value of a parameter is not that of the file."""
        return name in self.params and self.params[name] != self.specs[name].value

    def value(self, name: str) -> Value:
        """The current value of a parameter."""
        return self.params.get(name, self.specs[name].value)

    def material_color(self, index: int) -> tuple[float, ...] | None:
        """The linear colour of a material of the file, as it is edited; None if it varies from point to point."""
        material = self.base.materials[index]
        name = "albedo" if material.physical else "color"
        edited = self.edits.materials.get(index)
        parameter = material_name(index, name)
        if edited is not None and parameter in self.specs:
            color: Any = self.value(parameter)
        else:
            color = (edited or editable_material(material)).get(name)
        if isinstance(color, Expr) and not free_variables([color]):
            color = tuple(float(v) for v in np.ravel(self.values.of(color)))
        return color if isinstance(color, tuple) and len(color) == 3 else None

    def named_material(self, index: int) -> tuple[str, tuple[int, int, int] | None]:
        """The name of a material, and its colour in sRGB, None if it varies.

        The name is that of the variable that the file assigns it to, and the line; its index if there is none.
        """
        if not 0 <= index < len(self.base.materials):
            return "", None
        where, name = self.base.materials[index].where, str(index) if index else "default"
        if where is not None and index:
            assigned = re.match(
                r"\s*(\w+)\s*(?::[^=]*)?=(?!=).*\bMaterial\b", linecache.getline(where.file, where.line)
            )
            name = f"{assigned[1] if assigned else index}, {near(where.file)}:{where.line}"
        color = self.material_color(index)
        if color is None:
            return name, None
        red, green, blue = (round(255 * float(v)) for v in linear_to_srgb(np.clip(color, 0.0, 1.0)))
        return name, (red, green, blue)

    def settings(self) -> dict[str, Any]:
        """Everything that the user can change, as JSON types; see `restore`."""
        camera = self.camera
        return {
            "camera": {
                "position": camera.position.tolist(),
                "target": camera.target.tolist(),
                "up": camera.up.tolist(),
                "fov": camera.fov,
                "height": camera.height,
                "line": control.as_python(camera),
            },
            "params": dict(self.params),
            "time": self.timeline.time,
            "view": self.view,
        }

    def restore(self, settings: Mapping[str, Any]) -> None:
        """Apply a result of `settings`. SceneError if it is not one."""
        try:
            camera = settings["camera"]
            position, target, up = (
                np.array([real(f"camera: {name}", v, -MOST_LENGTH, MOST_LENGTH) for v in camera[name]])
                for name in ("position", "target", "up")
            )
            if any(v.shape != (3,) for v in (position, target, up)) or not np.any(np.cross(target - position, up)):
                raise ValueError("camera")
            fov = real("camera: fov", camera["fov"], 0.01, 179.0)
            reach = float(np.linalg.norm(target - position))
            height = self.camera.height
            if height is not None and camera.get("height") is not None:
                height = real("camera: height", camera["height"], LEAST_LENGTH, MOST_LENGTH)
            self.move(View(position, target, up, fov, reach, height))
            for name, value in settings["params"].items():
                self.set(name, tuple(value) if isinstance(value, list) else value)
            self.timeline = self.timeline.scrub(real("time", settings["time"]))
            self.view = choice("view", settings["view"], tuple(VIEWS))
        except (KeyError, TypeError, ValueError, AttributeError) as fault:
            raise SceneError(
                f"these settings cannot be used: {type(fault).__name__}: {fault}", legal=SAVED_SETTINGS
            ) from None


def opened(file: Path, base: Scene, params: Mapping[str, Any], aspect: float, edits: Edits | None = None) -> State:
    """The initial state of a scene, with edits.

    SceneError for a parameter that is unknown or out of range.
    """
    edits = edits or Edits()
    scene = base if edits.empty else edits.apply(base)
    specs = parameters_in_order(scene, scene, file)
    given = set_values(specs, params, 0.0, scene.where)
    return State(
        file,
        base,
        scene,
        progressive(scene),
        specs,
        params={name: given.params[name] for name in params},
        camera=home(scene, given, aspect),
        timeline=Timeline(),
        animated=_animated(scene),
        aspect=aspect,
        edits=edits,
    )


def parameters_in_order(base: Scene, scene: Scene, file: Path) -> dict[str, Spec]:
    """The parameters of a scene in the order of the lines of its file, then those of other files, then those that edits
    of the scene `base` add."""
    own, main = base.parameters, file.absolute()

    def place(spec: Spec) -> tuple[int, str, int]:
        where = spec.where
        if spec.name not in own or where is None:
            return 2, "", 0
        return int(Path(where.file).absolute() != main), where.file, where.line

    return {spec.name: spec for spec in sorted(scene.parameters.values(), key=place)}


def home(scene: Scene, values: Values, aspect: float) -> View:
    """The view of the scene's camera."""
    return control.view_of(scene.pose(values, aspect), scene.target(values), values.of(scene.camera.up))


def shown(value: Value) -> str:
    """A parameter's value as text."""
    return f"({', '.join(f'{v:.4g}' for v in value)})" if isinstance(value, tuple) else f"{value:.4g}"


def _fitted(spec: Spec, value: Any) -> Value | None:
    """A value clamped to the range of a parameter; None if it has another type."""
    try:
        given = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    if given.shape != np.shape(spec.value) or not np.all(np.isfinite(given)):
        return None
    inside = np.clip(given, *spec.ends)
    try:
        return spec.accept(float(inside) if inside.shape == () else tuple(float(v) for v in inside))
    except RaymarchError:
        return None


def _animated(scene: Scene) -> bool:
    return bool(find(scene.expressions(), "time"))


def _moves(scene: Scene) -> bool:
    """Whether the scene's camera depends on time or parameters."""
    return any(not e.is_constant for e in scene.camera.expressions)
