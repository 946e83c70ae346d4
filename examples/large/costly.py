"""Twenty costly solids of five forms. As rows in cells, each is evaluated only where it is near."""

import raymarch as rm


def spring(i):
    return rm.helix(0.34, 0.05 + 0.015 * i, 0.26, 3.2 - 0.3 * i)


def bowl(i):
    """An ellipsoid, hollowed by a ball."""
    return rm.ellipsoid((0.9, 0.6 + 0.1 * i, 0.9)) - rm.sphere(0.36 + 0.02 * i).translate((0, 0.24, 0))


def handle(i):
    return rm.bezier_tube((-0.4, -0.35, 0), (0.1 * i, 1.2 - 0.2 * i, 0.3), (0.4, -0.35, 0), 0.1)


def pebbles(i):
    """Two ellipsoids, blended."""
    lower = rm.ellipsoid((0.9, 0.5, 0.8)).translate((0, -0.18, 0))
    return rm.union(lower, rm.ellipsoid((0.5, 0.4, 0.6)).translate((0, 0.24, 0)), k=0.1).rotate(0.7 * i, "y")


def ring(i):
    """An ellipse, turned about an axis beside it."""
    return rm.ellipse((0.34, 0.1 + 0.04 * i)).revolve(0.26).rotate(1.2 - 0.2 * i, "x")


forms = (spring, bowl, handle, pebbles, ring)
colors = [(0.75, 0.3, 0.2), (0.85, 0.6, 0.25), (0.35, 0.55, 0.35), (0.3, 0.45, 0.7), (0.55, 0.35, 0.6)]
solids = [
    form(row).translate((1.3 * (column - 2), 0.45, -1.4 * row)).material(rm.Material(color=color))
    for row in range(4)
    for column, (form, color) in enumerate(zip(forms, colors, strict=True))
]
floor = rm.plane(offset=-0.05).material(rm.Material(color=(0.12, 0.2, 0.22), specular=0.0))

scene = rm.Scene(
    rm.union(floor, *solids),
    camera=rm.Camera(position=(2.2, 3.2, 5.2), target=(0.1, 0.2, -1.9), fov=42),
    lights=[rm.Sun(sun_direction=(0.6, 1.0, 0.5), shadow=True)],
    sky=rm.Sky((0.62, 0.72, 0.85)),
)
