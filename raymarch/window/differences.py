"""The values of the window that differ from the scene file."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.scene.value import parameters_of
from raymarch.window.edits import editable_lights, editable_material, is_number, material_name
from raymarch.window.source import Wanted
from raymarch.window.state import State


def differences(state: State) -> tuple[list[Wanted], list[str]]:
    """The values that differ from the file, and why others cannot be written."""
    base = state.base
    wanted: list[Wanted] = []
    refused: list[str] = []
    for name, value in state.params.items():
        if name in base.parameters and state.changed(name):
            spec = base.parameters[name]
            order = ("name", "value", "min", "max")
            wanted.append(Wanted("Param", spec.where, name, ("value",), order, spec.value, value, label=name))

    def add(subject: str, part: Any, name: str, names: tuple[str, ...], old: Any, new: Any) -> None:
        if is_number(new) and (not is_number(old) or not np.array_equal(old, new)):
            kind = type(part)
            order = tuple(parameters_of(kind))
            wanted.append(Wanted(kind.__name__, part.where, f"{subject} {name}", names, order, old, new))

    for index, values in state.edits.materials.items():
        material, file = base.materials[index], editable_material(base.materials[index])
        for name, value in values.items():
            new = state.params.get(material_name(index, name), value)
            names = ("albedo", "color") if name in ("albedo", "color") else (name,)
            add(f"material {index}", material, name, names, file.get(name), new)
    lights = editable_lights(base)
    if state.edits.lights is not None and [v.number for v in state.edits.lights] != [v.number for v in lights]:
        refused.append("lights: some were added or removed")
    else:
        for light, own, edited in zip(base.lights, lights, state.edits.lights or (), strict=False):
            for name, value in edited.values.items():
                new = state.params.get(edited.name(name), value)
                add(f"light {edited.number}", light, name, (name,), own.values[name], new)
    if state.moved:
        camera, view = base.camera, state.hold()
        held: dict[str, Any] = {"position": view.position, "target": view.target, "up": view.up}
        held |= {"fov": view.fov} if view.height is None else {"height": view.height}
        for name, now in held.items():
            given = getattr(camera, name)
            old = None if given is None else np.asarray(state.values.of(given))
            if old is None or not np.allclose(old, now, atol=1e-6 * view.reach):
                new = float(now) if np.ndim(now) == 0 else tuple(round(float(v), 6) for v in np.asarray(now))
                add("camera", camera, name, (name,), None if old is None else tuple(np.ravel(old)), new)
    return wanted, refused
