"""Twelve chess pieces on a polished board, seen through a lens. Each kind is an outline that is revolved."""

import math

import raymarch as rm


def turned(*outline):
    """A solid of revolution from pairs of radius and height, bottom to top."""
    return rm.polygon([(0, outline[0][1]), *outline, (0, outline[-1][1])]).revolve().round(0.02)


def stem(height, waist=0.16, collar=0.27):
    """The foot, the waist and the collar of a piece."""
    foot = [(0.42, 0), (0.42, 0.1), (0.36, 0.16), (0.36, 0.22), (0.28, 0.3)]
    top = [(collar, 0.94 * height), (collar, height), (0.14, height + 0.06)]
    return turned(*foot, (waist, 0.62 * height), (waist, 0.92 * height), *top)


pawn = rm.union(stem(0.8, 0.14, 0.25), rm.sphere(0.23).translate((0, 1.02, 0)), k=0.04)

tower = rm.cylinder(0.3, 0.36).translate((0, 1.22, 0)) - rm.cylinder(0.2, 0.3).translate((0, 1.4, 0))
slot = rm.box((0.9, 0.16, 0.1)).translate((0, 1.38, 0))
rook = stem(1.0, 0.22, 0.3) | (tower - rm.union(*(slot.rotate(k * math.pi / 3, "y") for k in range(3))))

cut = rm.box((0.06, 0.5, 0.6)).rotate(-0.5, "z").translate((0.16, 1.7, 0))
mitre = rm.ellipsoid((0.46, 0.7, 0.46)).translate((0, 1.55, 0)) - cut
bishop = rm.union(stem(1.2), mitre, rm.sphere(0.07).translate((0, 1.94, 0)), k=0.03)

crown = turned((0.14, 1.5), (0.34, 2.0), (0.24, 2.0), (0.2, 1.9))
points = rm.sphere(0.075).translate((0.31, 2.0, 0)).polar(8)
queen = rm.union(stem(1.5), crown, points, rm.sphere(0.1).translate((0, 2.0, 0)), k=0.03)

cross = (rm.box((0.3, 0.09, 0.09)) | rm.box((0.09, 0.4, 0.09))).round(0.01).translate((0, 2.4, 0))
king = rm.union(stem(1.7), turned((0.14, 1.7), (0.3, 2.15), (0.05, 2.25)), k=0.03) | cross

ivory = rm.Material(albedo=(0.8, 0.7, 0.52), roughness=0.35)
ebony = rm.Material(albedo=(0.03, 0.022, 0.018), roughness=0.25)
squares = rm.checker((0.55, 0.42, 0.27), (0.09, 0.05, 0.03), 1.0, axis="y")

white = (
    (king, 0.5, 0.5),
    (queen, 1.5, -0.5),
    (bishop, -0.5, 1.5),
    (rook, -2.5, 0.5),
    (pawn, 1.5, 1.5),
    (pawn, -1.5, 2.5),
)
black = (
    (king, -0.5, -2.5),
    (queen, -1.5, -1.5),
    (bishop, -3.5, -2.5),
    (rook, 2.5, -2.5),
    (pawn, 0.5, -1.5),
    (pawn, 2.5, 0.5),
)
pieces = [
    piece.translate((x, 0.02, z)).material(look)
    for side, look in ((white, ivory), (black, ebony))
    for piece, x, z in side
]

board = rm.box((8, 0.3, 8)).translate((0, -0.15, 0)).material(rm.Material(albedo=squares, roughness=0.12))
rim = rm.box((9, 0.22, 9)).round(0.03).translate((0, -0.16, 0))
wood = rm.Material(albedo=(0.12, 0.06, 0.035), roughness=0.3)
table = rm.plane(offset=-0.33).material(rm.Material(albedo=(0.16, 0.13, 0.11), roughness=0.6))

warm, cool = rm.vec3(0.32, 0.27, 0.24), rm.vec3(0.5, 0.55, 0.65)
scene = rm.Scene(
    rm.union(*pieces) | board | rim.material(wood) | table,
    camera=rm.Camera(position=(3.4, 2.9, 5.6), target=(-0.2, 0.85, 0), fov=36, aperture=0.05, focus=6.0),
    lights=[rm.Sun(sun_direction=(-0.9, 1.0, 0.5), color=(1, 0.86, 0.68), intensity=2.6, shadow=True, softness=0.02)],
    sky=rm.Sky(lambda d: rm.mix(warm, cool, rm.smoothstep(-0.2, 0.8, d.y)), light=True),
    bounces=1,
    quality=rm.Quality(integrator="whitted", samples=16),
    tone=rm.ToneMapping("aces"),
)
