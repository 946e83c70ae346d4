"""A town at night under 1,024 street lamps, each with a range and a shadow."""

import colorsys

import numpy as np

import raymarch as rm

BLOCK, N = 5.0, 32  # edge of a block of houses; streets along each axis
random = np.random.default_rng(3)


def house(index):
    """A house of a block, of its own height and width."""
    height = 1.2 + 2.2 * rm.hash(index)
    width = 1.5 + 0.8 * rm.hash(index + 7.0)
    return rm.box((width, height, 3.2 - width * 0.5)).translate((0, height / 2, 0))


walls = rm.Material(albedo=(0.55, 0.5, 0.45), roughness=0.9)
street = rm.Material(albedo=rm.checker((0.34, 0.33, 0.32), (0.22, 0.22, 0.23), 0.5, axis="y"), roughness=0.5)
houses = rm.repeat_varied(house, (BLOCK, None, BLOCK)).material(walls)

# A lamp at each crossing, somewhat out of line, in colours from amber to white and a few blue ones.
crossing = BLOCK * (np.arange(N) - (N - 1) / 2)
places = np.stack(np.meshgrid(crossing, [2.2], crossing, indexing="ij"), axis=-1).reshape(-1, 3)
places[:, [0, 2]] += random.uniform(-0.6, 0.6, (N * N, 2))
hues = np.where(random.uniform(size=N * N) < 0.1, 0.58, random.uniform(0.06, 0.13, N * N))
tints = [colorsys.hsv_to_rgb(hue, 0.65, 1.0) for hue in hues]
lights = [rm.PointLight(at, tint, 6.0, shadow=True, range=6.0) for at, tint in zip(places, tints, strict=True)]

bulbs = np.tile(np.eye(4)[:3], (N * N, 1, 1))
bulbs[:, :, 3] = places
glow = [rm.Material(albedo=(0, 0, 0), emission=tuple(3.0 * np.array(tint))) for tint in tints[:64]]
lamps = rm.instances(rm.sphere(0.09), bulbs, (glow, np.arange(N * N) % 64))

scene = rm.Scene(
    rm.plane().material(street) | houses | lamps.visible(shadow=False),
    camera=rm.Camera(position=(2.2, 7, 30), target=(0, 0, 8), fov=50),
    lights=lights,
    sky=(0.005, 0.007, 0.014),
    fog=rm.Fog((0.005, 0.007, 0.014), 0.004),
    tone=rm.ToneMapping("aces"),
    post=[rm.Bloom(0.08)],
)
