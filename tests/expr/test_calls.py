"""A call with wrong arguments is one SceneError, with the legal names and the user's line."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from types import ModuleType

import pytest

import raymarch as rm
from raymarch.expr.calls import checked

WRONG = {
    "a name that is nearly right": (
        lambda: rm.Scene(rm.sphere(), light=[rm.Sun()]),  # type: ignore[call-arg]
        r"Scene has no parameter 'light' \(did you mean 'lights'\? legal: node, camera, lights,",
    ),
    "a name that is not": (
        lambda: rm.Quality(trust=True),  # type: ignore[call-arg]
        r"Quality has no parameter 'trust' \(legal: tracer, max_steps,",
    ),
    "a name of other tools": (
        lambda: rm.Camera(look_at=(0, 0, 0)),  # type: ignore[call-arg]
        r"Camera has no parameter 'look_at' \(did you mean 'target'\? legal: position,",
    ),
    "a name of other tools that belongs elsewhere": (
        lambda: rm.Scene(rm.sphere(), width=640),  # type: ignore[call-arg]
        r"Scene has no parameter 'width' \(use size=\(width, height\), of rm.render and rm.Renderer; legal: node,",
    ),
    "a name of a node": (
        lambda: rm.sphere(radus=1),  # type: ignore[call-arg]
        r"sphere has no parameter 'radus' \(did you mean 'radius'\? sphere\(radius=1.0\)\)",
    ),
    "numbers in place of a vector": (
        lambda: rm.sphere().translate(1, 0, 0),  # type: ignore[call-arg]
        r"translate takes one vector \(translate\(\(1, 0, 0\)\)\)",
    ),
    "numbers in place of the vector of a shape": (
        lambda: rm.box(1, 2, 3),  # type: ignore[call-arg]
        r"box takes one vector \(box\(\(1, 2, 3\)\)\)",
    ),
    "too many": (
        lambda: rm.box(1).twist(1, 2),  # type: ignore[call-arg]
        r"twist takes up to 1 argument, 2 were given \(rate\)",
    ),
    "too few": (
        lambda: rm.PointLight(),  # type: ignore[call-arg]
        r"PointLight needs 'position' \(position, color,",
    ),
    "a name of a function": (
        lambda: rm.union(rm.sphere(), rm.box(1), smooth=0.2),  # type: ignore[call-arg]
        r"union has no parameter 'smooth' \(did you mean 'k'\? legal: k, blend, steps\)",
    ),
    "a name of a render": (
        lambda: rm.render(rm.Scene(rm.sphere()), resolution=(64, 48)),  # type: ignore[call-arg]
        r"render has no parameter 'resolution' \(use size=\(width, height\).*legal: scene, size, time",
    ),
    "a name of a renderer": (
        lambda: rm.Renderer(width=64),  # type: ignore[call-arg]
        r"Renderer has no parameter 'width' \(did you mean 'size'\?",
    ),
    "a name of a method of a class": (
        lambda: rm.Camera.framing(rm.sphere(), angle=30),  # type: ignore[call-arg]
        r"framing has no parameter 'angle' \(did you mean 'fov'\? legal: node, view_from",
    ),
    "too many of a function": (
        lambda: rm.Param("r", 1, 0, 2, 3),  # type: ignore[call-arg]
        r"Param takes up to 4 arguments, 5 were given \(name, value, min, max\)",
    ),
    "too few of a function": (lambda: rm.checker(), r"checker needs 'a' \(a, b, size"),  # type: ignore[call-arg]
    "twice": (
        lambda: rm.Camera((0, 0, 1), position=(1, 2, 3)),  # type: ignore[misc]
        r"Camera was given 'position' twice: by position \(0, 0, 1\) \(tuple\), by name \(1, 2, 3\)",
    ),
    "twice, a node": (
        lambda: rm.box(1).twist(rm.box, rate=2),  # type: ignore[call-arg]
        r"twist was given 'rate' twice: by position <function box> \(Builder\), by name 2 \(its parameters are rate\)",
    ),
    "a package": (lambda: rm.gpu(rm.box(1)), r"raymarch.gpu is a package"),  # type: ignore[operator]
}


def test_each_module_of_the_package_says_what_it_is_when_it_is_called() -> None:
    loaded = [m for m in vars(rm).values() if isinstance(m, ModuleType) and m.__name__.startswith("raymarch.")]
    assert len(loaded) > 5
    for module in loaded:
        with pytest.raises(rm.SceneError, match="is a package"):
            module()  # type: ignore[operator]


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_call_names_the_legal_arguments_and_the_line(name: str) -> None:
    call, words = WRONG[name]
    with pytest.raises(rm.SceneError, match=words) as fault:
        call()
    assert fault.value.where is not None
    assert (fault.value.where.file, fault.value.where.line) == (__file__, call.__code__.co_firstlineno)


def test_a_type_error_with_another_cause_stays() -> None:
    class Own:
        def run(self, number: int) -> int:
            return number + "a"  # type: ignore[operator]

    run: Callable[..., int] = checked(Own.run, "run")
    with pytest.raises(TypeError, match="unsupported operand"):
        run(Own(), 1)


MADE_ELSEWHERE = {
    "DirectionSample",
    "Frame",
    "Hits",
    "Measures",
    "Node",
    "Probe",
    "Proof",
    "Truth",
    "RaySamples",
    "TracerState",
    "value_noise",
}
"""What users do not call, or call with expressions alone."""


def test_every_public_callable_refuses_a_name_that_it_does_not_have() -> None:
    """With the user's line, whether or not the other arguments are given."""
    called = {name: getattr(rm, name) for name in rm.__all__ if name not in MADE_ELSEWHERE}
    for name, function in called.items():
        if callable(function) and not (isinstance(function, type) and issubclass(function, BaseException)):
            for args in ((), (1,) * 12):
                with pytest.raises(rm.RaymarchError) as fault:
                    function(*args, no_such_name=1)
                assert fault.value.where is not None and fault.value.where.file == __file__, name


def test_a_checked_function_can_be_pickled() -> None:
    assert pickle.loads(pickle.dumps(rm.union)) is rm.union and pickle.loads(pickle.dumps(rm.render)) is rm.render


def test_signatures_stay() -> None:
    assert list(inspect.signature(rm.Node.translate).parameters) == ["self", "offset"]
    assert list(inspect.signature(rm.Camera).parameters)[:4] == ["position", "target", "up", "fov"]
