"""Methods of nodes whose types a decorator derives, so that editors and type checkers know them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raymarch.sdf.domain import Scalar, Vector
    from raymarch.sdf.node import Node


METHODS: dict[str, Callable[..., Any]] = {}
"""The functions of modules that import `Node` which nodes call, by name."""


class Methods:
    """The part of `Node` with the methods that operators give to it."""

    __slots__ = ()

    def _call(self, name: str, *args: Any, **kwargs: Any) -> Node:
        made: Node = METHODS[name](self, *args, **kwargs)
        return made

    def translate(self, offset: Vector) -> Node:
        """Move a solid, or a flat shape in its plane.

        Parameters
        ----------
        offset : (x, y, z), lengths; (x, y) for a flat shape. Numbers or expressions of `Param` and `time`.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : another number of components.

        Notes
        -----
        Exact for an exact solid.

        Examples
        --------
        >>> rm.sphere(1).translate((3, 0, 0)).distance((0, 0, 0))
        array(2.)
        """
        return self._call("translate", offset)

    def round(self, radius: Scalar) -> Node:
        """Grow by a radius, with rounded edges: the sum of the solid and a ball.

        Parameters
        ----------
        radius : a length >= 0. `box(1).round(0.1)` is 1.2 wide; `rounded_box` keeps the size.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a negative radius.

        Notes
        -----
        Exact outside for an exact solid.

        Examples
        --------
        >>> rm.box(1).round(0.1).bounds[1]
        array([0.6, 0.6, 0.6])
        """
        return self._call("round", radius)

    def shell(self, thickness: Scalar) -> Node:
        """A hollow solid, with half of the wall on either side of the surface.

        Parameters
        ----------
        thickness : of the wall, a length > 0.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a thickness that is not positive.

        Notes
        -----
        Exact for an exact solid.

        Examples
        --------
        >>> rm.sphere(1).shell(0.2).distance([(0, 0, 0), (1, 0, 0)])
        array([ 0.9, -0.1])
        """
        return self._call("shell", thickness)

    def offset(self, distance: Scalar) -> Node:
        """Move the surface along its normals.

        Parameters
        ----------
        distance : a length; positive grows the solid, negative shrinks it.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : what is no number.

        Notes
        -----
        Exact outside for an exact solid that grows.

        Examples
        --------
        >>> rm.sphere(1).offset(-0.25).bounds[1]
        array([0.75, 0.75, 0.75])
        """
        return self._call("offset", distance)

    def elongate(self, extent: Vector) -> Node:
        """Elongate along the axes: the section through the origin is extruded, the ends keep their shape.

        Parameters
        ----------
        extent : (x, y, z), lengths >= 0 by which the solid grows along each axis; (x, y) for a flat shape.

        Returns
        -------
        Node

        Raises
        ------
        SceneError : a negative length.

        Examples
        --------
        >>> rm.sphere(1).elongate((2, 0, 0)).bounds[1]
        array([2., 1., 1.])
        """
        return self._call("elongate", extent)

    def complement(self) -> Node:
        """The complement: everything outside this solid.

        Returns
        -------
        Node
            A node, whose distance is that of the solid with the other sign.

        Examples
        --------
        >>> rm.sphere(1).complement().distance((0, 0, 0))
        array(1.)
        """
        return self._call("complement")

    def transition(self, other: Node, start: Vector, end: Vector) -> Node:
        """A transition from this solid to another one along a line.

        Parameters
        ----------
        other : a bounded solid.
        start, end : distinct points, (x, y, z): this solid ends at the plane through `start`, the other begins at that
            through `end`.

        Returns
        -------
        Node
            A node, a bound.

        Raises
        ------
        SceneError : unbounded solids, or equal points.
        """
        return self._call("transition", other, start, end)

    def slice(self, z: Scalar = 0.0) -> Node:
        """The section of a solid in a plane of constant z, a flat shape.

        Parameters
        ----------
        z : of the plane, a length.

        Returns
        -------
        Node
            A flat node, a bound.

        Raises
        ------
        SceneError : a flat shape.

        Examples
        --------
        >>> rm.sphere(1).slice().distance((0, 0))
        array(-1.)
        """
        return self._call("slice", z)

    def visible(self, camera: bool = True, shadow: bool = True, reflection: bool = True) -> Node:
        """Hide this solid from kinds of rays.

        Parameters
        ----------
        camera, shadow : False hides it from camera rays, or from shadow rays.
        reflection : False hides it from rays that start at surfaces: reflected, refracted and random ones.

        Returns
        -------
        Node
            A node with the same field.

        Raises
        ------
        SceneError : what is no bool.

        Examples
        --------
        >>> rm.sphere(1).visible(shadow=False).name
        'visible'
        """
        return self._call("visible", camera, shadow, reflection)
