"""A floor and a camera

`a | b` is the union of two solids. A plane has no end, so the scene now states where the camera stands. `position` and
`target` are points, y points up, and `fov` is the vertical field of view in degrees. The floor is painted, so that the
ball stands out: step 4 tells more.
"""

import raymarch as rm

ball = rm.sphere(1.0).translate((0, 1, 0))
floor = rm.plane().material(rm.Material(color=(0.1, 0.2, 0.25)))

scene = rm.Scene(
    ball | floor,
    camera=rm.Camera(position=(1.6, 3.0, 5.6), target=(0, 0.55, 0), fov=30),
)
