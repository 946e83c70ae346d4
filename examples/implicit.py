"""Implicit surfaces: Klein's bottle, the tangle cube and Steiner's Roman surface.

Each is a function of the point in one line, negative inside. No slope is stated: the shader bounds it along each ray.
"""

import raymarch as rm


def roman(p):
    x, y, z = p
    return x**2 * y**2 + y**2 * z**2 + z**2 * x**2 + x * y * z


def klein(p):
    a, b = rm.dot(p, p) + 2 * p.y - 1, rm.dot(p, p) - 2 * p.y - 1
    return a * (b**2 - 8 * p.z**2) + 16 * p.x * p.z * b


bottle = rm.implicit(klein, 4).scale(0.35).rotate(0.4, "y").material(rm.Material("#d9a521", shininess=90))
tangle = rm.implicit(lambda p: p.x**4 + p.y**4 + p.z**4 - 5 * rm.dot(p, p) + 11.8, 2.6)
triple = rm.implicit(roman, 0.6).scale(2.0).material(rm.Material("#3d6fc8", shininess=60))

scene = rm.Scene(
    tangle.scale(0.42).rotate(0.5, "y").translate((0, 1.3, 0)).material(rm.Material("#c8553d", shininess=60))
    | bottle.translate((-2.7, 1.1, 0.2))
    | triple.translate((2.5, 1.1, 0.3))
    | rm.plane().material(rm.Material(rm.checker("#9a9a92", "#c4c4ba", 1.2, axis="y"), specular=0.05)),
    camera=rm.Camera((0, 2.4, 7.5), (0, 0.9, 0), fov=40),
    lights=[rm.Sun((0.6, 1.0, 0.7), shadow=True), rm.Sun((-1, 0.3, 0.4), (0.5, 0.6, 0.8), 0.25)],
    sky=(0.62, 0.74, 0.88),
)
