"""Names and phrases that were replaced by the words of the field do not come back."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("raymarch", "docs", "examples")
SUFFIXES = {".py", ".glsl", ".md"}

FORMER = {
    r"wander(s|ed|ing)?\b": "path tracing",
    r"unbent\b": "geometric normal",
    r"openness\b": "ambient occlusion",
    r"glazed?\b": "dielectric",
    r"seen_before\b": "history",
    r"looks_of\b": "material evaluation",
    r"draft_by_draft\b": "draw_calls",
    r"u_camera_slope\b": "tan_half_fov",
    r"look_of\b": "material_expressions",
    r"moved_along\b": "directional_derivatives",
    r"tilt_of\b": "bump_gradient",
    r"at_moment\b": "with_hoisted",
    r"plan\.moments\b": "plan.hoisted",
    r"sky\.seen\b": "sky.radiance_along",
    r"u_heard\b": "u_site_mask",
    r"way_before\b": "motion_vector",
    r"random_of\b": "hash",
    r"rm\.held\b": "stop_gradient",
    r"CORRECTIONS\b": "REFINEMENTS",
    r"grazing\(": "directional_albedo",
    r"facets\(": "d_ggx",
    r"masking\(": "v_smith",
    r"entering\(": "interface_transmittance",
    r"leaving\(": "spawn_ray",
    r"settle\(": "refine_hit",
    r"exhausted\(": "on_exhausted",
    r"begun\(": "start_march",
    r"missed\(": "no_hit",
    r"cosine_lobe\b": "sample_cosine",
    r"facet_of\b": "sample_visible_normal",
    r"visible_facets\b": "pdf_visible_normal",
    r"Tone\(": "ToneMapping",
    r"Occlusion\(": "AmbientOcclusion",
    r"tracer=['\"]front['\"]": "tracer='bracketing'",
    r"ways=['\"]": "integrator",
    r"integrator=['\"](random|tree)['\"]": "integrator='path' or 'whitted'",
    r"Quality\([^()]*\btrust=": "assume_certified",
    r"Quality\([^()]*\bcorrection=": "refinement",
    r"Quality\([^()]*\bbudget=": "steps_per_pass",
    r"(Point|Spot)Light\([^()]*(\([^()]*\)[^()]*)*\bsoftness=": "radius",
    r"SpotLight\([^()]*(\([^()]*\)[^()]*)*\bangle=": "half_angle",
    r"(Sun|SunSky)\([^()]*(\([^()]*\)[^()]*)*\bdirection=": "sun_direction",
    r"Camera\([^()]*(\([^()]*\)[^()]*)*\bdirection=": "view_from",
    r"ImageSky\([^()]*\bturn=": "rotation",
    r"rm\.box\(\) - rm\.sphere\(0\.65\)": "rm.box(1)",
    r"SphereLight\([^()]*(\([^()]*\)[^()]*)*\bsize=": "radius",
}
"""Regular expressions of former words, from the beginning of a word, and the words that replace them."""

PATTERNS = [(re.compile(pattern), new) for pattern, new in FORMER.items()]  # a literal start is fast; no \b before it


def pages() -> list[Path]:
    """The README and all texts of the package, docs and examples; docs/names.md lists names of other tools."""
    files = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*") if file.suffix in SUFFIXES]
    return [ROOT / "README.md", *sorted(file for file in files if file != ROOT / "docs" / "names.md")]


def former_words(text: str) -> list[tuple[int, str, str]]:
    """Line, former word and replacement of each former word in a text."""
    return [
        (text.count("\n", 0, match.start()) + 1, match[0], new)
        for pattern, new in PATTERNS
        for match in pattern.finditer(text)
        if not re.match(r"\w", text[: match.start()][-1:])
    ]


def test_no_former_word_is_left() -> None:
    files = pages()
    assert len(files) > 200
    found = [
        f"{file.relative_to(ROOT)}:{line}: {word!r} is now {new!r}"
        for file in files
        for line, word, new in former_words(file.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("float a = grazing(v, r);", "grazing("),
        ("a\nrm.Quality(samples=4, trust=True)", "Quality(samples=4, trust="),
        ("rm.PointLight((0, 1, 2), color=(1, 0, 0), softness=3)", "PointLight((0, 1, 2), color=(1, 0, 0), softness="),
        ("rm.Occlusion(0.5)", "Occlusion("),
    ],
)
def test_a_former_word_is_found(text: str, word: str) -> None:
    assert [found[1] for found in former_words(text)] == [word]


@pytest.mark.parametrize(
    "text",
    [
        "at grazing angles",
        "random_of_pixel(3)",
        "rm.AmbientOcclusion(0.5)",
        "rm.SphereLight((0, 1, 0), radius=0.5)",
        "rm.PointLight((0, 1, 2)); rm.sphere(radius=1)",
        "def render(budget=16)",
    ],
)
def test_other_words_are_no_former_words(text: str) -> None:
    assert former_words(text) == []
