"""Methods of nodes that arrays of rays and points ask; the layers above carry them out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.conveniences import carried_out_by
from raymarch.sdf.node import Node, method


@method
def raycast(
    node: Node,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    far: float = np.inf,
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
) -> Any:
    """The first points where rays meet the solid, in float64 on the CPU: `rm.raycast` of this node.

    Parameters
    ----------
    origins : (N, 3) or (3,), one point for all rays.
    directions : (N, 3) or (3,), of any length but 0. A ray that starts in the solid meets the surface where it leaves.
    far : largest distance, > 0.
    time : value of `rm.time` in seconds.
    params : values of parameters by name.

    Returns
    -------
    Hits
        `distance` (N,), inf where nothing was hit; `hit`, `position`, `normal`, `material` and `gap`.

    Raises
    ------
    SceneError : arrays of another shape, a direction of length 0, or values that are not finite.

    Examples
    --------
    >>> rm.sphere(1).raycast([(0, 0, 5), (0, 3, 5)], (0, 0, -1)).distance
    array([ 4., inf])
    """
    return carried_out_by("raycast")(node, origins, directions, far=far, time=time, params=params)


@method
def material_at(
    node: Node, points: ArrayLike, time: float = 0.0, params: Mapping[str, Any] | None = None
) -> NDArray[np.int64]:
    """The material of the part that decides the field at points, on the surface or anywhere.

    Parameters
    ----------
    points : (N, 3), or (3,) for one point.
    time : value of `rm.time` in seconds.
    params : values of parameters by name.

    Returns
    -------
    NDArray[int64]
        (N,), or () for one point: indices into `rm.Scene(node).materials`; 0 is the default, of parts without one.
        In a smooth blend, that of the part with the larger weight.

    Raises
    ------
    SceneError : an array of another shape, values that are not finite, or a value of a parameter out of range.

    Examples
    --------
    >>> both = rm.sphere(1) | rm.box().translate((3, 0, 0)).material(rm.Material(color="gold"))
    >>> both.material_at([(0, 0, 1), (3, 0, 1)])
    array([0, 1])
    """
    found: NDArray[np.int64] = carried_out_by("material_at")(node, points, time, params)
    return found
