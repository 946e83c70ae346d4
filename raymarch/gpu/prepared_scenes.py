"""The plans and shaders of the scenes that a renderer drew last."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from functools import partial
from typing import Any

from raymarch.gpu.part import prepared_part
from raymarch.gpu.prepare import Prepared, Wanted, assembled, drawn_for, passes_for, with_lights
from raymarch.gpu.resource_cache import ResourceCache, check_compile_time
from raymarch.plan import Plan, marched_otherwise, marching, plan
from raymarch.plan.live_lights import LightMemory, LiveLights
from raymarch.scene.scene import Scene

PLANNED = 8
"""Minimum number of scenes whose plan and shader a renderer caches; the limit grows with `kept`."""


class PreparedScenes:
    """Caches plans and shaders. resources : of the renderer, whose driver compiles the shaders."""

    def __init__(self, resources: ResourceCache) -> None:
        self._resources = resources
        self._device = resources.device
        self._ready: OrderedDict[tuple[Any, ...], Prepared] = OrderedDict()
        self._plans: OrderedDict[tuple[Any, ...], Plan] = OrderedDict()
        self._lights = LightMemory()
        self._versions: OrderedDict[tuple[Any, ...], Prepared] = OrderedDict()
        self._last: tuple[Scene, tuple[Any, ...], Prepared] | None = None
        self._another: tuple[Scene, Scene] | None = None

    def _forget_other_prices(self) -> None:
        """Forget all scenes if the renderer plans for another device now."""
        if self._resources.device is not self._device:
            self._device = self._resources.device
            self.clear()

    def of(self, scene: Scene, outputs: Sequence[Wanted], size: tuple[int, int], part: bool = False) -> Prepared:
        """The plan and shader of a scene, from the cache if possible.

        size : of the whole picture. part : True for a shader that draws parts of it.
        """
        scene, passes = self.drawn_for(scene, outputs), passes_for(outputs)
        asked = (tuple(passes), size, part)
        self._forget_other_prices()
        if self._last is not None and self._last[0] is scene and self._last[1] == asked:
            return self._last[2]
        key = (scene.planned, *asked)
        found = self._ready.get(key)
        if found is None:
            found = self._fresh(scene, asked)
            self._add(key, found)
        self._last = (scene, asked, found)  # large scenes take long to hash
        return found

    def drawn_for(self, scene: Scene, outputs: Sequence[Wanted]) -> Scene:
        """See `raymarch.gpu.prepare.drawn_for`. The last one that differs is kept: large scenes take long to hash."""
        if (found := drawn_for(scene, outputs)) is scene:
            return scene
        if self._another is None or self._another[0] is not scene:
            self._another = scene, found
        return self._another[1]

    def _fresh(self, scene: Scene, asked: tuple[tuple[str, ...], tuple[int, int], bool]) -> Prepared:
        """A scene that is not known. One that differs from a known one in its lights alone may keep the shader."""
        passes, size, part = asked
        if part or not self._resources.live_lights:
            return (prepared_part if part else assembled)(self._planned(scene, passes, size, None))
        of = scene.planned_without("lights")
        live = self._lights.fit(scene, of, self._device.prices)
        key = (of, passes, size)
        earlier = self._versions.pop(key, None)
        found = None if earlier is None else with_lights(earlier, scene, live)
        self._versions[key] = found = found or assembled(self._planned(scene, passes, size, live))
        while len(self._versions) > PLANNED:
            self._versions.popitem(last=False)
        return found

    def adopt(self, scene: Scene, outputs: Sequence[Wanted], size: tuple[int, int], prepared: Prepared) -> None:
        """Cache a scene that was prepared elsewhere."""
        if self._resources.live_lights:
            self._lights.fit(scene, scene.planned_without("lights"), self._device.prices)
        self._add((scene.planned, tuple(passes_for(outputs)), size, False), prepared)

    def clear(self) -> None:
        """Forget all scenes."""
        self._ready.clear()
        self._plans.clear()
        self._versions.clear()
        self._lights = LightMemory()
        self._last = None

    def _add(self, key: tuple[Any, ...], prepared: Prepared) -> None:
        self._ready[key], self._last = prepared, None
        while len(self._ready) > max(PLANNED, self._resources.kept // 4):
            self._ready.popitem(last=False)

    def _planned(self, scene: Scene, passes: Sequence[str], size: tuple[int, int], live: LiveLights | None) -> Plan:
        """The plan of a scene. Those of qualities that differ in marching alone share their functions."""
        plain = scene.replace(quality=marching.unmarched(scene.quality))
        key = (plain.planned, tuple(passes), size, live)
        if key in self._plans:
            self._plans.move_to_end(key)
            return marched_otherwise(self._plans[key], scene.quality, size)
        refuse = partial(self._refuse_slow, scene)
        found = self._plans[key] = plan(scene, passes, size, refuse=refuse, device=self._device, live=live)
        while len(self._plans) > PLANNED:
            self._plans.popitem(last=False)
        return found

    def _refuse_slow(self, scene: Scene, seconds: float, operations: int, shapes: int) -> None:
        """Refuse a field that takes too long to compile, before the rest is planned."""
        check_compile_time(seconds, operations, shapes, scene, self._resources.context.driver.renderer)
