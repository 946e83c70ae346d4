"""Generated code of light that bounces: one random path per sample, or Whitted's tree of rays without randomness.

The tree is the bounded one of Huang, Chen and Cheng, "Signed Distance Field in Real-time Rendering" (2020), section 11:
GLSL has no recursion, so reflected rays wait until refracted ones are traced. The newest is traced first, so at most
one ray waits for each surface on the current path: in an array (a stack), or, where devices keep such arrays in slow
memory, as one bit, from which its path is followed again. Without glass there is a single chain from mirror to mirror.
"""

from __future__ import annotations

import numpy as np

from raymarch.expr.node import const
from raymarch.expr.pieces import constant, filled
from raymarch.plan import Plan
from raymarch.plan.lights import visible
from raymarch.plan.marching import films
from raymarch.scene.fields import SMOOTH
from raymarch.scene.reflectance import fresnel_dielectric, sample_rough_dielectric
from raymarch.scene.subsurface import scattering_albedo
from raymarch.shader.bsdf import Reflection
from raymarch.shader.chunk import Lines, Values
from raymarch.shader.fog import begin_shade, end_shade
from raymarch.shader.kinds import set_kind
from raymarch.shader.surface import geometric_normal_of, material_arguments, visible_side

DIFFUSE_ROUGHNESS = 0.4
"""Smallest roughness for highlights of lights after a diffuse reflection."""


def path_tracing(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """The colour of a hit: a random path over up to n bounces, with direct light at each surface.

    At the last bounce glass shows the sky's radiance, so that it does not turn black. Path regularisation (Kaplanyan
    2013): highlights on mirrors seen from rough surfaces are too rarely sampled, so their roughness is increased.
    """
    scene, glass = plan.scene, plan.glass is not None
    shines = bool(scene.lights) and plan.model != "phong"
    frosted = any(material.frosted for material in scene.materials)
    if glass:
        values.functions.append(sample_rough_dielectric if frosted else fresnel_dielectric)
    if reflection.scattered is not None:
        values.functions.append(scattering_albedo)
    inner = "    " * glass
    rough = [f"        regularized.material.{n} = max(surface.material.{n}, min_roughness);" for n in plan.bsdf.rough]
    metal, wide = plan.bsdf.metal, [f"surface.material.{name}" for name in plan.bsdf.rough[:1]]
    least = f"surface.material.{metal} < 1.0 ? {DIFFUSE_ROUGHNESS} : 0.0" if metal else str(DIFFUSE_ROUGHNESS)
    widest = f"max({wide[0]}, least)" if wide else "least"
    widened = [f"float least = {least};", f"min_roughness = max(min_roughness, {widest});"]
    shows = bool(visible(scene))
    begin_shade(text, plan, values, bounces=True)
    text.template(
        "path",
        {
            "SHINES": shines,
            "GLASS": glass,
            "FROSTED": frosted,
            "FILMS": films(scene),
            "EMITS": plan.emission is not None,
            "SHOWS": shows,
            "SUBSURFACE": reflection.scattered is not None,
        },
        entry=reflection.entry() if reflection.scattered is not None else "",
        bounces=scene.bounces,
        sky=scene.sky.lighting_function(None).name,
        visible="\n".join(visible_side(plan, "ray", "        ")),
        material=material_arguments(plan),
        regularized="\n".join(rough),
        shaded="regularized" if shines else "surface",
        inner=inner,
        widened="\n".join(f"{inner}        {line}" for line in widened),
        sample="\n".join(filled(f"{inner}        BsdfSample found = {reflection.sample()};", f"{inner}        ")),
        solid=geometric_normal_of(plan),
        side="side" if glass else "1.0",
        reflects=set_kind(plan, "reflection", "        "),
        sees=set_kind(plan, "camera", "    "),  # of the next sample
    )
    end_shade(text, scene, "first")


def tree(text: Lines, plan: Plan, values: Values, reflection: Reflection) -> None:
    """The colour of a hit: direct light, and the light of reflected and refracted rays over up to n bounces.

    Of the two rays at glass, if one is below the cutoff, the other takes its weight. Rays that are still inside glass
    at the last bounce return the sky's radiance, so that they do not turn black. A light reflected by two mirrors would
    be a highlight far below a pixel; a larger roughness widens it.
    """
    scene, glass = plan.scene, plan.glass is not None
    mirrors = not glass or any(m.mirrors for m in scene.materials)
    if glass:
        values.functions.append(fresnel_dielectric)
    bounce, ray = ("at.bounce", "at.ray") if glass else ("bounce", "ray")
    none = constant(const(np.zeros(reflection.per_lobe.shape)))
    rough = [f"lit.material.{name}" for name in plan.bsdf.rough if scene.lights and plan.model != "phong"]
    widened = [f"        if ({bounce} > 0) {name} = max({name}, {2.0 * SMOOTH});" for name in rough]
    shows, stack = bool(visible(scene)), plan.device.arrays
    alike = not glass and scene.fog is None and not scene.sky.apart  # the sky for all rays: one call
    begin_shade(text, plan, values, bounces=True, shows_sky=not alike)
    text.template(
        "whitted",
        {
            "GLASS": glass,
            "MIRRORS": mirrors,
            "LIGHTS": bool(scene.lights),
            "EMITS": plan.emission is not None,
            "SHOWS": shows,
            "STACK": stack,
        },
        bounces=scene.bounces,
        sky=scene.sky.lighting_function(None).name,
        turns=2 ** (scene.bounces + 1) - 1 if stack else (scene.bounces + 1) * 2**scene.bounces,
        traced_now="i > 0" if stack else "at.bounce >= known",
        fresh="" if stack else "!again && ",
        visible="\n".join(visible_side(plan, ray, "        ")),
        material=material_arguments(plan),
        lobes=reflection.per_lobe,
        camera=", true" * shows,
        traced=f"{bounce} < {scene.bounces} ? {reflection.traced()} : {none}" if mirrors else none,
        mirrored=reflection.mirrored() if mirrors else "",
        regularized="\n".join(widened),
        solid=geometric_normal_of(plan),
        reflects=set_kind(plan, "reflection", "            " if glass else "        "),
        sees=set_kind(plan, "camera", "    "),  # of the next sample
    )
    end_shade(text, scene, "first")
