"""Renews what is recorded of nodes and examples, and the pages that are generated from it.

python -m tests.lab.renew                 # after a new node or example: measures those without figures
python -m tests.lab.renew torus village   # after an intended change of these: measures them again too

It runs what could be run one by one: tests.lab.measure, tests.lab.ledger, docs/build.py and tests.hard.table --page.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.lab import ledger, measure
from tests.support.node_samples import definitions
from tests.support.records import unmeasured

ROOT = Path(__file__).parents[2]


def main(arguments: Sequence[str]) -> int:
    nodes = {d.name for d in definitions()}
    examples = {file.stem for file in ledger.EXAMPLES}
    unknown = [name for name in arguments if name not in nodes | examples]
    if unknown:
        print(f"no nodes or examples: {', '.join(unknown)}")
        return 2
    wanted = dict.fromkeys([*arguments, *unmeasured(), *ledger.missing()])
    failed = 0
    measured = [name for name in wanted if name in nodes]
    if measured:
        failed |= measure.main(measured)
    if found := [name for name in wanted if name in examples]:
        failed |= ledger.main(found)
    for command in (["docs/build.py", *(measured or ["--text"])], ["-m", "tests.hard.table", "--page"]):
        subprocess.run([sys.executable, *command], cwd=ROOT, check=True)
    return failed


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
