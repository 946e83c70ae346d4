"""A village of planar walls with a costly field, after the third scene of Bálint and Valasek (2018).

The camera looks down, so that every ray hits. `--set horizon=1` places it in the street.
"""

import math

import raymarch as rm
from raymarch.expr.vocabulary import mix, vec3, where

horizon = rm.Param("horizon", 0.0, min=0.0, max=1.0)

timber = rm.Material(color=(0.16, 0.09, 0.05), specular=0.05)
glass = rm.Material(color=(0.06, 0.1, 0.14), specular=0.6, shininess=120)
brick = rm.Material(color=(0.4, 0.16, 0.11), specular=0.02)
white = rm.Material(color=(0.75, 0.73, 0.68), specular=0.05)


def matte(red, green, blue):
    return rm.Material(color=(red, green, blue), specular=0.02)


def house(width, height, length, pitch, walls, tiles, rows):
    """A house: gables at the front (+z) and back, rows of windows on both long sides, a door and a window in front."""
    half, ridge = width / 2, height + pitch * width / 2
    under_roof = rm.plane(normal=(pitch, 1, 0), offset=ridge / (1 + pitch**2) ** 0.5).mirror("x")
    body = rm.box((width, ridge, length)).translate((0, ridge / 2, 0)) & under_roof
    side = rm.box((0.4, 0.7, 0.6)).repeat((None, None, length / rows), (1, 1, rows)).translate((half, height / 2, 0))
    front = rm.box((0.7, 0.7, 0.4)).translate((0, height, length / 2))
    doorway = rm.box((0.7, 1.3, 0.4)).translate((-width / 5, 0.65, length / 2))
    openings = rm.union(side.mirror("x"), front, doorway)
    interior = rm.box((width - 0.25, 1.2 * height, length - 0.25)).translate((0, 0.6 * height, 0))
    door = rm.box((0.7, 1.3, 0.06)).translate((-width / 5, 0.65, length / 2 - 0.1))
    bars = rm.box((0.05, 0.7, 0.06)).translate((0, height, length / 2 - 0.06))
    sill = rm.box((0.9, 0.08, 0.2)).translate((0, height - 0.38, length / 2 + 0.05))
    slope = (1 + pitch**2) ** 0.5
    run = (half + 0.35) * slope
    roof = (
        rm.box((run, 0.14, length + 0.7))
        .translate((run / 2, 0.07, 0))
        .rotate(-math.atan(pitch), "z")
        .translate((0, ridge, 0))
        .mirror("x")
    )
    chimney = rm.box((0.45, 1.4, 0.45)) | rm.box((0.6, 0.14, 0.6)).translate((0, 0.7, 0))
    return rm.union(
        (body - openings).material(walls),
        (interior & under_roof).material(glass),
        rm.union(door, bars, sill).material(timber),
        roof.material(tiles),
        chimney.translate((half / 2, ridge, -length / 5)).material(brick),
    )


def fence(length):
    """A fence along z."""
    posts = rm.box((0.1, 0.9, 0.1)).repeat((None, None, 0.6), (1, 1, round(length / 0.6))).translate((0, 0.45, 0))
    rails = rm.box((0.05, 0.1, length)).repeat((None, 0.4, None), (1, 2, 1)).translate((0, 0.65, 0))
    return (posts | rails).material(white)


def ground(p):
    """Albedo of a street with a kerb on both sides, and of grass."""
    away = abs(p.x)
    return where(away < 1.7, vec3(0.2, 0.19, 0.18), where(away < 2.1, vec3(0.45, 0.43, 0.4), vec3(0.12, 0.22, 0.05)))


red, slate, thatch = matte(0.45, 0.12, 0.06), matte(0.13, 0.15, 0.19), matte(0.4, 0.28, 0.12)
cream, rose, plaster = matte(0.75, 0.65, 0.45), matte(0.65, 0.38, 0.3), matte(0.7, 0.7, 0.68)
inn = house(4.2, 2.6, 6.0, 1.0, plaster, red, 3)
cottage = house(3.2, 1.8, 4.2, 1.2, cream, thatch, 2)
barn = house(4.8, 2.2, 5.2, 0.7, rose, slate, 2)
left, right = math.pi / 2, -math.pi / 2

village = rm.union(
    rm.plane().material(rm.Material(color=ground, specular=0.0)),
    inn.rotate(left, "y").translate((-5.6, 0, 1.5)),
    cottage.rotate(left, "y").translate((-4.8, 0, -4.2)),
    barn.rotate(0.2, "y").translate((-5.4, 0, -10.5)),
    cottage.rotate(right, "y").translate((4.8, 0, 2.6)),
    barn.rotate(right, "y").translate((5.5, 0, -3.0)),
    inn.rotate(right - 0.15, "y").translate((5.8, 0, -9.2)),
    fence(4.8).translate((-2.4, 0, 6.8)),
    fence(4.8).translate((2.4, 0, 6.6)),
)

scene = rm.Scene(
    village,
    camera=rm.Camera(
        position=mix(vec3(4.5, 12.5, 19), vec3(0.5, 1.7, 14.5), horizon),
        target=mix(vec3(-0.2, 0, -1.6), vec3(-0.3, 1.9, 0), horizon),
        fov=38,
    ),
    lights=[rm.Sun(sun_direction=(1.2, 1.6, 1.1), color=(1, 0.93, 0.8), intensity=1.15, shadow=True)],
    sky=rm.GradientSky(),
    fog=rm.Fog(density=0.004),
)
