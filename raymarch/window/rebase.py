"""Edits of the panel after the file has changed: of two changes of a value, the newer one wins."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from raymarch.scene.parameter import Spec, Value
from raymarch.scene.scene import Scene
from raymarch.window import edits as edit
from raymarch.window.edits import Edits


@dataclass(frozen=True, slots=True)
class Rebased:
    """The edits and the values of parameters that stay, and one sentence for each that gives way to the file."""

    edits: Edits
    params: dict[str, Value]
    words: list[str]


def rebased(edits: Edits, params: dict[str, Value], before: Scene, now: Scene) -> Rebased:
    """The edits of the scene `before` as edits of the file's next scene, `now`.

    A value that differs between the two scenes was changed in the file after the panel changed it, so the file's is
    taken. An edited material keeps its edits if it is at another index.
    """
    kept, words = dict(params), []
    for name, spec in now.parameters.items():
        old = before.parameters.get(name)
        changed = old is not None and old.value != spec.value
        if changed and not np.allclose(kept.pop(name, spec.value), spec.value, rtol=1e-5):
            words.append(f"{name} = {_shown(spec)}: the file's, which is newer")
    materials, said = _materials(edits, kept, before, now)
    words += said
    lights, said = _lights(edits, kept, before, now)
    words += said
    quality = {n: v for n, v in edits.quality.items() if getattr(before.quality, n) == getattr(now.quality, n)}
    words += [f"quality {name}: the file's, which is newer" for name in edits.quality if name not in quality]
    return Rebased(Edits(lights, materials, quality), kept, words)


def _shown(spec: Spec) -> str:
    return str(spec.value)


def _differ(old: Any, new: Any) -> bool:
    return bool(old != new) and (edit.is_number(old) or edit.is_number(new))


def _materials(
    edits: Edits, params: dict[str, Value], before: Scene, now: Scene
) -> tuple[dict[int, dict[str, Any]], list[str]]:
    made: dict[int, dict[str, Any]] = {}
    moved: dict[str, Value] = {}
    words = []
    for index, values in edits.materials.items():
        names = {name: edit.material_name(index, name) for name in values}
        given = {name: params.pop(full) for name, full in names.items() if full in params}
        old = before.materials[index] if index < len(before.materials) else None
        at = _place(old, index, before, now)
        if old is None or at is None:
            words.append(f"material {index} is no longer in the file")
            continue
        was, became = edit.editable_material(old), edit.editable_material(now.materials[at])
        newer = {name for name in {*was, *became} if _differ(was.get(name), became.get(name))}
        made[at] = {name: became.get(name, value) if name in newer else value for name, value in values.items()}
        moved |= {edit.material_name(at, name): value for name, value in given.items() if name not in newer}
        words += [f"material {at} {name}: the file's, which is newer" for name in sorted(newer & values.keys())]
    params.update(moved)
    return made, words


def _place(old: Any, index: int, before: Scene, now: Scene) -> int | None:
    """The index of a material in the next scene; None if it is gone."""
    if index < len(now.materials) and now.materials[index] == old:
        return index
    if old in now.materials:
        return now.materials.index(old)
    return index if len(now.materials) == len(before.materials) else None


def _lights(
    edits: Edits, params: dict[str, Value], before: Scene, now: Scene
) -> tuple[tuple[edit.LightEdit, ...] | None, list[str]]:
    if edits.lights is None:
        return None, []
    was, became = edit.editable_lights(before), edit.editable_lights(now)
    if [light.kind for light in was] != [light.kind for light in became]:
        for light in edits.lights:
            for name in light.values:
                params.pop(light.name(name), None)
        return None, ["lights: the file's, which are newer"]
    words, made = [], []
    for light in edits.lights:
        changed = light
        if light.number <= len(was) and light.kind == was[light.number - 1].kind:
            old, new = was[light.number - 1].values, became[light.number - 1].values
            for name in light.values:
                if old[name] != new[name]:
                    changed = replace(changed, values={**changed.values, name: new[name]})
                    params.pop(light.name(name), None)
                    words.append(f"{light.name(name)}: the file's, which is newer")
        made.append(changed)
    return tuple(made), words
