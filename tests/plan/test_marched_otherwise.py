"""A plan whose marching alone is chosen again equals a new plan."""

from __future__ import annotations

import pytest

import raymarch as rm
from raymarch.plan import Plan, marched_otherwise, plan
from raymarch.plan.marching import FIELDS, unmarched
from raymarch.scene.quality import Quality
from raymarch.shader import assemble

SIZE = (640, 360)

FAR = rm.Camera(position=(1e7, 0, 4), target=(1e7, 0, 0))
SCENES = {
    "closed forms": rm.Scene(rm.sphere() | rm.plane(offset=-1) | rm.torus()),
    "blend, shadow": rm.Scene(rm.union(rm.box(1), rm.sphere(), k=0.1), lights=[rm.Sun(shadow=True)]),
    "estimate": rm.Scene(rm.mandelbulb()),
    "far": rm.Scene(rm.box(1).round(0.1).translate((1e7, 0, 0)), camera=FAR, lights=[rm.PointLight((1e7, 3, 0))]),
    "samples": rm.Scene(rm.box(1) | rm.torus(), quality=Quality(samples=4)),
    "rows": rm.Scene(rm.union(*(rm.sphere(0.1 + i / 999).translate((i, 0, 0)) for i in range(40)))),
    "bloom": rm.Scene(rm.box(1).round(0.1) | rm.sphere(), post=[rm.Bloom()]),
}
QUALITIES = {
    "default": {},
    "coarse": {"epsilon": 0.5, "max_steps": 64},
    "enhanced, cones": {"tracer": "enhanced", "omega": 0.7, "schedule": "cones"},
    "relaxed, slope": {"tracer": "relaxed", "refinement": "slope"},
    "auto_relaxed": {"tracer": "auto_relaxed", "beta": 0.2, "refinement": "none"},
    "short steps": {"step_scale": 0.7, "step_variation": 0.2},
    "shadows": {"shadow_steps": 8},
}


def described(made: Plan) -> dict[str, object]:
    """Everything of a plan that depends on the quality, in order."""
    names = ("given", "marching", "passes", "features", "warnings", "variants", "textures")
    values = {name: getattr(made, name) for name in names}
    return values | {"choices": list(made.choices.items()), "text": assemble(made).text(), "scene": repr(made.scene)}


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("passes", [["color"], ["geometry"]])
def test_it_equals_a_new_plan(scene, quality, passes):
    given = SCENES[scene]
    other = given.quality.replace(epsilon=0.02, tracer="plain", schedule="cone", max_steps=99)
    wanted = given.quality.replace(**QUALITIES[quality])
    old = plan(given.replace(quality=other), passes, SIZE)
    before = described(old)
    assert described(marched_otherwise(old, wanted, SIZE)) == described(
        plan(given.replace(quality=wanted), passes, SIZE)
    )
    assert described(old) == before


def test_fields_of_marching_alone_have_defaults():
    changed = Quality(epsilon=1.0, tracer="relaxed", omega=1.2, samples=4, normals="forward")
    assert unmarched(changed) == Quality(samples=4, normals="forward")
    assert set(FIELDS) < {*Quality.__dataclass_fields__}
