"""Seeds faults into the hand-written GLSL, one at a time, and counts how many the suite notices.

python -m tests.lab.glsl_faults               # all that docs/figures/glsl_faults.json does not hold yet, hours in all
python -m tests.lab.glsl_faults march/refine  # of some modules, anew
python -m tests.lab.glsl_faults --functions   # by the functions alone, some minutes; leaves the ledger as it is

A fault takes out what somebody could forget: a clamp or floor (max, min, clamp), a guard (a line that returns, breaks
or goes on), a choice (one branch of `? :` for both), an absolute value, an offset (a factor of epsilon), or a reset.
Functions alone are asked first, at the ends of their ranges (tests/functions); then the hard cases of its folder are
looked at, then the tests. Told apart is what changes no bit of any frame of the cases and fails no test.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch import glsl
from raymarch.truth import silhouettes
from tests.hard.table import cases
from tests.hard.world import World
from tests.lab.fuzz import faults as unexplained
from tests.lab.long_runs import keep
from tests.lab.seeded import SEEDED, by_functions, by_tests, spoil
from tests.lab.watertight import solid
from tests.render.test_render_shading import EXACT, SOFT
from tests.support.shader_samples import scenes

LOOK = (80, 60)
LEDGER = Path(__file__).parents[2] / "docs" / "figures" / "glsl_faults.json"
MODULES = ("march", "light", "normal", "view", "path", "sky", "temporal", "probe")
ROWS = {
    "march": (1, 3, 27, 58, 54, 55, 2, 46, 56, 23, 47, 5, 35, 57, 29, 61),
    "light": (38, 41, 29, 39, 40, 35, 59),
    "normal": (31, 5, 6),
    "view": (44, 42, 43, 45, 46, 50, 54),
    "path": (30,),
    "sky": (39,),
    "temporal": (44, 42, 43, 45),
    "probe": (),
}
"""The rows that look at a folder of modules, those most likely to notice first."""


@dataclass(frozen=True)
class Fault:
    """A line of a module in a spoiled form."""

    module: str
    line: int
    kind: str
    text: str


def faults_of(name: str) -> Iterator[Fault]:
    """All faults of a module."""
    for i, line in enumerate(glsl.load(name, SEEDED).lines):
        code = line.partition("//")[0]
        if not code.strip() or code.startswith(("const", "uniform", "struct", "layout")):
            continue
        for call in ("max", "min", "clamp"):
            for spoiled in _without(code, call):
                yield Fault(name, i, call, spoiled)
        for match in re.finditer(r"\babs\(", code):
            yield Fault(name, i, "abs", code[: match.start()] + code[match.end() - 1 :])
        if re.match(r"\s+if \(.*\) (return|break|continue|\w+ = ).*;$", code.rstrip()):
            yield Fault(name, i, "guard", "")
        for spoiled in _chosen(code):
            yield Fault(name, i, "choice", spoiled)
        if "epsilon(" in code and "2.0 *" in code:
            yield Fault(name, i, "offset", code.replace("2.0 *", "0.0 *"))
        if re.match(r"\s+(slope = at\.slope = UNDONE|at\.passing = true|slope = 0\.0|\w+ = vec4\(0\.0\));", code):
            yield Fault(name, i, "reset", "")


def _without(code: str, call: str) -> Iterator[str]:
    """The line with the first argument alone in place of a call, once for each call."""
    for match in re.finditer(rf"\b{call}\(", code):
        depth, start, first = 0, match.end(), None
        for k in range(start, len(code)):
            if code[k] == "(":
                depth += 1
            elif code[k] == ")" and depth == 0:
                if first is not None:
                    yield code[: match.start()] + "(" + first + ")" + code[k + 1 :]
                break
            elif code[k] == ")":
                depth -= 1
            elif code[k] == "," and depth == 0 and first is None:
                first = code[start:k]


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


class seeded:
    """While it lasts, a module has the fault."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault

    def __enter__(self) -> None:
        self.original = spoil(self.fault.module, self.fault.line, self.fault.text)

    def __exit__(self, *_: object) -> None:
        glsl.load = self.original


@cache
def right(part: str) -> int:
    """The digest of all frames that the rows of a folder draw while nothing is wrong."""
    found, digest = _looked_at(part)
    assert not found, found
    return digest


def verdict(fault: Fault) -> str:
    """By what a fault is noticed; "missed", or "none" where every frame stayed as it was, bit for bit."""
    part = fault.module.partition("/")[0]
    expected = right(part)
    with seeded(fault), np.errstate(all="ignore"):
        found, digest = _looked_at(part)
    return found or ("none" if digest == expected else "missed")


def _looked_at(part: str) -> tuple[str, int]:
    """What is broken in the rows of a folder, or in three random scenes; and the digest of the frames."""
    wanted = ROWS[part]
    chosen = sorted((case for case in cases() if case.row in wanted), key=lambda case: wanted.index(case.row))
    with World() as world:
        try:
            for case in chosen:
                broken = next((f.quantity for f in case.measure(world) if not f.holds), None)
                if broken:
                    return f"{case.id}: {broken}", 0
            for name in looks() if part == "light" else ():
                if _is_off(world, looks()[name]):
                    return f"against the truth: {name}", 0
            wrong = [what for seed in (3, 4, 5) for what in unexplained(world, solid(seed), seed)]
        except Exception as error:
            return f"{type(error).__name__}", 0
        return (wrong[0] if wrong else ""), world.digest


@cache
def looks() -> dict[str, rm.Scene]:
    """Scenes of all models, lamps, skies and penumbras."""
    return {name: scenes()[name] for name in (*EXACT, *SOFT)}


@cache
def truth_of(scene: rm.Scene) -> Any:
    return rm.truth(scene, LOOK)


def _is_off(world: World, scene: rm.Scene) -> bool:
    """Colours that differ from the truth, silhouettes and a share for penumbras apart."""
    known = truth_of(scene)
    found = world.draw(scene, LOOK, ("color",)).color
    off = (np.abs(found - known.color) / np.maximum(known.color, 1.0)).max(axis=-1)[~silhouettes(known)]
    return not (np.mean(off > 1 / 255) < 0.05 and np.mean(off > 0.05) < 0.01)


def ledger() -> dict[str, str]:
    """What noticed each fault so far: "missed" for nothing, "none" for nothing because no frame has changed."""
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {}


def named(fault: Fault) -> str:
    code = fault.text.strip() or f"without: {glsl.load(fault.module, SEEDED).lines[fault.line].strip()}"
    return f"{fault.module}:{fault.line + 1} {fault.kind}: {code}"


def every(names: list[str]) -> list[Fault]:
    """The faults of some modules, of all if none is named."""
    folder = Path(glsl.__file__).parent
    names = names or sorted(f"{f.parent.name}/{f.stem}" for part in MODULES for f in folder.glob(f"{part}/*.glsl"))
    return [fault for name in names for fault in faults_of(name)]


def counts(known: dict[str, str]) -> tuple[int, int, int]:
    """How many were noticed, changed nothing, and were missed."""
    none = sum(found == "none" for found in known.values())
    missed = sum(found in ("missed", "not by functions") for found in known.values())
    return len(known) - none - missed, none, missed


def main(arguments: list[str]) -> int:
    names = [name for name in arguments if not name.startswith("-")]
    known = {} if "--functions" in arguments else ledger()
    for fault in every(names):
        if named(fault) in known and not names:
            continue
        found = by_functions(fault.module, fault.line, fault.text)
        if not found and "--functions" not in arguments:
            found = verdict(fault)
        if found in ("missed", "none"):
            found = by_tests(fault.module, fault.line, fault.text) or found
        found = found or "not by functions"
        known[named(fault)] = found
        print(f"{named(fault)} -> {found}", flush=True)
        if "--functions" not in arguments:
            known = {name: known[name] for name in map(named, every([])) if name in known}  # those of older texts go
            LEDGER.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    noticed, none, missed = counts(known)
    if "--functions" not in arguments:
        figures = {"of the faults that can be seeded": len(every([])), "tried": len(known), "noticed": noticed}
        keep("glsl_faults", **figures, **{"change no bit of any frame": none, "missed": missed})
    print(f"{noticed} of {noticed + missed} noticed; {none} more change no bit of any frame")
    return 0 if noticed >= 0.95 * (noticed + missed) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
