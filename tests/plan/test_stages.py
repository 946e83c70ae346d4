"""A plan is a list of stages: each runs once, and its result stays."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import FrozenInstanceError, fields
from typing import Any
from unittest import mock

import pytest

import raymarch as rm
from raymarch.plan import plan
from raymarch.plan.gather import Gatherer
from raymarch.plan.stages import Asked, FieldPlan, PassPlan, SurfacePlan

STAGES = ("ask", "objects_of", "fields_of", "surfaces_of", "drawn_of")
PIECES = [rm.ellipsoid((0.9, 0.5, 0.3 + 0.02 * i)).twist(0.1).translate((2 * i, 0, 0)) for i in range(8)]
SCENES = {
    "text": rm.Scene(rm.sphere(1.37), lights=[rm.Sun()]),
    "rows": rm.Scene(rm.union(*(rm.sphere(0.1 + i / 999).translate((i, 0, 0)) for i in range(40)))),
    "boxes": rm.Scene(rm.union(*PIECES)),
}


@pytest.mark.parametrize("name", SCENES)
def test_each_stage_runs_once_and_reads_each_form_once(name: str) -> None:
    calls: Counter[str] = Counter()
    module = sys.modules[plan.__module__]

    def counted(stage: str, function: Any) -> Any:
        def call(*args: Any, **named: Any) -> Any:
            calls[stage] += 1
            return function(*args, **named)

        return call

    with mock.patch.multiple(module, **{name: counted(name, getattr(module, name)) for name in (*STAGES, "unused")}):
        read: Counter[int] = Counter()
        signature = Gatherer._signature

        def once(self: Gatherer, node: rm.Node) -> Any:
            read[id(node)] += 1
            return signature(self, node)

        with mock.patch.object(Gatherer, "_signature", once):
            made = plan(SCENES[name])
        assert calls == Counter(STAGES), "warnings are found when they are read"
        assert made.warnings == made.warnings and calls["unused"] == 1
    assert name == "text" or (read and max(read.values()) == 1)


def test_a_plan_is_its_stages_and_stays() -> None:
    made = plan(SCENES["text"])
    parts = {f.name for stage in (Asked, FieldPlan, SurfacePlan, PassPlan) for f in fields(stage)}
    assert {f.name for f in fields(made)} == parts | {"probes", "published"}
    with pytest.raises(FrozenInstanceError):
        made.field = made.field  # type: ignore[misc]
