"""Seeds faults into the hand-written GLSL, one at a time, and counts how many the tests notice.

python -m tests.lab.glsl_faults               # those that the ledger does not hold; all: 20 CPU minutes
python -m tests.lab.glsl_faults --anew        # all
python -m tests.lab.glsl_faults march/refine  # of some modules, anew
python -m tests.lab.glsl_faults --missed      # those that nothing noticed, anew, by ten times as many tests
python -m tests.lab.glsl_faults --functions   # asks the tests of functions alone about those that nothing noticed
python -m tests.lab.glsl_faults --uses FILE   # keep in a file what the tests draw with, or take it from there

A fault takes out what somebody could forget: a clamp or floor (max, min, clamp), a guard (a line that returns, breaks
or goes on), a choice (one branch of `? :` for both), an absolute value, an offset (a factor of epsilon), or a reset.
Conditional lines have faults too. The tests that draw with the line are asked, those of single functions first
(tests/functions). A fault that no test notices changes no bit of any array that the tests read ("unchanged"), or some
("missed"). The ledger names a fault by its module and its line's text, and says why some are none ("none").
"""

from __future__ import annotations

import json
import random
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.lab.long_runs import keep
from tests.lab.seeded import ENOUGH, FOLDERS, PACKAGE, ROOT, Bench, arguments, calls, code_of, reads, run

LEDGER = ROOT / "docs" / "figures" / "glsl_faults.json"
FOLDER = PACKAGE / "glsl"
NOTICED = 0.85
"""Least share of all faults that is noticed."""
UNNOTICED = ("unchanged", "missed", "no test draws with it")


@dataclass(frozen=True)
class Fault:
    """A line of a module in a spoiled form. number : of the line in the file, from 1; `same` : how many equal lines of
    the module with the same fault are above it."""

    module: str
    number: int
    line: str
    kind: str
    text: str
    same: int = 0

    @property
    def name(self) -> str:
        """What the ledger calls it: no number of a line, which others move."""
        again = f" ({self.same + 1})" if self.same else ""
        return f"{self.module}{again}: {self.kind}: {code_of(self.line)} -> {code_of(self.text) or 'nothing'}"

    @property
    def file(self) -> Path:
        return file_of(self.module)

    @property
    def before(self) -> str:
        """The line as a shader has it, without its comment."""
        return code_of(self.line)


def file_of(module: str) -> Path:
    """The file of a module, or of a template, "shader/path"."""
    template = PACKAGE / f"{module}.glsl"
    return template if template.exists() else FOLDER / f"{module}.glsl"


def modules() -> list[str]:
    """All modules, and the templates of raymarch/shader."""
    found = [str(f.relative_to(FOLDER).with_suffix("")) for f in FOLDER.rglob("*.glsl")]
    return sorted(found) + sorted(f"shader/{f.stem}" for f in (PACKAGE / "shader").glob("*.glsl"))


def lines_of(module: str) -> list[str]:
    return file_of(module).read_text(encoding="utf-8").rstrip("\n").split("\n")


def faults_of(module: str) -> Iterator[Fault]:
    """All faults of a module."""
    seen: Counter[str] = Counter()
    for number, line in enumerate(lines_of(module), 1):
        code = line.partition("//")[0].rstrip()
        if not code.strip() or code.startswith(("#", "const", "uniform", "struct", "layout")):
            continue
        for kind, spoiled in dict.fromkeys(spoiled_lines(code)):
            fault = Fault(module, number, line, kind, spoiled)
            yield Fault(module, number, line, kind, spoiled, seen[fault.name])
            seen[fault.name] += 1


def spoiled_lines(code: str) -> Iterator[tuple[str, str]]:
    """The kinds of faults of a line, each with the line that has it."""
    for call in ("max", "min", "clamp"):
        for match in calls(code, call):
            given, end = arguments(code, match.end())
            yield call, f"{code[: match.start()]}({given[0]}){code[end + 1 :]}"
    for match in calls(code, "abs"):
        yield "abs", code[: match.start()] + code[match.end() - 1 :]
    if re.match(r"\s+if \(.*\) (return|break|continue|\w+ = ).*;$", code):
        yield "guard", ""
    for spoiled in _chosen(code):
        yield "choice", spoiled
    if "epsilon(" in code and "2.0 *" in code:
        yield "offset", code.replace("2.0 *", "0.0 *")
    if re.match(r"\s+(slope = at\.slope = UNDONE|at\.passing = true|slope = 0\.0|\w+ = vec4\(0\.0\));", code):
        yield "reset", ""


def _chosen(code: str) -> Iterator[str]:
    """The line with the one and with the other branch in place of a choice `? :`, for each choice."""
    for match in re.finditer(r" \? ", code):
        starts = re.compile(r"(?:.*(?<![=<>!])=(?!=)|\s*return)? *")
        before = code[_end(code, match.start() - 1, -1) + 1 : match.start()]
        begin = match.start() - len(before) + starts.match(before).end()  # type: ignore[union-attr]  # matches all
        end = _end(code, match.end(), 1)
        depth, colon = 0, match.end()
        while depth or code[colon : colon + 3] != " : ":
            depth += (code[colon] in "(") - (code[colon] in ")")
            colon += 1
        for branch in (code[match.end() : colon], code[colon + 3 : end]):
            yield f"{code[:begin]}({branch}){code[end:]}"


def _end(code: str, at: int, step: int) -> int:
    """Where the expression around a place ends, to the right or to the left."""
    depth = 0
    while 0 <= at < len(code):
        if depth == 0 and (code[at] in ",;" or code[at] == ("(" if step < 0 else ")")):
            return at
        depth += step * ((code[at] == "(") - (code[at] == ")"))
        at += step
    return at


def every(names: list[str]) -> list[Fault]:
    """The faults of some modules, of all if none is named."""
    return [fault for name in names or modules() for fault in faults_of(name)]


def drawing(bench: Bench, fault: Fault) -> list[str]:
    """The tests that draw with the line of a fault, in the order in which they are asked."""
    first, template = lines_of(fault.module)[0], fault.module.startswith("shader/")
    plain = [line for line in lines_of(fault.module) if line.strip() and "$" not in line and line[0] != "#"]

    def holds(lines: frozenset[str]) -> bool:
        if not template:
            return first in lines and fault.line in lines
        near = sum(line in lines for line in plain) > 0.3 * len(plain)
        return near and ("$" in fault.line or fault.line in lines)

    return bench.ordered(bench.drawing(holds), fault.module)


def verdict(bench: Bench, fault: Fault) -> str:
    """The test that notices a fault, or a word of UNNOTICED."""
    names = drawing(bench, fault)
    if not names:
        return "no test draws with it"

    def seed() -> Any:
        spoiled = reads(fault.file, fault.number, fault.text)
        spoiled.__enter__()
        return spoiled

    found = bench.verdict(seed, names)
    bench.note(fault.module, found)
    return found


def ledger() -> dict[str, dict[str, str]]:
    """What noticed each fault, or a word of UNNOTICED; and why a fault is none, for some that nothing notices."""
    return dict(json.loads(LEDGER.read_text(encoding="utf-8")))


def counts(known: dict[str, dict[str, str]]) -> tuple[int, int, int]:
    """How many faults were noticed, are none, and are missed."""
    unnoticed = [name for name, found in known["noticed"].items() if found in UNNOTICED]
    none = sum(name in known["none"] for name in unnoticed)
    return len(known["noticed"]) - len(unnoticed), none, len(unnoticed) - none


def wanted(given: list[str]) -> list[Fault]:
    """The faults that the arguments ask for, always in the same random order: what a part of a run asks is a sample."""
    known, faults = ledger(), every([name for name in given if not name.startswith("-")])
    random.Random(1).shuffle(faults)
    if "--functions" in given:  # new ones would make a sample of what these tests notice
        return [fault for fault in faults if known["noticed"].get(fault.name) in UNNOTICED]
    if "--missed" in given:
        faults = [fault for fault in faults if known["noticed"].get(fault.name, "missed") in UNNOTICED]
        return [fault for fault in faults if fault.name not in known["none"]]
    new = "--anew" in given or any(not name.startswith("-") for name in given)
    return [fault for fault in faults if new or fault.name not in known["noticed"]]


def main(given: list[str]) -> int:
    if "--help" in given or "-h" in given:
        print(__doc__)
        return 0
    uses = Path(given.pop(given.index("--uses") + 1)) if "--uses" in given else None
    functions_alone, faults, present = "--functions" in given, wanted(given), every([])

    def work(bench: Bench) -> None:
        known = ledger()
        for fault in faults:
            found = verdict(bench, fault)
            print(f"{fault.name} => {found}", flush=True)
            if found in UNNOTICED and functions_alone:
                continue
            known["noticed"][fault.name] = found
            kept = {what: {f.name: of[f.name] for f in present if f.name in of} for what, of in known.items()}
            LEDGER.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")

    if faults:
        longest = 10 * ENOUGH if "--missed" in given else ENOUGH
        run(work, FOLDERS[:1] if functions_alone else FOLDERS, uses, longest)
    seen, none, missed = counts(ledger())
    figures = {"faults that can be seeded": len(present), "tried": seen + none + missed, "noticed": seen}
    keep("glsl_faults", **figures, **{"no faults: they change nothing": none, "missed": missed})
    print(f"{seen} of {seen + missed} noticed; {none} more are none; of {len(present)} that can be seeded")
    return 0 if seen >= NOTICED * (seen + missed) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
