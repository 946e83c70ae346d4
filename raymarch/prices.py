"""The prices by which choices are made: one table, of which each class of devices has a copy.

Prices of an evaluation are in operations: multiplications, additions and the like of one ray. So a price that is not
known of a driver keeps its ratio to the others. `Prices.operation` turns them into nanoseconds.

Which choices ask is said at each price. What follows from several prices is a property. Limits beyond which a scene is
refused, and limits of memory, are not here: they are where they are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

OBJECT: Final = 10
"""Operations of a small object: a sphere that is moved."""

NEVER: Final = 1e15
"""A price that is never paid: what it buys is never chosen."""

LISTED: Final = 3
"""Objects in the cell of a point, as a rule: those that rows evaluate too."""

SAVED_FAR, SAVED, SAVED_BESIDE = 5.0, 1.0, 1 / 30
"""Evaluations per pixel that cones save: where a marched solid is unbounded, where all are bounded, and where these are
beside closed-form hits. Rays along unbounded solids take the most steps; where the floor is solved in closed form and
the others are bounded, cones save little. Evaluations do not depend on the device."""


@dataclass(frozen=True, slots=True)
class Prices:
    """What a device takes for each part of a choice. The defaults are those of llvmpipe.

    Of a ray
    --------
    operation : nanoseconds of an arithmetic operation, all rays of a picture together.
    read : operations that take as long as reading a texel. llvmpipe reads them one by one, 4 ns a ray.
    uniform : operations of parameters alone from which they are computed once for a frame, and passed.
    skip : operations of an operand from which its box decides whether it is evaluated. A software renderer skips the
        turns of loops only, and of all rays of a block together. CPU time: `python -m tests.lab.bounding`.
    unroll : operations of a loop that compilers must not unroll.
    look_up : operations to find the objects of a point through cells, beside those of the objects found. On llvmpipe
        the first five frames of 32 small objects take as long as with text; from 75 on each frame is faster as rows.
        See docs/scale.md; `python -m tests.lab.objects`.
    by_operations : True if objects count by their operations: measured prices were compared so, those of the classes
        for small objects.
    form : operations of a further form in the loop over the objects of a cell.
    advance : largest ratio of the operations that tell how far a ray is free to those of the distance. Where all solids
        are known along a ray, it takes a half to an eighth of the evaluations. CPU time of frames, 320x180, llvmpipe,
        least of 11 pairs: plates .47, columns .66, soft_shadows .85, smoothing .90, lights .91; csg, with a ratio of
        6.5, 1.01. `python -m tests.lab.advance`.

    Of a frame
    ----------
    draw : operations that a further pass before that of the picture takes in all, with its compiling. CPU time of
        frames with cones on llvmpipe: columns 85 % (2e7 operations of the field times pixels, 640x360) and 81 % (8e7,
        1280x720), its first frame .1 s more; village 84 % if all solids are marched (4e8), 98 % with closed-form hits
        (102 % at 1.6e9). One level takes 93 to 101 % of three.

    Of the first frame
    ------------------
    compile, compile_square : seconds of 1,000 operations in text without branches, and of their square. llvmpipe:
        chains of 100, 200 and 1,000 smooth unions take 4.5, 16 and 346 s, polygons of 50 and 100 corners 7 and 22 s.
        3,500 operations in bounding volumes, which are branches, take 6.5 s.
    closed_form : seconds of a solid that rays hit in closed form: see docs/marching.md.
    patience : seconds by which a choice that saves time in each frame may delay the first.
    slow_text : estimated seconds of text from which fewer objects become rows. Twelve chess pieces of five kinds have
        their first frame in half the time; further frames take 1.6 times as long. See docs/scale.md.
    costly_objects : operations of costly objects together from which they become rows: cells spare as many evaluations
        as boxes, in a shader with one function for each form. See docs/scale.md.

    Counts that follow from several prices, measured as they are
    ------------------------------------------------------------
    operands : least number of costly operands of a union with boxes: fewer make no frame faster.
    boxes : most boxes of marched solids to which a ray is clipped one by one; of more, one box around all.
    fewer_objects, fewer_alike : least number of costly objects, and of those of one form, that become rows: text would
        take long to compile.
    blended_forms : most forms of a blend as rows: each is evaluated for each object that is asked.
    forms_together : forms that share a loop: a form costs less than reading a list twice, and compilers take long for
        each texture fetch. CPU time of a frame of 30 objects of each form, 640x360, llvmpipe: of 5 forms .32 s in one
        loop and .48 s in loops of 4; of 12 forms 2.2 s in one loop, 1.9 s in loops of 4 or 6, 1.7 s in loops of 8.
    crowded : a cell with more objects is halved, if its children have fewer. Twice as many are needed for each further
        halving: a level costs every evaluation a read.
    halved : a cell is halved if its children have at most this share of its objects on average.
    fine_objects, fine_cells : a grid of a hard union of up to so many objects has so many cells for each: it is seldom
        halved, which saves evaluations a read. Larger unions have one cell for each: building them takes longer.
    group : least number of objects in a smallest cell, and of a group, that is worth a grid of its own. Each grid costs
        every evaluation a look-up.
    kept_objects, kept_seconds : objects, and seconds of their build, from which cells are kept on disk.
    lights : most lights written as code; more are rows of a texture, read in one loop.
    corners : most corners of a polygon that are constants of the shader; of more, text would take minutes to compile.
    copies : most copies of a polar pattern that are all evaluated.
    doubted : operations of an evaluation above which gaps and rods are not measured, which would take seconds.
    """

    operation: float = 0.05
    read: float = 80.0
    uniform: float = 24.0
    skip: float = 700.0
    unroll: float = 400.0
    look_up: float = 320.0
    by_operations: bool = False
    form: float = 80.0
    advance: float = 6.0

    draw: float = 1e8

    compile: float = 1.2
    compile_square: float = 1.3
    closed_form: float = 0.0495
    patience: float = 1.19
    slow_text: float = 10.0
    costly_objects: float = 20_000.0

    operands: int = 4
    boxes: int = 8
    fewer_objects: int = 4
    fewer_alike: int = 2
    blended_forms: int = 12
    forms_together: int = 8
    crowded: int = 4
    halved: float = 0.75
    fine_objects: int = 20_000
    fine_cells: int = 20
    group: int = 128
    kept_objects: int = 1000
    kept_seconds: float = 0.5
    lights: int = 8
    corners: int = 100
    copies: int = 24
    doubted: float = 400.0

    @property
    def objects(self) -> int:
        """Number of objects from which a union is rows of a table: finding them costs as much as they do."""
        return max(2, round(self.look_up / OBJECT))

    @property
    def alike(self) -> int:
        """Least number of objects of one form that are worth rows; fewer stay text."""
        return max(1, round(self.form / OBJECT))

    @property
    def closed_forms(self) -> int:
        """Most solids that are solved in closed form unless `Quality(analytic=True)`; of more, only the unbounded ones
        are. More delay the first frame by more than ten frames gain."""
        return int(self.patience / self.closed_form + 1e-6)

    def seconds(self, operations: float) -> float:
        """Estimated seconds to compile so many operations without branches, and to draw a first frame of them."""
        return self.compile * 1e-3 * operations + self.compile_square * 1e-6 * operations * operations

    def nanoseconds(self, operations: float) -> str:
        """The time of some operations of one ray, as text."""
        return f"{self.operation * operations:.2g} ns"

    def milliseconds(self, operations: float) -> str:
        """The time of the operations of all rays of a picture, as text."""
        return f"{self.operation * operations * 1e-6:.2g} ms"


STANDARD: Final = Prices()
"""The prices of choices that are made before a device is known: when a node is made, or a scene is doubted."""


SWITCH: Final = "RAYMARCH_MEASURED"
"""The variable of the environment that is "off" to plan with the prices of the class of a device alone."""
