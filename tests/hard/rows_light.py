"""Cases of light: shadows, microfacets, lamps in bad places."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import raymarch as rm
from raymarch.gpu.prepare import frame_uniforms, prepare
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from raymarch.scene.parameter import Values
from raymarch.scene.reflectance import d_ggx, fresnel_dielectric, v_smith, v_smith_separable
from tests.hard.world import ULP, Figure, World, case
from tests.support.analytic import unit
from tests.support.glsl_harness import evaluate

MATT = rm.Material((1, 1, 1), specular=0.0, ambient=0.0)


@case(29, "secondary rays", before="all of 2,968 rays without an offset; 20 with one of 1e-4")
def secondary(world: World) -> Iterator[Figure]:
    """A shadow ray that starts on a surface hits it at once. It starts at an offset of two epsilons, in any unit of
    length."""
    dark = tried = 0
    sun = unit(np.array([1.0, 0.3, 0.2]))
    for scale in (1e-4, 1.0, 1e4):
        for node in (
            rm.sphere(scale),
            rm.torus(scale, 0.3 * scale).rotate(1.2, "x"),
            rm.ellipsoid((scale, 0.5 * scale, 0.7 * scale)),
        ):
            light = sun if node.name == "sphere" else unit(np.array([0.0, 0.2, 1.0]))
            scene = rm.Scene(node.material(MATT), rm.Camera((0, 0, 4 * scale)), [rm.Sun(tuple(light), shadow=True)])
            free = rm.Scene(node.material(MATT), rm.Camera((0, 0, 4 * scale)), [rm.Sun(tuple(light))])
            frame, known = world.draw(scene, outputs=("color",)), world.draw(free, outputs=("color",))
            truth = rm.truth(scene, (64, 48), outputs=("color",)).color[..., 0]
            lit = (known.color[..., 0] > 0.02) & (truth > 0.02)
            tried += int(lit.sum())
            dark += int(np.sum(frame.color[..., 0][lit] == 0))
    yield Figure(f"points that shadow themselves, of {tried} at three scales", dark, 0, "two epsilons off the surface")


@case(30, "refraction")
def refraction(world: World) -> Iterator[Figure]:
    """At total internal reflection the refracted direction is a zero vector, and inside the solid the sign of the field
    is inverted. In a white furnace glass must be invisible, whichever path the light takes."""
    cosine, ratio = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 201), [1 / 4, 1 / 1.5, 1.0, 1.5, 4.0]))
    found = evaluate(world.context, fresnel_dielectric, [cosine, ratio])
    outside = int(np.sum(~((found >= 0) & (found <= 1 + 8 * ULP))))
    yield Figure("reflectances outside of the legal range", outside, 0, "0 to 1, and 1 beyond the critical angle")
    glass = rm.Material(albedo=(1, 1, 1), transmission=1.0, roughness=0.0)
    for name, node in (("slab", rm.box((4, 4, 0.3))), ("ball", rm.sphere(0.9))):
        scene = rm.Scene(
            node.material(glass),
            rm.Camera((0.6, 0.4, 3), (0, 0, 0)),
            [],
            sky=(1, 1, 1),
            bounces=16,
            quality=rm.Quality(samples=16),
        )
        color = world.draw(scene, (32, 24), ("color",)).color
        yield Figure(
            f"brightest pixel of a glass {name}",
            float(np.nanmax(color)),
            1 + 64 * ULP,
            "white furnace test",
        )
        missing = int(np.sum(~np.isfinite(color))) + abs(1 - float(color.mean()))
        yield Figure(f"light that a glass {name} loses", missing, 2e-3, "the remainder after 16 bounces")


@case(38, "a light at the surface")
def light_at_surface(world: World) -> Iterator[Figure]:
    """At a point light the inverse square is infinite and the direction is 0/0."""
    bad = tried = 0
    for y in (1.5, 1.001, 1.0 + 1e-6, 1.0, 1.0 - 1e-6, 0.5, 0.0):
        for light in (
            rm.PointLight((0, y, 0), shadow=True),
            rm.SphereLight((0, y, 0), 0.1, shadow=True),
            rm.SpotLight((0, y, 0), (0, -1, 0), shadow=True),
            rm.PointLight((0, y, 0), attenuation=(0, 0, 1)),
        ):
            frame = world.draw(rm.Scene(rm.sphere(), rm.Camera((0, 4, 0.01), (0, 0, 0)), [light]), outputs=("color",))
            tried += frame.color.size
            bad += int(np.sum(~np.isfinite(frame.color)) + np.sum(frame.color < 0))
    yield Figure(f"colours that are not finite, of {tried}", bad, 0, "distances have a floor")


@case(39, "microfacets of a mirror", before="NaN at roughness 0, infinite at alpha = 1e-4")
def mirror(world: World) -> Iterator[Figure]:
    """The normal distribution of a mirror's microfacets is infinite, and 1 - cosine² loses all its digits before
    that."""
    u = np.linspace(1e-4, 1 - 1e-4, 2000)
    worst = bad = 0.0
    for alpha in (1e-3, 1e-2, 0.1, 0.5, 1.0):
        tangent = alpha * np.sqrt(u / (1 - u))
        h = np.stack([tangent, np.zeros_like(u), np.ones_like(u)], axis=-1) / np.sqrt(1 + tangent**2)[:, None]
        h = h.astype(np.float32).astype(np.float64)
        cosine, sine = h[:, 2], np.hypot(h[:, 0], h[:, 1])
        true = alpha**2 / (sine**2 + (alpha * cosine) ** 2) ** 2  # times pi
        up = np.broadcast_to([0.0, 0.0, 1.0], h.shape)
        found = evaluate(world.context, d_ggx, [up, h, np.full(len(h), alpha)])
        bad += int(np.sum(~np.isfinite(found)))
        worst = max(worst, float(np.max(np.abs(found / true - 1))))
    yield Figure("densities that are not finite", bad, 0, "a floor under the spread")
    yield Figure(
        "largest relative error of a density in ulp", worst / ULP, 32, "rounding: sine and cosine each by some ulp"
    )
    for roughness in (0.0, 1e-4, 0.03):
        metal = rm.Material((1, 0.8, 0.5), metalness=1.0, roughness=roughness)
        scene = rm.Scene(
            rm.sphere().material(metal), rm.Camera((0.2, 0.3, 3)), [rm.Sun(tuple(unit(np.array([0.2, 0.3, 3.0]))))]
        )
        frame = world.draw(scene, outputs=("color",))
        yield Figure(
            f"colours at roughness {roughness:g} that are not finite",
            int(np.sum(~np.isfinite(frame.color))),
            0,
            "alpha is at least 1e-3",
        )


@case(40, "rough surfaces at grazing angles")
def grazing_energy(world: World) -> Iterator[Figure]:
    """A microfacet model with the wrong masking function reflects more light than arrives."""
    n = 64
    u, v = (x.ravel() for x in np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n))
    for form, smith in (("correlated", v_smith), ("separable", v_smith_separable)):
        worst = 0.0
        for alpha in (0.1, 0.5, 1.0):
            for seen in (0.02, 0.1, 0.5, 1.0):
                cosine = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))
                sine = np.sqrt(1 - cosine**2)
                h = np.stack([sine * np.cos(2 * np.pi * v), sine * np.sin(2 * np.pi * v), cosine], axis=-1)
                eye = np.array([np.sqrt(1 - seen**2), 0, seen])
                both = h @ eye
                facing = (2 * both[:, None] * h - eye)[:, 2]
                given = [np.maximum(facing, 1e-6), np.full(len(facing), seen), np.full(len(facing), alpha)]
                masks = evaluate(world.context, smith, given)
                weight = np.where((facing > 0) & (both > 0), masks * 4 * facing * both / cosine, 0)
                worst = max(worst, float(weight.mean()))
        yield Figure(
            f"largest reflectance of white metal, {form}", worst, 1 + 2e-3, "white furnace test; 4,096 samples"
        )


@case(41, "soft shadow at t = 0")
def soft_start(world: World) -> Iterator[Figure]:
    """The cone of a soft shadow has width 0 at its start, where the surface itself is nearest."""
    sun = unit(np.array([0.3, 1.0, 0.2]))
    for penumbra in ("two-sided", "cone", "triangulated"):
        light = rm.Sun(tuple(sun), shadow=True, softness=0.05, penumbra=penumbra)
        node = (rm.plane() | rm.sphere(0.2).translate((0, 30, 0))).material(MATT)
        frame = world.draw(rm.Scene(node, rm.Camera((0, 1.0, 3.0), (0, 0, 0)), [light]), outputs=("color", "depth"))
        near = frame.depth < 20
        missing = float(np.max(np.abs(frame.color[..., 0][near] / sun[1] - 1)))
        yield Figure(f"light that a free plane lacks, {penumbra}", missing, 32 * ULP, "no occluder")


@case(59, "shadow ray that leaves the scene", before="86 evaluations a pixel to a far end")
def leaving(world: World) -> Iterator[Figure]:
    """A shadow ray towards the sun evaluates the field up to the far distance. It ends at the bounding box of the
    scene."""
    node = rm.box((1, 1, 1)) - rm.sphere(0.65)
    scenes = [
        rm.Scene(node | far, rm.Camera((2, 1.5, 3), (0, 0, 0)), [rm.Sun(shadow=True)])
        for far in (node, rm.plane(offset=-1e4))
    ]
    near, endless = (_evaluations(world, scene) for scene in scenes)
    yield Figure(
        "evaluations of a lit pixel, primary ray and shadow ray", near, 20, "SPEED: 15 where it ends at the box"
    )
    yield Figure("their share of those without a box", near / endless, 1, "the box shortens rays")


def _evaluations(world: World, scene: rm.Scene) -> float:
    """Of the field, by all rays of a pixel that shows the scene; counted by the shader itself."""
    size = (64, 48)
    scene = scene.replace(quality=scene.quality.replace(analytic=False))
    ready = prepare(scene, ("color",), size)
    text = ready.texts["color"]
    signatures = ("float field(vec3 p) {", "vec2 field_advance(vec3 p, vec3 d, float level, float growth) {")
    head = signatures[ready.plan.advance is not None]
    found, shown = "    Hit hit = trace(ray);\n", "    out_color = pixel_color(gl_FragCoord.xy);\n"
    assert text.count(head) == text.count(found) == text.count(shown) == 1
    text = text.replace(head, f"int asked = 0;\nbool met = false;\n{head}\n    asked++;")
    text = text.replace(found, f"{found}    met = hit.found;\n")
    text = text.replace(shown, f"{shown}    out_color = vec4(out_color.rgb * 0.0 + float(asked), met ? 1.0 : 0.0);\n")
    with Program(world.context, FULL_SCREEN, text, lambda line: ("", None), "count") as program:
        target = Target(world.context, size)
        try:
            program.draw(target, frame_uniforms(ready, Values({}), size))
            found = target.read()
        finally:
            target.release()
    return float(found[..., 0][found[..., 3] > 0].mean())
