"""Boxes of random solids that turn: points outside, and the volumes over those of the tight boxes.

`python -m tests.lab.turned --chains 300` draws chains of 1 to 8 motions under time and parameters.
"""

from __future__ import annotations

import argparse

import numpy as np

from tests.support.turned_solids import drawn, measured, moments


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chains", type=int, default=300)
    parser.add_argument("--moments", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    print("kind                 chains  outside  median  90 %  largest  (volume of the box over that of the points)")
    for kind, calm, rigid in (("numbers", True, True), ("time and parameters", False, True), ("all", False, False)):
        found = []
        for i in range(given.chains):
            solid = drawn(random, 1 + i % 8, 200, calm, rigid)
            outside, ratio = measured(solid, moments(random, 1 if calm else given.moments))
            found.append((outside, ratio, solid.steps))
        ratios = np.array([ratio for _, ratio, _ in found])
        worst = max(found, key=lambda each: each[1])
        outside = max(outside for outside, _, _ in found)
        print(
            f"{kind:20} {given.chains:6}  {outside:7.1e}  {np.median(ratios):6.2f}  {np.quantile(ratios, 0.9):4.2f}  "
            f"{ratios.max():7.2f}  {' '.join(worst[2])}"
        )


if __name__ == "__main__":
    main()
