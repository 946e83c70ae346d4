"""Intervals of the proof against numbers of 40 digits: `python -m tests.lab.rounding [--count 1000000] [NAME ...]`."""

from __future__ import annotations

import argparse

import numpy as np

from tests.proof.test_rounding import ALL, drawn, outside

AT_ONCE = 20_000


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="operations; all if none is named")
    parser.add_argument("--count", type=int, default=1_000_000, help="arguments of each operation")
    given = parser.parse_args()
    failed = 0
    for name in given.names or ALL:
        rule, exact, _ = ALL[name]
        bad: list[tuple[float, ...]] = []
        tried = seed = 0
        while tried < given.count:
            values = drawn(name, AT_ONCE, 100 + 2 * seed)
            with np.errstate(all="ignore"):
                bad += outside(rule(*((v, v) for v in values)), exact, *values)
            tried, seed = tried + len(values[0]), seed + 1
        print(f"| {name} | {tried:,} | {len(bad)} |", *bad[:3], flush=True)
        failed += len(bad)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
