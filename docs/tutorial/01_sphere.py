"""A sphere

A scene file is Python that leaves a value named `scene`. The shortest one is a single shape. raymarch adds a camera
that sees all of it, one sun without shadow, and a plain sky.
"""

import raymarch as rm

scene = rm.sphere(1.0)
