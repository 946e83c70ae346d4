"""ToneMapping curves, exposure, dithering, and pictures that keep the light as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import raymarch as rm
from raymarch.cli.commands import app
from raymarch.expr.arrays import evaluator, row_blocks
from raymarch.expr.images import read_image
from raymarch.expr.srgb import linear_to_srgb, srgb_glsl, srgb_to_linear
from raymarch.expr.types import FLOAT
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from raymarch.scene.tone import COLOR, CURVES, ToneMapping, _steps, encode
from tests.support.glsl_harness import run
from tests.support.refusals import refused

LIGHT = np.concatenate([np.linspace(0, 2, 50), np.geomspace(2, 1e4, 50)])[:, None] * np.ones(3)


@pytest.mark.parametrize("curve", CURVES)
def test_a_curve_rises_and_stays_in_range(curve: str) -> None:
    shown = ToneMapping(curve).apply(LIGHT)
    assert shown.min() >= 0 and shown.max() <= 1 and np.all(np.diff(shown[:, 0]) >= -2e-3)
    assert shown[0].max() < 0.01 and shown[-1].min() > 0.9
    assert np.all(np.isfinite(ToneMapping(curve).apply(np.array([[np.nan, np.inf, -1.0]]))))


def test_greys_of_the_known_curves() -> None:
    """18 % grey and white; figures worked out from the published formulas by hand."""
    grey, white = np.full((1, 3), 0.18), np.full((1, 3), 1.0)
    assert np.allclose(ToneMapping("reinhard").apply(grey), 0.18 / 1.18) and np.allclose(
        ToneMapping("reinhard").apply(white), 0.5
    )
    for value, x in ((grey, 0.18), (white, 1.0)):
        fit = (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.432951) + 0.238081)
        assert np.allclose(ToneMapping("aces").apply(value), fit, atol=2e-3)
    assert np.allclose(ToneMapping("agx").apply(grey), 0.18, atol=0.04)  # AgX leaves middle grey about where it is


def test_exposure_counts_stops() -> None:
    light = np.array([[0.05, 0.1, 0.2]])
    assert np.allclose(ToneMapping(exposure=2).apply(light), 4 * light) and np.allclose(
        ToneMapping(exposure=-1).apply(light), light / 2
    )


def test_agx_turns_the_brightest_colours_white() -> None:
    dull, bright = (ToneMapping("agx").apply(light * np.array([[1.0, 0.01, 0.01]]))[0] for light in (0.2, 20.0))
    assert dull[1] < 0.2 * dull[0] and bright[1] > 0.5 * bright[0]
    clipped = ToneMapping().apply(np.array([[20.0, 0.2, 0.2]]))[0]
    assert clipped[1] < 0.3 * clipped[0]


@pytest.mark.parametrize("curve", CURVES)
def test_the_window_shows_what_the_picture_has(egl: Context, curve: str) -> None:
    text = f"""#version 330 core
uniform sampler2D light;
out vec4 color;
{ToneMapping(curve, 0.5).glsl()}
void main() {{ color = vec4(toned(texelFetch(light, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }}
"""
    light = np.random.default_rng(1).uniform(0, 1, (8, 16, 4)) * np.geomspace(1e-3, 1e3, 16)[:, None]
    with Target(egl, (16, 8)) as source, Target(egl, (16, 8)) as target:
        source.write(light)
        Program(egl, FULL_SCREEN, text, lambda line: ("", None), "test").draw(target, {"light": source})
        shown = np.clip(target.read()[..., :3], 0, 1)
    known = ToneMapping(curve, 0.5).apply(light[..., :3])
    np.testing.assert_allclose(encode(shown).astype(int), encode(known).astype(int), atol=1)


def test_srgb_is_that_of_the_standard_in_numpy_and_in_glsl(egl: Context) -> None:
    """IEC 61966-2-1, including both sides of the joint of line and power; GLSL to the rounding of its pow."""
    x = np.concatenate([np.linspace(0.0, 1.0, 1000), [0.0031307, 0.0031308, 0.0031309, 1e-6]])
    known = np.array([12.92 * v if v <= 0.0031308 else 1.055 * v ** (1.0 / 2.4) - 0.055 for v in x])
    np.testing.assert_allclose(linear_to_srgb(x), known, rtol=1e-14)
    np.testing.assert_allclose(srgb_to_linear(known), x, atol=1e-7)  # the limits of the standard are rounded
    found = run(egl, srgb_glsl(), "linear_to_srgb({0})", [(FLOAT, x)])
    np.testing.assert_allclose(found, known, atol=1e-6)


def test_the_code_of_each_value_is_the_rounded_transfer_function() -> None:
    """Just below and just above each value at which the code changes, and at even steps."""
    _, edges = _steps()
    changes = np.unique(edges[np.isfinite(edges)])
    assert len(changes) == 255
    values = np.concatenate([changes, np.nextafter(changes, 0.0), np.linspace(0.0, 1.0, 1_000_001)])
    linear, power = 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055
    assert np.array_equal(encode(values), np.rint(255.0 * np.where(values <= 0.0031308, linear, power)))
    odd = ToneMapping().image(np.array([[[np.nan, -np.inf, np.inf], [-1.0, -0.0, 2.0]]]))
    assert odd.tolist() == [[[0, 0, 255], [0, 0, 255]]]


@pytest.mark.parametrize("exposure", [0.0, 30.0, -30.0, 0.37])
def test_the_code_of_each_float32_is_that_of_float64(exposure: float) -> None:
    """Of any bits, with NaN of all kinds, and just below and just above each value at which the code changes."""
    tone = ToneMapping("linear", exposure)
    assert tone.steps is not None
    edges = np.unique(tone.steps.light[np.isfinite(tone.steps.light)])
    bits = np.random.default_rng(2).integers(0, 1 << 32, 100_000, dtype=np.uint32)
    odd = np.array([0x7F800000, 0x7F800001, 0x7FC00000, 0xFF800000, 0xFF800001, 0xFFFFFFFF, 0x80000000, 1], np.uint32)
    around = [np.nextafter(edges, np.float32(end)) for end in (-np.inf, np.inf)]
    values = np.concatenate([bits.view(np.float32), odd.view(np.float32), edges, *around])
    with np.errstate(invalid="ignore"):
        assert np.array_equal(tone.steps.codes(values), encode(tone.apply(values[:, None] * [1, 1, 1]))[:, 0])


def test_dithering_keeps_the_mean_and_repeats() -> None:
    ramp = np.broadcast_to(np.linspace(0.2, 0.21, 64)[None, :, None], (256, 64, 3))
    first, second = (ToneMapping(dither=True).image(ramp) for _ in range(2))
    assert np.array_equal(first, second)
    exact = 255 * (1.055 * ramp[0, :, 0] ** (1 / 2.4) - 0.055)
    assert np.abs(first.mean(axis=(0, 2)) - exact).max() < 0.06
    assert np.abs(ToneMapping().image(ramp).mean(axis=(0, 2)) - exact).max() > 0.3
    assert set(np.unique(first)) <= set(range(int(exact.min()), int(exact.max()) + 2))


def test_a_frame_is_shown_by_its_scenes_tone(egl: Context) -> None:
    scene = rm.Scene(rm.sphere(), sky=(4.0, 1.0, 0.2), tone=ToneMapping("reinhard"))
    with rm.Renderer((16, 12), context=egl) as renderer:
        frame = renderer.render(scene)
        assert frame.color.max() == 4.0
        assert np.array_equal(np.asarray(frame.image()), ToneMapping("reinhard").image(frame.color))


def test_light_is_written_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text("import raymarch as rm\nscene = rm.Scene(rm.sphere(), sky=(7.5, 1.0, 0.25))\n")
    done = CliRunner().invoke(app, ["render", str(file), "-o", str(tmp_path / "x.exr"), "--size", "16x12"])
    assert done.exit_code == 0, done.output
    assert np.array_equal(read_image("test", tmp_path / "x.exr")[0, 0], np.float32([7.5, 1.0, 0.25]))
    CliRunner().invoke(app, ["render", str(file), "-o", str(tmp_path / "d.exr"), "--size", "16x12", "--view", "normal"])
    normals = read_image("test", tmp_path / "d.exr")
    assert normals.shape == (12, 16, 3) and normals.min() < 0


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"curve": "filmic"}, ("curve = 'filmic'", "'agx'")),
        ({"exposure": 99}, ("exposure = 99", "-30 to 30")),
        ({"dither": 1}, ("dither = 1",)),
    ],
)
def test_a_tone_that_cannot_be_is_refused(parts: dict[str, Any], words: tuple[str, ...]) -> None:
    refused(lambda: ToneMapping(**parts), *words)


def test_every_curve_is_an_expression() -> None:
    for curve in CURVES.values():
        assert np.shape(evaluator([curve(COLOR)], [COLOR])(LIGHT)[0]) == LIGHT.shape


@pytest.mark.parametrize("exposure", [0.0, 1.0, -30.0, 30.0, 0.3, -2.7182818, 13.1])
def test_the_code_of_float32_light_is_that_of_the_curve(exposure: float) -> None:
    """Around each value at which the code changes and around the ends of all intervals; random and odd values."""
    tone = ToneMapping(exposure=exposure)
    steps = tone.steps
    assert steps is not None
    ends = np.arange(4097) / 4096 / 2.0**exposure
    near = np.concatenate([steps.light[np.isfinite(steps.light)], ends.astype(np.float32)])
    around = [near]
    for direction in (np.float32(0.0), np.float32(np.inf)):
        next_one = np.nextafter(near, direction)
        around += [next_one, np.nextafter(next_one, direction)]
    rng = np.random.default_rng(5)
    odd = np.float32([np.nan, np.inf, -np.inf, -0.0, -1.0, 1e-45, 3e38, 1e30, 2e30])
    bits = rng.integers(0, 2**32, 30_000, dtype=np.uint32).view(np.float32)
    shares = (rng.uniform(-0.1, 1.1, 30_000) / 2.0**exposure).astype(np.float32)
    light = np.resize(np.concatenate([*around, odd, bits, shares]), (32, 3600, 3))
    with np.errstate(invalid="ignore"):
        assert np.array_equal(tone.image(light), encode(tone.apply(light)))


@pytest.mark.parametrize("dither", [False, True])
def test_a_picture_that_is_converted_in_blocks_of_rows_is_the_whole(dither: bool) -> None:
    light = np.random.default_rng(3).random((7, 5000, 3)).astype(np.float32) * 3
    assert len(list(row_blocks(light))) == 4
    tone = rm.ToneMapping("aces", dither=dither)
    assert np.array_equal(tone.image(light), encode(tone.apply(light), dither))
    assert tone.image(light[:0]).shape == (0, 5000, 3)
