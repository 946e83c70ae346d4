"""6,000 spheres and boxes in one smooth blend, as rows of a texture. The nodes take some ten seconds to make."""

import numpy as np

import raymarch as rm

N = 6000
random = np.random.default_rng(3)
direction = random.normal(size=(N, 3))
direction /= np.linalg.norm(direction, axis=1, keepdims=True)
reach = 14.0 + 2.5 * np.sin(5.0 * direction[:, 0]) * np.cos(4.0 * direction[:, 1]) + random.normal(0.0, 0.25, N)
colors = ["#e76f51", "#f4a261", "#e9c46a", "#2a9d8f", "#457b9d"]
palette = [rm.Material(albedo=c, roughness=0.35) for c in colors]


def part(i):
    size = random.uniform(0.2, 0.45)
    solid = rm.sphere(size) if i % 2 else rm.box(1.6 * size)
    band = int((np.arctan2(direction[i, 2], direction[i, 0]) / np.pi + 1.0 + 0.5 * direction[i, 1]) * 5.0)
    return solid.translate(reach[i] * direction[i]).material(palette[band % len(palette)])


scene = rm.Scene(
    rm.union(*[part(i) for i in range(N)], k=0.25),
    camera=rm.Camera(position=(19, 22, 40), target=(0, 0, 0), fov=36),
    lights=[rm.Sun(sun_direction=(0.4, 0.9, 0.5), shadow=True)],
    sky=rm.GradientSky(light=True),
)
