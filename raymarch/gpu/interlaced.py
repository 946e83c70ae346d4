"""Pictures within a budget of time: grids of pixels from coarse to fine, of which each pass is drawn in bands.

The grids are those of Adam7 (PNG, 8.2), or the finer of them: each pixel is in one, and the first has at least one of
64. A pixel of a grid stands for the pixels beside it until those are drawn. So a frame shows the whole picture as sharp
as its time allows, and what was drawn is never drawn again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from raymarch.gpu.draw_call import CENTRE, DrawCall
from raymarch.gpu.targets import Target
from raymarch.plan import Pass

if TYPE_CHECKING:
    from raymarch.gpu.draw_calls import Drawing

Size = tuple[int, int]

CELL = (8, 4)
"""Width and height of the least part of a pass that is drawn at once, in pixels: devices shade as many together."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Some pixels of a picture: every `stride`-th in x and y, from `first` on. Each stands for a block of pixels."""

    first: Size
    stride: Size
    block: Size

    def size(self, whole: Size) -> Size:
        """The number of its pixels in a picture, in x and y; may be 0."""
        width, height = (
            max(-(-(n - first) // s), 0) for n, first, s in zip(whole, self.first, self.stride, strict=True)
        )
        return width, height

    @property
    def uniforms(self) -> dict[str, Any]:
        """Where its pixels are in the picture, for the shader."""
        corner = tuple(first + 0.5 - 0.5 * s for first, s in zip(self.first, self.stride, strict=True))
        return {"u_grid_stride": self.stride, "u_grid_corner": corner}


WHOLE = Grid((0, 0), (1, 1), (1, 1))
ADAM7 = (
    Grid((0, 0), (8, 8), (8, 8)),
    Grid((4, 0), (8, 8), (4, 8)),
    Grid((0, 4), (4, 8), (4, 4)),
    Grid((2, 0), (4, 4), (2, 4)),
    Grid((0, 2), (2, 4), (2, 2)),
    Grid((1, 0), (2, 2), (1, 2)),
    Grid((0, 1), (1, 2), (1, 1)),
)
ORDERS = (
    (WHOLE,),
    (Grid((0, 0), (2, 2), (2, 2)), *ADAM7[5:]),
    (Grid((0, 0), (4, 4), (4, 4)), *ADAM7[3:]),
    ADAM7,
)
"""Grids whose first one has all pixels, a quarter, a sixteenth, or a sixty-fourth."""

SURE = 0.7
"""Fraction of a budget that the first grid of a picture is expected to take at most."""


def band(at: int, count: int, size: Size) -> tuple[tuple[int, int, int, int], int]:
    """A rectangle of cells of a target, (x, y, width, height), and the number of its cells.

    at : the number of cells before it, row by row. count : the largest number of its cells: whole rows, or part of one.
    """
    across = -(-size[0] // CELL[0])
    row, column = divmod(at, across)
    rows = count // across if column == 0 else 0
    cells = rows * across or min(count, across - column)
    width, high = (size[0], rows) if rows else (cells * CELL[0], 1)
    x, y = column * CELL[0], row * CELL[1]
    return (x, y, min(width, size[0] - x), min(high * CELL[1], size[1] - y)), cells


class Interlaced:
    """The draw calls of some passes of a frame within its budget. Updates `history.grid` as if they were drawn.

    The first frame draws the first grid, whatever the budget: there is a picture.

    drawing : the frame, by a plan that takes all steps of a ray in one pass.
    """

    def __init__(self, drawing: Drawing) -> None:
        self.drawing = drawing
        self.state, self.pace = drawing.history.grid, drawing.ready.cells
        self.passes = [each for each in drawing.ready.plan.passes if each.often != "level" and each.effect is None]
        self._latest: Target | None = None
        self._begins, self._any = not self.state.used, False
        if self._begins:
            self.state.used, self.state.order = True, self._order()
            self.pace.begin()
        self.grids = ORDERS[self.state.order]

    def __iter__(self) -> Iterator[DrawCall]:
        state = self.state
        while state.number < len(self.grids):
            grid = self.grids[state.number]
            if 0 not in grid.size(self.drawing.size):
                yield from self._grid(grid)
                if state.drawn < len(self.passes):
                    break
                self.pace.covered()
            state.next_grid()
        self.drawing.history.march.arrived = state.number == len(self.grids)
        for chosen in self.passes:
            if self._is_shown(chosen):
                target = self._whole(chosen)
                self.drawing.kept.setdefault(chosen.name, (chosen, target))
                self.drawing.carried |= {name: (target, i) for i, name in enumerate(chosen.writes)}
        self.drawing.carried |= WHOLE.uniforms

    def _order(self) -> int:
        """The number of the grids of which the first is expected to fit into the budget."""
        drawing, last = self.drawing, len(ORDERS) - 1
        assert drawing.budget is not None
        for number in range(last):
            if self.pace.whole(_cells(ORDERS[number][0].size(drawing.size))) <= SURE * drawing.budget.limit:
                return number
        return last

    def _is_shown(self, chosen: Pass) -> bool:
        return bool(chosen.outputs) or "u_color" in chosen.writes

    def _is_final(self, chosen: Pass, grid: Grid) -> bool:
        """True if a pass draws the whole picture itself: all its pixels are in one grid."""
        return grid is WHOLE and self._is_shown(chosen) and not chosen.history

    def _whole(self, chosen: Pass) -> Target:
        """The target of the whole picture."""
        drawing = self.drawing
        return drawing.resources.target(f"{drawing.history.name}{chosen.name} whole", drawing.size, chosen.textures)

    def _grid(self, grid: Grid) -> Iterator[DrawCall]:
        """The rest of the passes of a grid, as far as they fit into the budget."""
        state = self.state
        self.drawing.carried |= grid.uniforms
        size = grid.size(self.drawing.size)
        self._recall(grid)
        while state.drawn < len(self.passes):
            chosen = self.passes[state.drawn]
            yield from self._bands(chosen, grid, self._own(chosen))
            done = state.cells == _cells(size)
            rows = size[1] if done else state.cells // -(-size[0] // CELL[0]) * CELL[1]
            if rows > state.rows and self._is_shown(chosen) and not self._is_final(chosen, grid):
                yield self._fill(chosen, grid, rows)
                state.rows = rows
            if not done:
                return
            state.next_pass()
            state.drawn += 1

    def _recall(self, grid: Grid) -> None:
        """Let the next passes read those of the grid that earlier frames drew."""
        for chosen in self.passes[: self.state.drawn]:
            for _ in self._draw(chosen, grid, None, {}):
                pass

    def _own(self, chosen: Pass) -> dict[str, Any]:
        """The uniforms of the one sample of a pixel, with all its light."""
        drawing = self.drawing
        count = drawing.ready.plan.light_samples(drawing.inputs.light_turns) if chosen.lights == "each" else 0
        once = {"u_jitter": (0.0, 0.0), "u_sample": 0, "u_keep": False}
        return {**once, "u_first_sample": 0, "u_end_sample": count}

    def _bands(self, chosen: Pass, grid: Grid, uniforms: dict[str, Any]) -> Iterator[DrawCall]:
        """Bands of a pass, until all its cells are drawn or the time is over."""
        state, budget, size = self.state, self.drawing.budget, grid.size(self.drawing.size)
        assert budget is not None
        most = _cells(size)
        while state.cells < most:
            count = most if self._begins and state.number == 0 else 0
            count = count or self.pace.fitting(chosen.name, most - state.cells, budget, drawn=self._any)
            if not count:
                return
            tile, count = band(state.cells, count, size)
            last = state.cells + count == most
            yield from self._draw(chosen, grid, tile, uniforms, last=last)
            if budget.last is not None:
                self.pace.add(chosen.name, count, budget.last)
            state.cells, self._any = state.cells + count, True

    def _draw(
        self,
        chosen: Pass,
        grid: Grid,
        tile: tuple[int, int, int, int] | None,
        uniforms: Mapping[str, Any],
        *,
        last: bool = False,
    ) -> Iterator[DrawCall]:
        """The draw call of a tile of a pass of a grid; none without a tile. Later passes then read what it writes.

        last : whether this is the last tile.
        """
        drawing, size, suffix = self.drawing, grid.size(self.drawing.size), f" {self.state.number}"
        name, pair = drawing.pair_of(chosen) + suffix, None
        if self._is_final(chosen, grid):
            target = self._whole(chosen)
        elif chosen.history:
            pair = drawing.resources.pair(name, size, chosen.textures)
            target = pair.back
        else:
            target = drawing.resources.target(chosen.name + suffix, size, chosen.textures)
        if tile is not None:
            program, compiling = drawing.resources.program(drawing.ready, chosen.name)
            read = {name: (pair.front, i) for i, name in enumerate(chosen.history)} if pair else {}
            found = {
                **drawing.inputs.uniforms,
                **drawing.read_by(chosen),
                **(CENTRE if chosen.sharp else {}),
                **uniforms,
            }
            found |= {**read, **drawing.ready.constants.get(chosen.name, {})}
            self._latest = target
            yield DrawCall(replace(chosen, outputs={}), program, target, found, compiling, tile)
            if pair and last:
                pair.swap()
        written = pair.front if pair else target
        drawing.carried |= {name: (written, i) for i, name in enumerate(chosen.writes)}

    def _fill(self, chosen: Pass, grid: Grid, rows: int) -> DrawCall:
        """Show the rows of a grid up to one, in the whole picture."""
        drawing, state = self.drawing, self.state
        whole, (width, height) = self._whole(chosen), drawing.size
        uniforms: dict[str, Any] = {f"u_part_{i}": (self._latest, i) for i in range(chosen.textures)}
        uniforms |= {"u_at": grid.first, "u_every": grid.stride, "u_block": grid.block}
        begin = min(grid.first[1] + state.rows * grid.stride[1], height)
        end = min(grid.first[1] + rows * grid.stride[1], height)
        program = drawing.resources.utility(fill_text(chosen.textures), "fill")
        return DrawCall(chosen, program, whole, uniforms, 0.0, (0, begin, width, end - begin))


def _cells(size: Size) -> int:
    return -(-size[0] // CELL[0]) * -(-size[1] // CELL[1])


def fill_text(textures: int) -> str:
    """The shader that copies the pixels of a grid to the blocks of the picture that they stand for."""
    numbers = range(textures)
    return "\n".join(
        [
            "#version 330 core",
            *(f"uniform sampler2D u_part_{i};\nlayout(location = {i}) out vec4 out_{i};" for i in numbers),
            "uniform vec2 u_at;\nuniform vec2 u_every;\nuniform vec2 u_block;",
            "void main() {",
            "    vec2 away = floor(gl_FragCoord.xy) - u_at;",
            "    vec2 cell = floor((away + 0.5) / u_every);",
            "    if (any(lessThan(away, vec2(0.0))) || any(greaterThanEqual(away - cell * u_every, u_block))) discard;",
            *(f"    out_{i} = texelFetch(u_part_{i}, ivec2(cell), 0);" for i in numbers),
            "}\n",
        ]
    )
