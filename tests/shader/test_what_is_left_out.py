"""What a scene does not call for might as well not be in the package: deleted, it leaves the same text."""

from __future__ import annotations

import pytest

import raymarch
from raymarch import glsl
from raymarch.plan import plan
from raymarch.shader import assemble
from raymarch.shader.chunk import Mapped
from raymarch.shader.trim import trimmed
from tests.support.shader_samples import PASSES, assembled, planned, scenes
from tests.support.unread import unread


def test_deleted_modules_that_a_scene_does_not_call_for_change_no_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without them each scene is linked again; the plan of a scene reads no module."""
    every = {name for names in glsl.givers().values() for name in names}
    load, kept = glsl.load, set[str]()

    def load_kept(name: str, variants: frozenset[str] = frozenset()) -> glsl.Module:
        if name not in kept:
            raise KeyError(f"no GLSL module '{name}'")
        return load(name, variants)

    expected = {name: assembled(name, PASSES[2]) for name in scenes()}
    monkeypatch.setattr(glsl, "load", load_kept)
    monkeypatch.setattr(glsl, "_names", lambda folder: kept)
    try:
        for name, shader in expected.items():
            made = planned(name, PASSES[2])
            kept = {*made.choices, *shader.modules}
            assert len(kept) < len(every) / (2 if name == "plain" else 1)
            glsl.givers.cache_clear()
            assert assemble(made).text() == shader.text(), name
            assert {given for names in glsl.givers().values() for given in names} <= kept
    finally:
        glsl.givers.cache_clear()


GOLD = raymarch.sphere().material(raymarch.Material(albedo=(1, 0.8, 0.3)))
COATED = raymarch.sphere().material(raymarch.Material(albedo=(1, 0.8, 0.3), clearcoat=0.0, clearcoat_roughness=0.2))


@pytest.mark.parametrize(
    ("plain", "with_it"),
    [
        ({"lights": [raymarch.Sun()]}, {"lights": [raymarch.Sun(softness=0.3, penumbra="cone")]}),
        ({"lights": [raymarch.Sun(shadow=True)]}, {"lights": [raymarch.Sun(shadow=True, softness=0)]}),
        ({"sky": (0.1, 0.2, 0.3)}, {"sky": raymarch.Sky((0.1, 0.2, 0.3), light=False)}),
        ({}, {"tone": raymarch.ToneMapping("agx", 2, dither=True)}),
        ({"node": GOLD}, {"node": COATED}),
        ({"lights": []}, {"lights": [], "occlusion": raymarch.AmbientOcclusion()}),
    ],
)
def test_an_effect_turned_off_is_one_never_had(plain: dict[str, object], with_it: dict[str, object]) -> None:
    node = {"node": raymarch.sphere()}
    texts = [assemble(plan(raymarch.Scene(**{**node, **parts}))).text() for parts in (plain, with_it)]  # type: ignore[arg-type]
    assert texts[0] == texts[1]


def test_a_plain_scene_has_no_texture_and_no_uniform_of_an_effect() -> None:
    shader = assemble(plan(raymarch.Scene(raymarch.sphere())))
    text = shader.text()
    for word in (
        "u_lights",
        "u_sky_light",
        "sampler",
        "ambient_occlusion",
        "fresnel",
        "d_ggx",
        "emission",
        "shadow",
        "light_0",
    ):
        assert word not in text
    assert not shader.samples and len(plan(raymarch.Scene(raymarch.sphere())).passes) == 1
    assert "BsdfSample" not in text


@pytest.mark.parametrize("passes", PASSES, ids=" and ".join)
def test_nothing_of_a_text_is_unread(passes: tuple[str, ...]) -> None:
    """By a reader of its own: functions, parameters, fields and variables that no pass of a scene reads."""
    for name in scenes():
        shader = assembled(name, passes)
        assert set.intersection(*(set(unread(shader.text(chosen))) for chosen in shader.passes)) == set(), name


def test_the_reader_sees_what_is_unread() -> None:
    found = unread(
        """
        struct Pair { float one; float other; };
        float idle(float x) { return x; }
        float half_of(float x, float unused) { float y = 2.0; y = 3.0; return 0.5 * x; }
        out vec4 color;
        uniform float u_unread;
        void main() { Pair p = Pair(1.0, 2.0); p.other = 3.0; color = vec4(half_of(p.one, 0.0)); }
        """
    )
    assert found == [
        "function idle is never called",
        "field Pair.other is never read",
        "u_unread is never read",
        "parameter unused of half_of is never read",
        "variable y in half_of is never read",
    ]


def test_what_is_given_is_left_out_only_if_it_changes_nothing() -> None:
    """A call that counts stays, and so does the parameter that it is given to."""
    text = """
    int count = 0;
    float counted(float x) { count += 1; return x; }
    float doubled(float x) { return 2.0 * x; }
    float first(float a, float b, float c) { return a; }
    out vec4 color;
    void main() {
        float unread = doubled(1.0);
        float kept = counted(2.0);
        color = vec4(first(1.0, counted(2.0), doubled(3.0)), float(count), 0.0, 0.0);
    }"""
    left = "\n".join(line.text for line in trimmed([Mapped(line, "") for line in text.split("\n")]))
    assert "unread" not in left and "doubled" not in left
    assert "float kept = counted(2.0);" in left
    assert "float first(float a, float b) {" in left and "first(1.0, counted(2.0))" in left


BALL = "float ball(vec3 p) { return length(p) - one(p); }"


@pytest.mark.parametrize(
    "code",
    [
        "float one(vec3 p) { float a = 2.0, b; b = 1.0; return b; }\n" + BALL,
        "float first = 2.0, second;\nfloat one(vec3 p) { second = 1.0; return second; }\n" + BALL,
        "struct Rod { float r[2]; float h; };\n"
        "float one(vec3 p) { Rod rod; rod.r[0] = 1.0; rod.h = 0.0; return rod.r[0] + rod.h; }\n" + BALL,
        "struct Rod { vec2 a, b; };\nfloat one(vec3 p) { return Rod(vec2(1.0), vec2(2.0)).a.x; }\n" + BALL,
        "struct Rod { float r; } rod;\nfloat one(vec3 p) { rod.r = 1.0; return rod.r; }\n" + BALL,
        "float of(float a, vec2 b) { return a; }\nfloat of(float a, vec3 b) { return 2.0 * a; }\n"
        "float one(vec3 p) { return of(1.0, p.xy) + of(0.5, p) - 1.0; }\n" + BALL,
        "#define ONE(x) \\\n  ((x) * of(p, 1.0))\nfloat of(vec3 p, float x) { return x; }\n"
        "float one(vec3 p) { return ONE(1.0); }\n" + BALL,
        "float set;\nvoid give() { set = 1.0; { float set = 3.0; } }\nfloat one(vec3 p) { give(); return set; }\n"
        + BALL,
        "float one(vec3 p) {\n int last = 0;\n for (int i = 0; i++ < 3; last = 2) {\n  if (p.x > 1e9) break;\n }\n"
        " return 1.0;\n}\n" + BALL,
    ],
)
def test_glsl_that_a_user_wrote_stays_as_it_is(code: str) -> None:
    """All that GLSL allows: several names in a declaration, overloads, macros, names of an inner scope."""
    ball = raymarch.glsl_node(code, "ball", "exact", bounds=((-1, -1, -1), (1, 1, 1)))
    shader = assemble(plan(raymarch.Scene(ball, raymarch.Camera((0, 0, 4)))))
    assert f"\n{code}\n" in shader.text()
