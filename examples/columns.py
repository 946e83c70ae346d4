"""An infinite colonnade: one column, repeated. `gap` spaces the columns, and time moves the camera along them."""

import raymarch as rm

gap = rm.Param("gap", 3.0, min=2.2, max=5.0)

shaft = rm.cylinder(radius=0.5, height=4)
block = rm.box((1.5, 0.4, 1.5)).round(0.05)
column = rm.union(shaft, block.translate((0, 2.2, 0)), block.translate((0, -2.2, 0)), k=0.3)
hall = column.repeat((gap, None, gap)).material(rm.Material(color=(0.85, 0.8, 0.7)))
floor = rm.plane(offset=-2.3).material(rm.Material(color=(0.3, 0.25, 0.2)))

scene = rm.Scene(
    hall | floor,
    camera=rm.Camera(position=(gap / 2, 0.3, -gap * rm.time), target=(gap / 2 + 1, 0, -gap * rm.time - 4), fov=60),
    lights=[rm.Sun(sun_direction=(-1, 2, 1), shadow=True)],
    sky=(0.4, 0.52, 0.66),
    fog=rm.Fog(density=0.03),
)
