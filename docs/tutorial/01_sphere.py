"""A sphere

A scene file is Python that leaves a value named `scene`. The shortest one is a single shape. Pictures, the window and
pages show it in a studio: on a ground, under a soft sun and a lit sky, with a camera that sees all of it. `rm.studio`
makes that scene, so that you can change its parts.
"""

import raymarch as rm

scene = rm.sphere(1.0)
