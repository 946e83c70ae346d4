"""How exact the picture shall be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

from raymarch.errors import SceneError
from raymarch.expr.convert import choice, integer, optional, real, switch
from raymarch.scene.value import Value, value

TRACERS = ("auto", "plain", "relaxed", "relaxed_again", "enhanced", "auto_relaxed", "bracketing")
MASKINGS = ("correlated", "separable")
NORMALS = ("analytic", "tetrahedron", "central", "forward")
SCHEDULES = ("auto", "single", "two", "four", "six", "cone", "cones")
REFINEMENTS = ("proven", "slope", "none")
TEMPORAL = ("off", "accumulate", "reproject")
RAYS = ("computed", "interpolated")
INTEGRATORS = ("path", "whitted")

RELAXATION = {"relaxed": 1.6, "relaxed_again": 1.6, "enhanced": 0.88}
"""What `omega` is where it is not given: what the tracers' authors use, and what was measured best for enhanced."""

CONTACT = 0.0625
"""The share of epsilon within which a ray must come to have hit a certified field."""

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "draft": {"epsilon": 0.5},
    "normal": {},
    "fine": {"epsilon": 0.02, "max_steps": 2048},
    "exact": {"epsilon": 0.002, "max_steps": 8192},
}
"""In what each preset differs from the default."""

NOT_MARCHING = (
    "assume_certified",
    "samples",
    "temporal",
    "steps_per_pass",
    "rays",
    "masking",
    "energy_compensation",
    "integrator",
    "shadow_steps",
    "light_samples",
)
"""What a preset leaves as a scene has it: it is defined by where hits lie, and these are for what is drawn of them."""

PROMISED: Mapping[str, float] = {"draft": 0.5, "normal": 0.05, "fine": 0.005, "exact": 0.001}
"""What defines each preset: how far, in pixel footprints, 99 % of the hits on a certified field may lie from the true
ones, silhouettes apart, with no hit missed; a test holds the examples to it, and a lattice with edges in every pixel.
`for_error` measures any scene. The last is what float32 allows."""

Search = Callable[..., "Quality"]
_searches: dict[str, Search] = {}


def provide_searches(for_error: Search, for_time: Search) -> None:
    """Enter what `Quality.for_error` and `Quality.for_time` call. Measuring stands above this room: `raymarch.cost`
    does it, and enters itself when it is imported."""
    _searches.update(error=for_error, time=for_time)


@value
class Quality(Value):
    """Choices between accuracy and time.

    Parameters
    ----------
    tracer : how a ray is marched. "auto" lets the plan choose. "plain": each step is the distance (Hart 1996).
        "relaxed": steps longer by `omega` until one proves too long (Keinert et al. 2014); "relaxed_again" goes on
        relaxing after that. "enhanced": steps by the slope of the last two samples (Bálint and Valasek 2018).
        "auto_relaxed": by an averaged slope (Bán and Valasek 2023). "bracketing": by the averaged slope, keeping samples
        that went too far. A field that is only an estimate is marched plainly, whatever is chosen, unless `assume_certified`.
    assume_certified : take an estimate for a certified field, so that the tracer and schedule that are asked for are used on it;
        to compare.
    max_steps : steps that a ray of the camera may take, 1 to 60,000 (software renderers end loops at 65,535). Rays that
        leave a surface may take eight times as many: they begin on it, and those along it grow slowly.
    schedule : which coarser pictures are marched first, to start rays where a cone around them ended. "single": none.
        "two", "four" and "six" resolutions: those of Bálint and Valasek 2018, each with its share of `max_steps`.
        "cone": cones of 4 by 4 pixels, marched until they can go on no more; "cones": of 16 by 16, then 4 by 4,
        then 2 by 2. "auto" lets the plan weigh what they save against their own cost.
    refinement : how a ray ends that came within `epsilon`. "proven": it steps along the slope and asks the field
        whether that is nearer; a ray that only passes goes on. "slope": one such step, not asked. "none": where it is.
    epsilon : a ray looks for its hit where the field falls below this many pixel widths at that distance, 0.001 to 10.
        None is 0.1 for a certified field, whose hit is then settled to a sixteenth of it; and 0.5 for an estimate,
        whose detail below a pixel has no normal worth showing, so that the ray ends there.
    normals : "analytic" gradients of the definitions; or finite differences, to compare: "tetrahedron" (4
        evaluations, error of first order in the step), "central" (6, second order), "forward" (4, first order).
    omega : factor of the relaxing tracers: 1 to 2 for "relaxed" (default 1.6), 0 to 1 for "enhanced" (default 0.88).
    beta : weight of the newest slope in the average, above 0 and up to 1.
    step_scale : steps of all rays, from the camera, to lights and in mirrors, are this part of the distance, above 0
        and up to 1; for fields that are too steep. Below 1 rays are marched plainly, without cones.
    masking : how microfacets hide each other, after Smith: "correlated" by their height (Heitz 2014), or "separable",
        as if the light's way in had nothing to do with its way out (Walter et al. 2007), which some renderers use.
    energy_compensation : metals give back the light that several of their facets mirror, one after the other (Kulla and
        Conty 2017), so that rough ones are not too dark. False is single scattering, as in Mitsuba and pbrt; Blender
        calls the two "Multiscatter GGX" and "GGX".
    step_variation : steps of all rays are shorter by up to this part, 0 to 0.9, chosen anew for each pixel and
        sample: the error of an estimate becomes noise, which `samples` take out, in place of rings.
    samples : rays a pixel in one frame, spread over the pixel's square, 1 to 4096.
    temporal : what one frame takes from those before. "off": nothing. "accumulate": while the picture stays the same,
        each frame adds its samples to the mean of all. "reproject": so too, and while the camera or the scene moves,
        what was seen before is found again where it went. Frames of one `Renderer` only.
    steps_per_pass : steps that a ray may take in one pass, 4 to 60,000; the march goes on in the next pass from where it
        stood, until it ends or has taken `max_steps`; with temporal="accumulate" also in the next frame, while the
        picture stays the same. None: one pass. For one ray a pixel.
    shadow_steps : steps that a ray towards a light may take, 1 to 60,000; one that runs out goes on in a straight line,
        as its last two samples lead. None is eight times `max_steps`.
    light_samples : points of a light's disc that each ray takes, with penumbra="sampled", 1 to 64. Each costs a ray
        towards the light, one of `samples` a ray of the camera too.
    rays : "computed" for each pixel, or "interpolated" between the corners of the picture.
    integrator : how light bounces, where a Scene has `bounces`. "path": each sample follows one random path, from surfaces of all
        kinds, so it takes `samples` or frames. "whitted": every sample follows both the reflected and the refracted ray at each
        smooth surface, so that one shows mirrors and glass without noise; rough and matte surfaces end it with the
        light of lights and `Sky(light=True)`. For up to 4 bounces.
    """

    tracer: str = "auto"
    max_steps: int = 512
    epsilon: float | None = None
    normals: str = "analytic"
    omega: float | None = None
    beta: float = 0.3
    step_scale: float = 1.0
    step_variation: float = 0.0
    schedule: str = "auto"
    refinement: str = "proven"
    assume_certified: bool = False
    samples: int = 1
    temporal: str = "off"
    steps_per_pass: int | None = None
    rays: str = "computed"
    masking: str = "correlated"
    energy_compensation: bool = True
    integrator: str = "path"
    shadow_steps: int | None = None
    light_samples: int = 1

    def __post_init__(self) -> None:
        self._begin()
        self._set(
            **{n: choice(f"Quality: {n}", getattr(self, n), legal) for n, legal in _CHOICES.items()},
            **{n: optional(_whole, n, getattr(self, n), *ends) for n, ends in _WHOLE.items()},
            **{n: optional(_within, n, getattr(self, n), *ends) for n, ends in _WITHIN.items()},
            assume_certified=switch("Quality: assume_certified", self.assume_certified),
            energy_compensation=switch("Quality: energy_compensation", self.energy_compensation),
        )
        for name in _NEEDED:
            if getattr(self, name) is None:
                raise SceneError(f"Quality: {name} = None", legal="a number")
        if self.steps_per_pass is not None and (self.samples > 1 or self.temporal == "reproject"):
            raise SceneError(
                f"Quality: steps_per_pass = {self.steps_per_pass} with samples = {self.samples}, temporal = {self.temporal!r}",
                legal="one ray a pixel, samples=1, and temporal 'off' or 'accumulate'",
            )
        if self.shortened and self.tracer not in ("auto", "plain"):
            name = "step_scale" if self.step_scale < 1 else "step_variation"
            raise SceneError(f"Quality: {name} with tracer = {self.tracer!r}", legal="tracer 'auto' or 'plain'")
        if self.omega is not None:
            if self.tracer not in RELAXATION:
                raise SceneError(
                    f"Quality: omega with tracer = {self.tracer!r}", legal=f"one of {', '.join(RELAXATION)}"
                )
            low, high = (0, 1) if self.tracer == "enhanced" else (1, 2)
            self._set(omega=_within("omega", self.omega, low, high))

    @property
    def secondary_steps(self) -> int:
        """Steps that a ray may take which leaves a surface. At 0.5 degrees to it, 2,700 lead from 1e-5 to 1e5 units."""
        return min(8 * self.max_steps, 60000)

    @property
    def shortened(self) -> bool:
        """True if steps are shorter than the field allows."""
        return self.step_scale < 1 or self.step_variation > 0

    @classmethod
    def preset(cls, name: str) -> Self:
        """A quality by the error that it keeps: "draft", "normal" (the default), "fine" or "exact"; see `PROMISED`."""
        return cls(**PRESETS[choice("Quality: preset", name, tuple(PRESETS))])

    def to_preset(self, name: str) -> Self:
        """This quality marched as a preset is; rays a pixel, light and what frames share stay: see `NOT_MARCHING`."""
        return type(self).preset(name).replace(**{kept: getattr(self, kept) for kept in NOT_MARCHING})

    @staticmethod
    def for_error(scene: Any, error: str, **where: Any) -> Quality:
        """The fastest quality, measured here and now, that keeps an error against the truth.

        Parameters
        ----------
        scene : a Scene.
        error : "0.5px": 99 % of the hits, silhouettes apart, lie within half a pixel's footprint of the true ones;
            "flip:0.05": FLIP against the true picture is at most 0.05 for 99 % of the pixels.
        where : size, time, params, backend, renderer, as `raymarch.cost.search.for_error` takes them.

        Hits are never missed for speed. Raises CostError if no setting keeps it.
        """
        return _searches["error"](scene, error, **where)

    @staticmethod
    def for_time(scene: Any, time: str, **where: Any) -> Quality:
        """The most exact quality, measured here and now, whose frames take at most a time such as "16ms".

        where : size, moment, params, backend, renderer, as `raymarch.cost.search.for_time` takes them.

        Raises CostError if no setting that finds every hit is fast enough.
        """
        return _searches["time"](scene, time, **where)

    @property
    def footprint(self) -> float:
        """Width, in pixels, of what one ray sees of a texture: with more rays a pixel each sees less."""
        rays = max(self.samples, 1 if self.temporal == "off" else 4)
        return float(max(rays**-0.5, 0.125))

    def near(self, certified: bool) -> float:
        """How near a ray comes, in pixel widths, before it looks for its hit."""
        return self.epsilon if self.epsilon is not None else 0.1 if certified else 0.5

    def contact(self, certified: bool) -> float:
        """The field, in pixel widths, at which a ray has met a surface: what a hit promises."""
        return self.near(certified) * (CONTACT if certified and self.refinement == "proven" else 1.0)


_CHOICES = {
    "tracer": TRACERS,
    "normals": NORMALS,
    "schedule": SCHEDULES,
    "refinement": REFINEMENTS,
    "temporal": TEMPORAL,
    "rays": RAYS,
    "masking": MASKINGS,
    "integrator": INTEGRATORS,
}
_WHOLE = {
    "max_steps": (1, 60000),
    "samples": (1, 4096),
    "light_samples": (1, 64),
    "shadow_steps": (1, 60000),
    "steps_per_pass": (4, 60000),
}
_WITHIN = {"epsilon": (1e-3, 10.0), "beta": (1e-3, 1.0), "step_scale": (1e-3, 1.0), "step_variation": (0.0, 0.9)}
_NEEDED = ("max_steps", "samples", "light_samples", "beta", "step_scale", "step_variation")


def _whole(name: str, value: Any, least: int, most: int) -> int:
    return integer(f"Quality: {name}", value, least, most)


def _within(name: str, value: Any, low: float, high: float) -> float:
    return real(f"Quality: {name}", value, low, high)
