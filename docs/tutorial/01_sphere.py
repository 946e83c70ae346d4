"""A sphere

A scene file is Python that leaves a value named `scene`. The shortest one is a single shape. raymarch adds a camera
that sees all of it, one sun without shadow, and a plain sky. `raymarch render` draws such a shape in a studio: on a
ground, under a soft sun and a lit sky.
"""

import raymarch as rm

scene = rm.sphere(1.0)
