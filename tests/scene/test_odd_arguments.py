"""Odd arguments of every public function, class and method: legal, or refused in the package's own words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu.context import Context
from tests.support import odd_arguments as odd

CALLS = {call.name: call for call in odd.calls()}
NOT_THERE = {"mesh"}
"""Whose valid call needs a file that is not there."""


@pytest.mark.parametrize("name", CALLS)
def test_one_odd_argument_is_legal_or_refused(name: str) -> None:
    call, wrong = CALLS[name], []
    if name not in NOT_THERE:
        call()
    for parameter in call.odd():
        for kind, value in odd.ODD.items():
            given = {parameter: (value,) if parameter == "*" else value}
            fault = odd.fault_of(lambda given=given: call(**given), odd.__file__)
            if fault is not None:
                wrong.append(f"{parameter} = {kind}: {fault}")
    assert not wrong, "\n".join(wrong)


TRACED = {"displace_by", "node.displace_by", "warp", "node.warp", "repeat_varied"}
"""Each call traces the user's function anew, and gives another node."""


@pytest.mark.parametrize("name", [name for name in CALLS if name not in NOT_THERE])
def test_numbers_of_numpy_are_numbers(name: str) -> None:
    """Where a number is legal, its NumPy scalar and its array without axes are, and mean the same."""
    call = CALLS[name]
    for parameter, value in call.given.items():
        ways: Any = odd.NUMBERS if type(value) is float else odd.WHOLE if type(value) is int else {}
        for way, say in ways.items():
            made = call(**{parameter: say(value)})
            if isinstance(made, rm.Node) and name not in TRACED and way != "np.float16":
                usual = call(**{parameter: float(np.float32(value)) if way == "np.float32" else value})
                assert made == usual, (parameter, way)


DRAWN = {
    "size": lambda renderer, scene, value: rm.Renderer(value, context=renderer.context).close(),
    "resize": lambda renderer, scene, value: renderer.resize(value) or renderer.resize((8, 8)),
    "backend": lambda renderer, scene, value: rm.render(scene, (8, 8), backend=value),
    "device": lambda renderer, scene, value: rm.Renderer((8, 8), device=value).close(),
    "scene": lambda renderer, scene, value: renderer.render(value),
    "time": lambda renderer, scene, value: renderer.render(scene, value),
    "params": lambda renderer, scene, value: renderer.render(scene, params=value),
    "a parameter": lambda renderer, scene, value: renderer.render(scene, params={"radius": value}),
    "outputs": lambda renderer, scene, value: renderer.render(scene, outputs=value),
    "within": lambda renderer, scene, value: renderer.render(scene, within=value),
    "truth of": lambda renderer, scene, value: rm.truth(value, (2, 2)),
    "truth size": lambda renderer, scene, value: rm.truth(scene, value),
    "truth time": lambda renderer, scene, value: rm.truth(scene, (2, 2), value),
    "truth params": lambda renderer, scene, value: rm.truth(scene, (2, 2), params=value),
}


@pytest.mark.parametrize("name", DRAWN)
def test_an_odd_argument_of_drawing(name: str, egl: Context) -> None:
    scene = rm.Scene(rm.sphere(rm.Param("radius", 1.0, 0.5, 2.0)))
    wrong = []
    with rm.Renderer((8, 8), context=egl) as renderer:
        for kind, value in odd.ODD.items():
            try:
                DRAWN[name](renderer, scene, value)
            except RaymarchError as refused:
                message = str(refused)
                if not refused.legal or "\n" in message or len(message) > 2 * odd.LONGEST:
                    wrong.append(f"{kind}: {message[:200]}")
            except Exception as fault:
                wrong.append(f"{kind}: {type(fault).__name__}: {str(fault)[:150]}")
    assert not wrong, "\n".join(wrong)
