"""Shapes and light that were once found wrong, tried again from outside: the figure then and the figure now.

python -m tests.lab.trials [--row N]

Each row builds what was wrong, and other members of its family, through the public API. Its judge shares nothing with
the package: closed forms, quadrature, tiny steps in float64, or Mitsuba where it is installed. It prints what is
measured, the figure when it was found wrong, the figure now, and the most that is right. Rows 1 to 12, 24 and 25 are
about shapes, the others about light and pictures.
"""

from __future__ import annotations

import argparse
import sys
import time

from tests.lab.trials import facts, fillets, light, pictures, solids
from tests.lab.trials.row import Row

ROWS: dict[int, tuple[Row, ...]] = {
    1: (fillets.chains, fillets.tails),
    2: (fillets.walls,),
    3: (solids.flat_and_long,),
    4: (solids.flush_cuts,),
    5: (facts.turned,),
    6: (facts.ranges,),
    7: (facts.varied,),
    8: (solids.flat_torus,),
    9: (facts.far_from_a_mesh,),
    10: (fillets.sections,),
    11: (facts.refusals,),
    12: (facts.empty_frames,),
    13: (light.shown_lights,),
    14: (light.suns,),
    15: (light.written_otherwise,),
    16: (pictures.penumbras,),
    17: (light.cutting_lights,),
    18: (light.touching_lights,),
    19: (pictures.rooms,),
    20: (pictures.blooms,),
    21: (pictures.patterns,),
    22: (light.furnaces,),
    23: (pictures.budgets,),
    24: (solids.thin_parts,),
    25: (solids.skimming,),
    26: (pictures.hidden, facts.tapered),
}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--row", type=int, choices=ROWS, help="this row alone")
    given = parser.parse_args(arguments)
    wrong = 0
    for number in [given.row] if given.row else ROWS:
        for trial in ROWS[number]:
            start = time.process_time()
            for figure in trial():
                wrong += not figure.right
                verdict = "ok" if figure.right else "NOT OK"
                print(
                    f"{number:2} {figure.what}: then {figure.then}; now {figure.now:.3g}, "
                    f"at most {figure.bar:g}: {verdict}",
                    flush=True,
                )
            print(f"   {time.process_time() - start:.1f} s of CPU time", flush=True)
    print(f"{wrong} figures are not right")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
