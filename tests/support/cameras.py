"""Cameras of the package for views of closed forms."""

from __future__ import annotations

import raymarch as rm
from tests.support.analytic import View


def camera_of(view: View) -> rm.Camera:
    """The camera that sees what a view sees."""
    return rm.Camera(view.position, view.target, view.up, view.fov)
