"""Quality settings: accuracy against time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

from raymarch.conveniences import carried_out_by
from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import choice, integer, real, switch
from raymarch.scene.tracer import OwnTracer, TracerState
from raymarch.scene.value import Value, value

TRACERS = ("auto", "plain", "relaxed", "relaxed_again", "enhanced", "auto_relaxed", "bracketing", "advance")
NORMALS = ("analytic", "tetrahedron", "central", "forward")
SCHEDULES = ("auto", "single", "two", "four", "six", "cone", "cones")
REFINEMENTS = ("proven", "slope", "none")

MOST_SAMPLES = 4096
"""Maximum number of samples per pixel of a frame."""

RELAXATION = {"relaxed": 1.6, "relaxed_again": 1.6, "enhanced": 0.88}
"""Defaults of `omega`: the values of the tracers' authors; for "enhanced", the value that was measured best."""

CONTACT = 0.0625
"""A hit on a certified field is refined until the field is below this fraction of epsilon."""

LAST_STEP = 0.375
"""The last step of a refined hit is not evaluated. It is at most this fraction of epsilon; see march/refine.glsl."""

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "draft": {"epsilon": 0.5},
    "normal": {},
    "fine": {"epsilon": 0.02, "max_steps": 2048},
    "exact": {"epsilon": 0.002, "max_steps": 8192},
}
"""The settings of each preset that differ from the defaults."""

SINGLE_PASS: Mapping[str, Any] = {
    "schedule": "single",
    "steps_per_pass": None,
    "lights_per_pass": None,
    "temporal": "off",
}
"""The settings of a picture that is drawn in one pass, without earlier frames."""

NOT_MARCHING = (
    "assume_certified",
    "samples",
    "edges",
    "temporal",
    "steps_per_pass",
    "lights_per_pass",
    "rays",
    "masking",
    "energy_compensation",
    "integrator",
    "shadow_steps",
    "light_samples",
    "objects",
    "analytic",
    "bounding_volumes",
)
"""A preset does not change these fields. A preset is defined by the error of hits, which they do not affect."""

PROMISED: Mapping[str, float] = {"draft": 0.5, "normal": 0.05, "fine": 0.005, "exact": 0.001}
"""The error that defines each preset, in pixel footprints: 99 % of the hits on a certified field, silhouettes
excluded, lie within this distance of the reference, and no hit is missed. A test checks this for the examples and for a
lattice with edges in every pixel. `for_error` measures any scene. The last value is the limit of float32."""


@value
class Quality(Value):
    """Settings that trade accuracy against time.

    Parameters
    ----------
    tracer : marching algorithm of camera rays.

        - "auto": the plan chooses "advance" where all solids know it and it saves time, else "bracketing".
        - "plain": sphere tracing; each step is the distance (Hart 1996).
        - "relaxed": steps longer by `omega`, until one proves too long (Keinert et al. 2014).
        - "relaxed_again": as "relaxed", and relaxation resumes after a step that was too long.
        - "enhanced": step length from the slope of the last two samples (Bálint and Valasek 2018).
        - "auto_relaxed": step length from an averaged slope (Bán and Valasek 2023).
        - "bracketing": as "auto_relaxed", and the empty sphere of a step that was too long is kept.
        - "advance": as far as the ray is known to be free: by the tangent of each convex solid, else by the distance.
        - a function of a `TracerState`: the length of the next step, or (length, memory). A step that may have passed a
          surface is undone, whatever the function returns. Not with `steps_per_pass`.

        A field that is only an estimate is marched with "plain", unless `assume_certified` is set. If it is negative
        inside of its solid, "auto" and "bracketing" march it with "bracketing": by at most a pixel more than its value.
    max_steps : maximum number of steps of a camera ray, 1 to 60,000 (software renderers end loops at 65,535). Rays that
        leave a surface may take eight times as many: they start on it, and steps along it grow slowly. So may camera
        rays at 512, the default, up to 4,096 and in one pass: a camera may be close to a surface too. With a
        lower limit those may that rise from a surface at its end. Other rays that run out of steps show the surface
        that they are near.
    epsilon : the march ends where the field falls below this many pixel widths at that distance, 0.001 to 10; see
        `refinement`. None is 0.1, and the hit is then refined to a sixteenth of it. None is 0.5 for an estimate that is
        nowhere negative, such as that of `mandelbox`: its ray ends there, because it has no surface to refine hits on.
    normals : "analytic": gradients of the definitions. For comparison, finite differences: "tetrahedron" (4
        evaluations, error of first order in the step), "central" (6, second order), "forward" (4, first order).
    omega : relaxation factor: 1 to 2 for "relaxed" and "relaxed_again" (default 1.6), 0 to 1 for "enhanced" (default
        0.88). Not legal with other tracers.
    beta : weight of the newest slope in the average, above 0 and up to 1.
    step_scale : factor of the steps of all rays (camera, shadow and reflection), above 0 and up to 1; for fields that
        are too steep. Below 1, rays are marched with "plain" and without cones.
    step_variation : the steps of all rays are shortened by a random fraction up to this one, 0 to 0.9, for each pixel
        and sample. The error of an estimate then becomes noise, which `samples` remove, instead of rings.
    schedule : cone marching at coarser resolutions, which gives each ray a start distance.

        - "single": none.
        - "two", "four", "six": the resolutions of Bálint and Valasek 2018, each with a fraction of `max_steps`.
        - "cone": cones of 4 by 4 pixels, marched until they cannot advance.
        - "cones": cones of 16 by 16, then 4 by 4, then 2 by 2 pixels.
        - "auto": "cone" if the field is certified, `step_scale` and `step_variation` do not shorten its steps, and one
          evaluation for each pixel takes at least 1e8 operations in all: 2e7 if a marched solid is unbounded, 3e9 if
          none is and others have closed-form hits; else "single".
    refinement : end of a ray that came within `epsilon`. "proven": step along the slope, and evaluate the field to
        prove that the point is closer; a ray that only passes the surface marches on. "slope": one such step, without
        the proof. "none": the hit is the last sample.
    assume_certified : treat an estimate as a certified field, so that the given tracer and schedule apply to it. For
        comparisons.
    samples : number of camera rays per pixel and frame, distributed over the square of the pixel, 1 to 4096.
    edges : what smooths silhouettes. "samples": the mean of `samples`. "distance": coverage from the field, as a choice
        beside samples: the picture has one ray per pixel, and where it passes or enters a silhouette within a pixel,
        distances beside it tell what share of the pixel the solid covers. What lies behind fills the rest. Edges
        between materials, creases, shadows and patterns are not smoothed, and pixels at a corner only roughly. All
        bounded solids are marched. Only with samples=1 in one pass, for certified fields without `bounces`, lens and
        open shutter; the window draws such a scene with samples.
    temporal : reuse of earlier frames of the same `Renderer`. "off": none. "accumulate": while the picture stays the
        same, each frame adds its samples to the mean. "reproject": the same, and while the camera or the scene moves,
        earlier samples are reprojected.
    steps_per_pass : maximum number of steps of a ray in one pass, 4 to 60,000. The next pass resumes the march, until
        the ray ends or has taken `max_steps`. A frame with a time budget and
        temporal="accumulate" draws some pixels with all their steps instead, and the others in the next frames, while
        the picture stays the same. None: one pass. Only with samples=1.
    lights_per_pass : number of samples of light that one pass adds to the colour of surfaces in a frame with a time
        budget, 1 to 60,000, or "auto" for as many as fit into the budget, by the times of the passes before. A light is
        one sample, or `light_samples` of them; so is each step of AmbientOcclusion. Further passes add the next ones,
        until the budget is spent; rays are marched once. With temporal="accumulate" the next frame continues, while the
        picture stays the same. None: one pass adds all. It applies to scenes without `bounces`. Not with
        temporal="reproject".
    rays : "computed" for each pixel, or "interpolated" between the corners of the picture.
    masking : Smith masking-shadowing: "correlated" in height (Heitz 2014), or "separable", the product of masking and
        shadowing (Walter et al. 2007), which some renderers use.
    energy_compensation : metals include multiple scattering between microfacets (Kulla and Conty 2017), so that rough
        metals are not too dark. False is single scattering, as in Mitsuba and pbrt. Blender calls the two "Multiscatter
        GGX" and "GGX".
    integrator : light transport of a Scene with `bounces`. "path": traces one random path per sample, from all kinds of
        surfaces; it needs `samples` or several frames. "whitted": traces both the reflected and the refracted ray at
        each smooth surface, so that one sample shows mirrors and glass without noise. Rough and diffuse surfaces end
        its rays; they are lit by lights and by `Sky(light=True)`. For up to 4 bounces.
    shadow_steps : maximum number of steps of a shadow ray, 1 to 60,000. A ray that runs out is extrapolated in a
        straight line from its last two samples. None is eight times `max_steps`.
    light_samples : number of points on a light per camera ray, with penumbra="sampled" or a RectLight, 1 to 64. Each
        costs one shadow ray; each of `samples` costs a camera ray too. On smooth surfaces as many directions of the
        highlights are sampled too.
    objects : how the objects of a union are compiled. "text": each is lines of the shader. "data": objects that differ
        in numbers and materials only are rows of a texture, found through a grid of cells. "auto": data from 32 such
        objects on.
    analytic : hit solids in closed form. True: planes, spheres, boxes, cylinders, capsules, cones and ellipsoids that
        are operands of the outermost hard union, rotated, moved and scaled by one factor only, are intersected with
        each ray once; only the others are marched. False: all are marched. None: the plan chooses.
    bounding_volumes : evaluate operands of a hard union only where the distance to their bounding box is less than the
        distance to the operands evaluated before. This changes no value of the field. True: all operands with a box
        and a certified lower bound. False: none. None: those that are costly.

    Raises
    ------
    SceneError : a value outside its range, and for settings that exclude each other.
    """

    BELONGS: ClassVar[str] = "Scene(quality=...)"
    tracer: str | Callable[[TracerState], Any] = "auto"
    max_steps: int = 512
    epsilon: float | None = None
    normals: str = "analytic"
    omega: float | None = None
    beta: float = 0.4
    step_scale: float = 1.0
    step_variation: float = 0.0
    schedule: str = "auto"
    refinement: str = "proven"
    assume_certified: bool = False
    samples: int = 1
    edges: str = "samples"
    temporal: str = "off"
    steps_per_pass: int | None = None
    lights_per_pass: int | str | None = None
    rays: str = "computed"
    masking: str = "correlated"
    energy_compensation: bool = True
    integrator: str = "path"
    shadow_steps: int | None = None
    light_samples: int = 1
    objects: str = "auto"
    analytic: bool | None = None
    bounding_volumes: bool | None = None

    def __post_init__(self) -> None:
        if isinstance(self.tracer, str) and self.tracer in PRESETS:
            raise SceneError(f"Quality: tracer = {self.tracer!r}", legal=f"rm.Quality.preset({self.tracer!r})")
        if callable(self.tracer):
            self._set(tracer=OwnTracer.of(self.tracer))
        if isinstance(self.tracer, OwnTracer) and self.steps_per_pass is not None:
            raise SceneError("Quality: steps_per_pass with a tracer of your own", legal="all steps in one pass")
        for name, (convert, *range) in _CHECKS.items():
            given = getattr(self, name)
            apart = given is None if name in _OPTIONAL else isinstance(given, OwnTracer)
            if not apart and not (name == "lights_per_pass" and isinstance(given, str) and given == "auto"):
                self._set(**{name: convert(f"Quality: {name}", given, *range)})
        if self.steps_per_pass is not None and (self.samples > 1 or self.temporal == "reproject"):
            others = f"samples = {self.samples}, temporal = {self.temporal!r}"
            what = f"Quality: steps_per_pass = {self.steps_per_pass} with {others}"
            raise SceneError(what, legal="one ray a pixel, samples=1, and temporal 'off' or 'accumulate'")
        if self.edges == "distance":
            self._check_edges()
        if self.lights_per_pass is not None and self.temporal == "reproject":
            what = f"Quality: lights_per_pass = {self.lights_per_pass} with temporal = 'reproject'"
            raise SceneError(what, legal="temporal 'off' or 'accumulate'")
        if self.shortened and self.tracer not in ("auto", "plain"):
            name = "step_scale" if self.step_scale < 1 else "step_variation"
            raise SceneError(f"Quality: {name} with tracer = {self.tracer!r}", legal="tracer 'auto' or 'plain'")
        if self.omega is not None:
            if self.tracer not in RELAXATION:
                raise SceneError(
                    f"Quality: omega with tracer = {self.tracer!r}", legal=f"one of {', '.join(RELAXATION)}"
                )
            low, high = (0, 1) if self.tracer == "enhanced" else (1, 2)
            self._set(omega=real("Quality: omega", self.omega, low, high))

    def _check_edges(self) -> None:
        """SceneError for settings whose rays do not go through the centre of the pixel, all in one pass."""
        needed = {"samples": 1, **SINGLE_PASS, "schedule": self.schedule, "rays": "computed"}
        for name, only in needed.items():
            if getattr(self, name) != only:
                what = f"Quality: edges = 'distance' with {name} = {getattr(self, name)!r}"
                raise SceneError(what, legal=f"{name} = {only!r}, or edges = 'samples'")

    @property
    def secondary_steps(self) -> int:
        """Maximum number of steps of a ray that leaves a surface. At 0.5 degrees to the surface, 2,700 steps lead from
        1e-5 to 1e5 units."""
        return min(8 * self.max_steps, 60000)

    @property
    def camera_steps(self) -> int:
        """Maximum number of steps of a camera ray. A limit below the default saves time and is kept; the default ends
        no ray that looks along a surface, as from 1e-4 radii above a ball."""
        kept = self.max_steps < 512 or self.steps_per_pass is not None
        return self.max_steps if kept else max(self.max_steps, 4096)

    @property
    def rising_steps(self) -> int:
        """Maximum number of steps of a camera ray from whose last sample on the field rises. It has passed the surface,
        and shows what lies behind."""
        return max(self.camera_steps, 4096)

    @property
    def shortened(self) -> bool:
        """True if steps are shorter than the field allows."""
        return self.step_scale < 1 or self.step_variation > 0

    @classmethod
    @checked
    def preset(cls, name: str) -> Self:
        """A quality by its error: "draft", "normal" (the default), "fine" or "exact"; see `PROMISED`.

        Returns
        -------
        Self

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        return cls(**PRESETS[choice("Quality: preset", name, tuple(PRESETS))])

    def to_preset(self, name: str) -> Self:
        """This quality with the marching settings of a preset; the fields in `NOT_MARCHING` stay."""
        return type(self).preset(name).replace(**{kept: getattr(self, kept) for kept in NOT_MARCHING})

    @staticmethod
    def for_error(scene: Any, error: str, **where: Any) -> Quality:
        """The fastest quality, measured on this machine, whose error against the reference stays within a limit.

        Parameters
        ----------
        scene : a Scene.
        error : "0.5px": 99 % of the hits, silhouettes excluded, lie within half a pixel footprint of the reference.
            "flip:0.05": FLIP against the reference picture is at most 0.05 for 99 % of the pixels.
        where : size, time, params, backend, renderer; see `raymarch.cost.search.for_error`.

        Notes
        -----
        A setting that misses hits is never chosen. Raises CostError if no setting stays within the limit.
        """
        found: Quality = carried_out_by("for_error")(scene, error, **where).quality
        return found

    @staticmethod
    def for_time(scene: Any, time: str, **where: Any) -> Quality:
        """The most exact quality, measured on this machine, whose frames take at most a given time.

        Parameters
        ----------
        scene : a Scene.
        time : time of one frame, such as "16ms".
        where : size, moment, params, backend, renderer; see `raymarch.cost.search.for_time`.

        Notes
        -----
        Raises CostError if no setting that finds every hit is fast enough.
        """
        found: Quality = carried_out_by("for_time")(scene, time, **where).quality
        return found

    @property
    def footprint(self) -> float:
        """Width of the texture footprint of one ray of the first frame, in pixels; see `footprint_of`."""
        return self.footprint_of(0)

    def footprint_of(self, sample: int) -> float:
        """Width of the texture footprint of a sample of a picture, in pixels. It shrinks with the rays per pixel.

        sample : its number, 0 to samples - 1 in the first frame; later frames of temporal="accumulate" go on.

        N rays that average a pixel have footprints of the width N**-0.5, at least 1/8. The number of frames is not
        known ahead, so frame n has N**-0.5 / n: the mean of all variances then falls about as 1 / n, as with more rays.
        """
        width = self.samples**-0.5 / (sample // self.samples + 1)
        return float(max(min(width, 1.0 if self.temporal == "off" else 0.5), 0.125))

    def near(self, refined: bool) -> float:
        """Field value, in pixel widths, below which a ray refines its hit.

        refined : True if the surface is where the field is 0; see `raymarch.sdf.levels.has_levels`.
        """
        return self.epsilon if self.epsilon is not None else 0.1 if refined else 0.5

    def contact(self, refined: bool) -> float:
        """Largest field value at a hit, in pixel widths."""
        return self.near(refined) * (CONTACT if refined and self.refinement == "proven" else 1.0)


_CHECKS: Mapping[str, tuple[Any, ...]] = {
    "tracer": (choice, TRACERS),
    "normals": (choice, NORMALS),
    "schedule": (choice, SCHEDULES),
    "refinement": (choice, REFINEMENTS),
    "edges": (choice, ("samples", "distance")),
    "temporal": (choice, ("off", "accumulate", "reproject")),
    "rays": (choice, ("computed", "interpolated")),
    "masking": (choice, ("correlated", "separable")),
    "integrator": (choice, ("path", "whitted")),
    "objects": (choice, ("auto", "text", "data")),
    "max_steps": (integer, 1, 60000),
    "samples": (integer, 1, MOST_SAMPLES),
    "light_samples": (integer, 1, 64),
    "shadow_steps": (integer, 1, 60000),
    "steps_per_pass": (integer, 4, 60000),
    "lights_per_pass": (integer, 1, 60000),
    "epsilon": (real, 1e-3, 10.0),
    "beta": (real, 1e-3, 1.0),
    "step_scale": (real, 1e-3, 1.0),
    "step_variation": (real, 0.0, 0.9),
    "assume_certified": (switch,),
    "energy_compensation": (switch,),
    "analytic": (switch,),
    "bounding_volumes": (switch,),
}
"""What checks each field, and its legal values."""

_OPTIONAL = {"shadow_steps", "steps_per_pass", "lights_per_pass", "epsilon", "analytic", "bounding_volumes"}
"""The fields that may be None."""
