"""Scenes that between them call for every part of the shader."""

from __future__ import annotations

from functools import cache
from hashlib import sha256

import numpy as np

import raymarch as rm
from raymarch.expr.vocabulary import sin
from raymarch.plan import Plan, explain, plan
from raymarch.scene.light import PENUMBRAS
from raymarch.scene.quality import NORMALS, TRACERS
from raymarch.shader import Shader, assemble

RED, BLUE = rm.Material((1, 0, 0)), rm.Material((0, 0, 1), shininess=80)
GAP, TINT = rm.Param("gap", 1.0, 0.5, 2.0), rm.Param("tint", (0.2, 0.4, 0.6), 0, 1)


def solid() -> rm.Node:
    body = rm.union(rm.box(1).round(0.1), rm.torus().translate((0, 0.5, 0)), k=0.3).material(RED)
    return body - rm.cylinder(0.2, 3).rotate(0.5, "x").material(BLUE)


def lamps() -> list[rm.PointLight | rm.Sun]:
    """One of each kind."""
    return [
        rm.Sun((1, 2, 1), shadow=True, softness=0.05),
        rm.PointLight((0, 3, 0), range=5, shadow=True, radius=0.2, shadow_radius=GAP, penumbra="cone"),
        rm.PointLight((3, 0, GAP), attenuation=(1, 0.1, 0.5), shadow=True),
        rm.PointLight((0, 0, 3), attenuation=(1, 0.1, 0.5), range=6, color=TINT),
        rm.SpotLight((0, 4, 0), half_angle=GAP, blend=0.5),
        rm.SphereLight((2, 4, 2), 0.4, shadow=True, penumbra="triangulated"),
    ]


def tiles(side: int = 16) -> np.ndarray:
    """A coloured picture without symmetry, linear."""
    y, x = np.mgrid[0:side, 0:side] / side
    return np.stack([0.2 + 0.6 * (x > 0.4), 0.5 + 0.4 * np.sin(6 * y), 0.3 + 0.5 * x * y], axis=-1)


def maps() -> dict[str, rm.Scene]:
    """Scenes whose materials have textures or relief."""
    picture, waves = tiles(), 0.5 + 0.5 * np.sin(np.linspace(0, 12, 48)).reshape(1, 48) * np.ones((32, 1))
    normals = 0.5 + 0.1 * tiles(32) * (1, 1, 0) + (0, 0, 0.45)
    rough = tiles(16)[..., 0]
    tiled = rm.Material(albedo=rm.triplanar(picture, 0.7), roughness=rm.triplanar(rough, 0.7, wrap="mirror"))
    bumpy = rm.Material(
        albedo=rm.planar(picture, (1.5, 1), rotation=GAP),
        normal=rm.triplanar(normals, 0.9, 8),
        height=rm.planar(waves, axis="y"),
        occlusion=rm.planar(rough, 3, "y", offset=(0.2, 0.1), wrap="clamp"),
    )
    matte = rm.Material(rm.planar(picture, axis="x"), height=lambda p: sin(9 * p.x) * p.y, height_scale=0.05)
    glow = rm.Material(emission=rm.triplanar(picture), transmission=rm.planar(rough), height=rm.planar(waves, 2))
    dented = rm.Material(albedo=(1, 0.9, 0.7), metalness=1, roughness=0, height=rm.triplanar(waves))
    turned = rm.box(1).material(tiled).rotate(0.6, (1, 2, 3)).scale((1, 1.4, 0.8)) | rm.plane(offset=-1.2)
    return {
        "mapped": rm.Scene(turned),
        "relief": rm.Scene(rm.sphere().material(bumpy).mirror("x") | rm.plane(offset=-1).material(tiled)),
        "relief under a sky": rm.Scene(rm.sphere().material(bumpy), sky=rm.GradientSky(light=True)),
        "relief in corners": rm.Scene(
            rm.union(rm.sphere().material(bumpy), rm.box(1).material(tiled).translate((0.8, 0, 0)), k=0.3),
            sky=rm.GradientSky(light=True),
            occlusion=rm.AmbientOcclusion(3),
        ),
        "matte relief": rm.Scene(rm.rectangle((2, 1.5)).material(matte).extrude(1) | solid().translate((0, 0, 2))),
        "glow of a texture": rm.Scene(rm.sphere().material(glow), lights=[], bounces=0),
        "textures in a tree": rm.Scene(
            rm.sphere().material(dented) | rm.plane(offset=-1.2).material(tiled),
            bounces=2,
            quality=rm.Quality(integrator="whitted"),
            sky=rm.GradientSky(light=True),
        ),
        "textures in bounces": rm.Scene(rm.sphere().material(glow) | rm.plane(offset=-1).material(bumpy), bounces=2),
    }


@cache
def planned(name: str, passes: tuple[str, ...] = ("color",)) -> Plan:
    """The plan of a scene, by its name; a process makes it once."""
    return plan(scenes()[name], passes)


@cache
def assembled(name: str, passes: tuple[str, ...] = ("color",)) -> Shader:
    """The shader of a scene, by its name; a process assembles it once."""
    return assemble(planned(name, passes))


@cache
def scenes() -> dict[str, rm.Scene]:
    """By name. A process builds them once: scenes are values, and a test that changes one gets another."""
    made = {
        "plain": rm.Scene(rm.sphere()),
        "unlit": rm.Scene(rm.sphere(), lights=[]),
        "no end": rm.Scene(rm.plane((1, 2, 3)) | rm.sphere()),
        "half a box": rm.Scene(rm.plane() | rm.sphere()),
        "empty": rm.Scene(rm.sphere() & rm.sphere().translate((5, 0, 0))),
        "materials": rm.Scene(solid()),
        "shadows": rm.Scene(
            solid(), lights=[rm.Sun(shadow=True), rm.PointLight((0, 3, 0), shadow=True), rm.PointLight((3, 0, 0))]
        ),
        "everything": rm.Scene(
            rm.union(solid().translate((GAP, 0, 0)), rm.sphere(0.5).scale((1, 2, 3)).repeat((8, None, None), 3), k=0.2),
            camera=rm.Camera((GAP, 2, 9), (0, rm.time, 0), fov=40 + GAP),
            lights=[rm.Sun((rm.time, 1, 0), TINT, GAP, shadow=True), rm.PointLight((0, GAP, 3), shadow=True)],
            sky=TINT,
            fog=rm.Fog(TINT, 0.1 * GAP),
        ),
        "repeated": rm.Scene((solid() | rm.capsule()).repeat(5).mirror((1, 1, 0)).shell(0.05)),
    }
    gold = rm.Material(albedo=(1, 0.8, 0.4), metalness=1, roughness=0.3)
    spotted = rm.Material(roughness=lambda p: 0.5 + 0.4 * sin(9 * p.x), emission=lambda p: 0.1 * abs(p))
    made["physical"] = rm.Scene(rm.sphere().material(gold) | rm.box(1).translate((2, 0, 0)))
    made["masking"] = rm.Scene(rm.sphere().material(gold), quality=rm.Quality(masking="separable"))
    made["both models"] = rm.Scene(rm.union(rm.sphere().material(gold), solid(), k=0.2))
    made["patterns"] = rm.Scene(rm.sphere().material(spotted).repeat(3) | rm.plane(offset=-2).material(spotted))
    made["glow without lights"] = rm.Scene(rm.sphere().material(spotted), lights=[])
    made["soft shadows"] = rm.Scene(
        solid() | rm.plane(offset=-1), lights=[rm.Sun(shadow=True, softness=0.1, penumbra=p) for p in PENUMBRAS[:3]]
    )
    made["soft shadows without end"] = rm.Scene(rm.plane((1, 2, 3)), lights=[rm.Sun(shadow=True, softness=GAP)])
    parallel = rm.Camera(projection="orthographic", near=GAP)
    made["parallel rays"] = rm.Scene(solid() | rm.plane(offset=-1), parallel, lights=[rm.Sun(shadow=True)])
    made["lens and clip planes"] = rm.Scene(solid(), rm.Camera((0, 0, 5), near=2, far=20, aperture=GAP), bounces=1)
    made["lamps"] = rm.Scene(solid(), lights=lamps())
    made["many lamps"] = rm.Scene(solid() | rm.sphere().material(gold).translate((3, 0, 0)), lights=2 * lamps())
    made["many plain lamps"] = rm.Scene(solid(), lights=[rm.PointLight((k, 3, 0)) for k in range(20)])
    point = rm.SphereLight((2, 4, 2), GAP, shadow=True, penumbra="sampled")
    made["sampled shadows"] = rm.Scene(solid() | rm.plane(offset=-1), lights=[point, rm.Sun(shadow=True)])
    made["many sampled shadows"] = rm.Scene(solid(), lights=[point, *lamps(), *lamps()], bounces=1)
    skies = {
        "gradient": rm.GradientSky(light=True),
        "sun": rm.SunSky((1, GAP, 1), light=True),
        "blue": rm.Sky(TINT, True),
    }
    for name, sky in skies.items():
        made[f"{name} sky"] = rm.Scene(rm.union(rm.sphere().material(gold), solid(), k=0.2), lights=[], sky=sky)
    made["matte under a sky"] = rm.Scene(solid(), lights=[], sky=skies["gradient"])
    made["gold under a sky"] = rm.Scene(rm.sphere().material(gold), sky=skies["sun"], occlusion=rm.AmbientOcclusion())
    made["sky seen only"] = rm.Scene(rm.sphere(), sky=rm.GradientSky((GAP, 1, 1)), fog=rm.Fog())
    hidden = solid().visible(shadow=False) | rm.sphere(GAP).material(gold).visible(camera=False)
    layer = rm.Fog(TINT, 0.1, falloff=GAP, height=GAP)
    made["hidden parts in a layer"] = rm.Scene(hidden, lights=lamps(), bounces=1, fog=layer)
    made["occlusion"] = rm.Scene(solid() | rm.plane(offset=-1), occlusion=rm.AmbientOcclusion(4, GAP))
    made["occlusion in vain"] = rm.Scene(rm.sphere().material(gold), occlusion=rm.AmbientOcclusion(4, GAP))
    glass = rm.Material(transmission=1, ior=1.5, absorption=(0.1, 0.2, 0.3))
    made["matte bounces"] = rm.Scene(solid() | rm.plane(offset=-1), bounces=1, sky=rm.GradientSky())
    made["glossy bounces"] = rm.Scene(rm.sphere().material(gold), bounces=2, lights=[])
    varnished = rm.Material(albedo=TINT, clearcoat=GAP, clearcoat_roughness=0.05)
    made["clear coat"] = rm.Scene(rm.sphere().material(varnished), sky=rm.GradientSky(light=True))
    made["clear coat and phong"] = rm.Scene(rm.union(rm.sphere().material(varnished), solid(), k=0.2), bounces=1)
    made["glass"] = rm.Scene(rm.sphere().material(glass) | rm.plane(offset=-1).material(gold), fog=rm.Fog())
    made["glass and phong"] = rm.Scene(
        rm.union(rm.sphere().material(glass), solid(), k=0.2), occlusion=rm.AmbientOcclusion()
    )
    frosted = rm.Material(transmission=0.9, roughness=GAP, emission=(0.1, 0, 0))
    made["frosted glass"] = rm.Scene(rm.sphere().material(frosted), sky=rm.GradientSky())
    made["frosted glass and phong"] = rm.Scene(rm.union(rm.sphere().material(frosted), solid(), k=0.2), bounces=2)
    made["frosted glass unlit"] = rm.Scene(rm.sphere().material(frosted), lights=[], sky=rm.GradientSky())
    tree, mirror = rm.Quality(integrator="whitted"), rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1, roughness=0)
    made["tree of a clear coat"] = rm.Scene(rm.sphere().material(varnished) | solid(), quality=tree, bounces=2)
    row = rm.sphere().material(glass) | rm.sphere().material(mirror).translate((3, 0, 0))
    sky = rm.GradientSky(light=True)
    made["tree"] = rm.Scene(row | solid().translate((0, 0, -3)), bounces=3, quality=tree, sky=sky, fog=rm.Fog())
    made["tree of mirrors"] = rm.Scene(rm.sphere().material(mirror), bounces=2, quality=tree, lights=[])
    made["tree of glass"] = rm.Scene(rm.sphere().material(glass), quality=tree, lights=[])
    made |= maps()
    turned = rm.box(1).rotate(0.3, "z").repeat((3, None, None), 2)  # asked at two places, so a function of its own
    made["copies beside a material"] = rm.Scene(turned | rm.plane().material(RED))
    made |= {f"{n} normals": rm.Scene(solid(), quality=rm.Quality(normals=n)) for n in NORMALS}
    made |= {f"{t} tracer": rm.Scene(solid(), quality=rm.Quality(tracer=t)) for t in TRACERS}
    return made


PASSES = (("color",), ("geometry",), ("color", "geometry"))


def passes_of(name: str) -> tuple[tuple[str, ...], ...]:
    """Both passes in one text, and one of them alone: the one for every second scene, the other for the rest."""
    return PASSES[list(scenes()).index(name) % 2], PASSES[2]


def line(name: str, scene: rm.Scene) -> str:
    """A name and the hashes of what is written of a scene: its two passes, and how it is explained."""
    known = scenes().get(name) is scene
    made = planned(name, PASSES[2]) if known else plan(scene, PASSES[2])
    shader = assembled(name, PASSES[2]) if known else assemble(made)
    told = repr(explain.as_dict(made, shader.modules))
    return " ".join([name, *[sha256(t.encode()).hexdigest() for t in (shader.text(), shader.text("geometry"), told)]])
