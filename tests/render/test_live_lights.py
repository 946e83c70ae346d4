"""Lights come and go without another program."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan import light_cells, lights, plan, relit
from raymarch.plan.live_lights import LightMemory, LiveLights
from raymarch.scene.light import Light
from raymarch.scene.scene import Scene
from raymarch.shader import assemble

SIZE = (64, 40)
PLACES = np.random.default_rng(1).uniform((-4, 2, -4), (4, 5, 4), (64, 3))


@pytest.fixture
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer(SIZE) as made:
        yield made


def scene(lights: Sequence[Light], **more: object) -> Scene:
    solid = rm.sphere(1.0) | rm.box((0.8, 0.8, 0.8)).translate((1.5, 0, 0)) | rm.plane().translate((0, -1, 0))
    return rm.Scene(solid, camera=rm.Camera((0, 2, 6), (0, 0, 0)), lights=lights, **more)


def points(n: int) -> list[Light]:
    return [rm.PointLight(PLACES[i], intensity=20.0 / n, shadow=True) for i in range(n)]


def drawn(renderer: rm.Renderer, made: Scene, **more: object) -> tuple[np.ndarray, int]:
    """The picture of a scene, and the number of programs that are compiled for it."""
    before = renderer.resources.compiled
    picture = renderer.render(made, **more).color
    return picture, renderer.resources.compiled - before


def alone(made: Scene, **more: object) -> np.ndarray:
    with rm.Renderer(SIZE) as fresh:
        return fresh.render(made, **more).color


@pytest.mark.parametrize(
    ("numbers", "compiled"),
    [
        ((64, 63, 62, 64, 40, 9, 8, 7, 2, 3), [1] + 9 * [0]),
        ((1, 2, 3, 2, 8, 9, 20, 2, 3), [1, 1] + 7 * [0]),
        ((2, 3, 4, 5, 1, 2), [1, 1, 0, 0, 0, 0]),
    ],
)
def test_a_number_of_lights_compiles_nothing(
    renderer: rm.Renderer, numbers: tuple[int, ...], compiled: list[int]
) -> None:
    found = [drawn(renderer, scene(points(n))) for n in numbers]
    assert [each for _, each in found] == compiled
    for n, (picture, _) in zip(numbers, found, strict=True):
        np.testing.assert_allclose(picture, alone(scene(points(n))), rtol=0, atol=1e-6)


KINDS: list[Light] = [
    rm.Sun((1, 2, 1), intensity=0.3, shadow=True),
    rm.Sun((-1, 2, 1), intensity=0.3),
    rm.PointLight((2, 3, 1), range=6.0, shadow_radius=3.0, shadow=True),
    rm.SphereLight((0, 3, 2), 0.5, intensity=3.0, shadow=True, visible=True),
    rm.SpotLight((-2, 3, 2), (0.5, -1, -0.5), intensity=4.0),
    rm.Sun((1, 1, 2), intensity=0.2, shadow=True, softness=0.1),
]


def test_kinds_of_light_that_were_there_compile_nothing(renderer: rm.Renderer) -> None:
    """A light of a kind that the scene had may be the last of its kind to go, and may come again in any order."""
    drawn(renderer, scene(KINDS[:5]))
    drawn(renderer, scene(KINDS))
    for chosen in ([0, 2, 3], [5, 1], [4, 0, 1, 2], [3, 2], [0, 0, 5], [3], [2, 3, 5, 1, 4, 0]):
        made = scene([KINDS[i] for i in chosen])
        picture, compiled = drawn(renderer, made)
        assert compiled == 0, chosen
        np.testing.assert_allclose(picture, alone(made), rtol=0, atol=2e-6, err_msg=str(chosen))


def test_a_kind_that_is_new_compiles_once(renderer: rm.Renderer) -> None:
    counts = (0, 1, 2, 3, 2, 0)  # the second sun has the form of the first
    assert [drawn(renderer, scene([*points(2), *KINDS[:n]]))[1] for n in counts] == [1, 1, 0, 1, 0, 0]


def test_many_limited_lights_come_and_go(renderer: rm.Renderer) -> None:
    """Lights in cells stay in cells when few are left."""
    lamps = [rm.PointLight(at, intensity=2.0, range=4.0, shadow=True) for at in PLACES]
    counts = (64, 63, 8, 3, 20)
    found = [drawn(renderer, scene(lamps[:n])) for n in counts]
    assert [compiled for _, compiled in found] == [1, 0, 0, 0, 0]
    for n, (picture, _) in zip(counts, found, strict=True):
        np.testing.assert_allclose(picture, alone(scene(lamps[:n])), rtol=0, atol=1e-6)


def test_values_of_lights_may_depend_on_parameters_and_time(renderer: rm.Renderer) -> None:
    power = rm.Param("power", 2.0, 0.0, 9.0)
    lamps: list[Light] = [
        rm.PointLight((2, 3, 1), intensity=power, shadow=True),
        rm.Sun((rm.cos(rm.time), 1.0, rm.sin(rm.time))),
        rm.PointLight((-2, 3, 1), intensity=3.0, shadow=True),
        rm.SphereLight((0, 3, 2), radius=0.2 + 0.1 * rm.sin(rm.time), intensity=2.0),
    ]
    drawn(renderer, scene(lamps[:3]))
    drawn(renderer, scene(lamps))
    for chosen in (lamps[:1] + lamps[2:], lamps[2:], lamps[:2], lamps[1:3]):
        more = {"time": 0.7} | ({"params": {"power": 5.0}} if lamps[0] in chosen else {})
        picture, compiled = drawn(renderer, scene(chosen), **more)
        assert compiled == 0
        np.testing.assert_allclose(picture, alone(scene(chosen), **more), rtol=0, atol=1e-6)


def test_random_samples_are_those_of_the_lights_alone(renderer: rm.Renderer) -> None:
    """The random numbers of a light do not depend on what the scene had before."""
    quality = rm.Quality(samples=2, light_samples=2)
    lamps: list[Light] = [
        rm.RectLight((0, 3, 1), intensity=4.0, shadow=True),
        rm.SphereLight((2, 3, 1), 0.5, intensity=4.0, shadow=True, penumbra="sampled"),
        rm.RectLight((1, 3, 1), intensity=4.0, shadow=True),
    ]
    glossy = rm.Material(albedo=(0.8, 0.8, 0.8), metalness=1.0, roughness=0.2)
    made = [
        rm.Scene(
            rm.sphere(1.0).material(glossy) | rm.plane(offset=-1),
            rm.Camera((0, 2, 6)),
            lights=lamps[:n],
            quality=quality,
        )
        for n in (3, 2, 3)
    ]
    found = [drawn(renderer, each) for each in made]
    assert found[2][1] == 0
    for each, (picture, _) in zip(made, found, strict=True):
        np.testing.assert_allclose(picture, alone(each), rtol=0, atol=1e-5)


def test_lights_that_went_light_no_medium(renderer: rm.Renderer) -> None:
    """The text of a medium holds its lights."""
    smoke = rm.Medium(0.4, ((-2, -1, -2), (2, 2, 2)), steps=4, light_steps=2)
    for made in (scene(KINDS[3:4], fog=smoke), scene(KINDS[:3], fog=smoke), scene(points(9), fog=smoke)):
        np.testing.assert_allclose(drawn(renderer, made)[0], alone(made), rtol=0, atol=1e-6)


def test_textures_of_lights_are_of_one_kind_for_the_driver() -> None:
    """llvmpipe compiles a program again for the first texture whose height is a power of two, or is none."""
    for n in range(1, 70):
        rows = np.random.default_rng(n).uniform(size=(n, 3, 4)).astype(np.float32)
        made = lights.padded(rows)
        assert made.shape[1:] == (4, 4) and len(made) & (len(made) - 1) and len(made) <= max(n + 1, 3)
        assert np.array_equal(made[:n, :3], rows) and made[0, 3, 0] == n
    for n in (1, 30, 300):
        balls = np.random.default_rng(n).uniform(1.0, 9.0, (n, 4))
        height = len(light_cells.build(balls, np.zeros(3), np.full(3, 10.0)).texels)
        assert height & (height - 1)


def test_a_plan_with_other_lights_equals_a_new_one() -> None:
    """`relit` finds the shader's text, or says that it is another one."""
    memory = LightMemory()
    versions = [KINDS[:2], KINDS[:4], KINDS[2:4], KINDS, KINDS[3:]]
    live = [memory.fit(scene(given)) for given in versions]
    assert live[0] is None and all(isinstance(each, LiveLights) for each in live[1:])
    plans = [plan(scene(given), live=how) for given, how in zip(versions, live, strict=True)]
    texts = [assemble(each).text("color") for each in plans]
    for i, given in enumerate(versions[1:], 1):
        found = relit(plans[i - 1], scene(given), live[i])
        assert (found is not None) == (texts[i] == texts[i - 1])
        assert found is None or assemble(found).text("color") == texts[i]
    assert [a == b for a, b in zip(texts[1:], texts, strict=False)] == [False, True, False, True]
