"""A city of 160 x 160 blocks by repetition: height, width, turn and colour of each tower follow from its cell."""

import raymarch as rm

COUNT = (160, 1, 160)


def tower(cell):
    """A tower of two boxes; the downtown is higher."""
    one, other, third = rm.hash(cell), rm.hash(cell + 0.5), rm.hash(cell + 0.25)
    downtown = rm.exp(-0.0012 * (cell.x * cell.x + cell.z * cell.z))
    height = 0.3 + one * (0.9 + 3.5 * downtown)
    width = 0.45 + 0.2 * other
    wall = rm.clamp(rm.mix(rm.vec3(0.8, 0.55, 0.36), rm.vec3(0.2, 0.32, 0.45), third), 0.0, 1.0)
    body = rm.box((width, 2.0 * height, width))
    top = rm.box((0.6 * width, 2.0 * height * (1.0 + 0.35 * third), 0.6 * width))
    return (body | top).material(rm.Material(albedo=wall, roughness=0.5))


towers = rm.repeat_varied(tower, (1.0, None, 1.0), COUNT)
street = rm.plane().material(rm.Material(albedo=(0.09, 0.09, 0.1), roughness=0.9))

scene = rm.Scene(
    street | towers,
    camera=rm.Camera(position=(-9, 7, 26), target=(0, 0.5, 0), fov=40),
    lights=[rm.Sun(sun_direction=(-0.8, 0.6, 0.4), intensity=1.7, color=(1.0, 0.92, 0.8), shadow=True)],
    sky=rm.GradientSky(light=True),
    fog=rm.Fog(density=0.007),
)
