"""What a scene does not call for might as well not be in the package: deleted, it leaves the same text."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import raymarch
from raymarch.plan import plan
from raymarch.shader import assemble
from tests.support.shader_samples import PASSES, scenes

PACKAGE = Path(raymarch.__file__).parent

SCRIPT = """
import json, sys
from pathlib import Path
from raymarch import glsl
from raymarch.plan import plan
from raymarch.shader import assemble
from tests.support.shader_samples import PASSES, scenes

folder = Path(glsl.__file__).parent
stored = {str(f.relative_to(folder)): f.read_text(encoding="utf-8") for f in folder.rglob("*.glsl")}
kept = json.loads(sys.stdin.read())
texts = {}
for name, scene in scenes().items():
    for file, text in stored.items():
        (folder / file).unlink(missing_ok=True)
        if file[:-5] in kept[name]:
            (folder / file).write_text(text, encoding="utf-8")
    glsl.load.cache_clear()
    glsl.givers.cache_clear()
    texts[name] = [assemble(plan(scene, passes)).text() for passes in PASSES[2:]]
print(json.dumps(texts))
"""


def named(scene: raymarch.Scene) -> tuple[list[str], list[str]]:
    """The modules that a scene and its passes call for, and the texts of the passes."""
    found, texts = [], []
    for passes in PASSES[2:]:
        made = plan(scene, passes)
        shader = assemble(made)
        found += [*made.choices, *shader.modules]
        texts.append(shader.text())
    return sorted(set(found)), texts


def test_deleted_modules_that_a_scene_does_not_call_for_change_no_byte(tmp_path: Path) -> None:
    copy = tmp_path / "raymarch"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("*.pyc.*"))  # what another process is writing
    kept, expected = {}, {}
    for name, scene in scenes().items():
        kept[name], expected[name] = named(scene)
    every = {str(f.relative_to(PACKAGE / "glsl"))[:-5] for f in (PACKAGE / "glsl").rglob("*.glsl")}
    assert all(len(names) < len(every) for names in kept.values()) and len(kept["plain"]) < len(every) / 2
    path = os.pathsep.join([str(tmp_path), str(PACKAGE.parent)])
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps(kept),
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout) == expected


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
