"""Write docs/licences.md: the licences of the dependencies that are installed. `python docs/licences.py`."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import PackageNotFoundError, files, metadata, requires
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "licences.md"
HEAD = """# Licences of dependencies

After this page you know the licences of what raymarch installs: the packages that it needs, and those of each extra,
with their own dependencies. raymarch itself is under the MIT licence. The licences are those that the packages state.
`python docs/licences.py` writes this page from an environment with all extras; it is no legal advice.

Wheels may hold compiled libraries under other licences. Those of `av`, of the extra `video`, hold FFmpeg with x264 and
x265, which are under the GPL. No other part of raymarch needs that extra.

"""
OURS = ("docs", "test")
"""Extras for work on raymarch itself."""
SIGNS = {"Redistribution and use in source and binary forms": "BSD", "Permission is hereby granted": "MIT"}
"""Words of a licence, and its name."""


def name_of(requirement: str) -> str:
    """The normalised name of the package of a requirement."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement).group()).lower()


def below(requirements: list[str]) -> list[str]:
    """The packages of some requirements and all that these need on this system; no extras of theirs."""
    found: list[str] = []
    pending = [name_of(each) for each in requirements]
    while pending:
        name = pending.pop()
        if name in found or name == "raymarch":
            continue
        try:
            needs = requires(name) or []
        except PackageNotFoundError:
            continue  # of another system
        found.append(name)
        pending += [name_of(each) for each in needs if "extra ==" not in each]
    return sorted(found)


def licence(name: str) -> str:
    """What a package states: an SPDX expression, classifiers, or the first line of a text."""
    stated = metadata(name)
    if expression := stated.get("License-Expression"):
        return str(expression)
    kinds = [c.split(" :: ")[-1] for c in stated.get_all("Classifier", []) if c.startswith("License ::")]
    kinds = [kind for kind in kinds if kind != "OSI Approved"]
    text = (stated.get("License") or "").strip().split("\n")[0]
    return ", ".join(kinds) or text[:60] or in_file(name)


def in_file(name: str) -> str:
    """The licence whose words are in the file of a package that states none."""
    for file in files(name) or []:
        if file.name.upper().startswith("LICENSE"):
            words = file.read_text()
            return next((licence for sign, licence in SIGNS.items() if sign in words), f"see {file.name}")
    return "not stated"


def page() -> str:
    """The text of the page."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    groups = {"needed": project["dependencies"], **project["optional-dependencies"]}
    of_all = below(groups["needed"])
    lines = ["| for | package | licence |", "|---|---|---|"]
    for group, requirements in groups.items():
        if group not in OURS:
            own = [name for name in below(requirements) if group == "needed" or name not in of_all]
            shown = "every installation" if group == "needed" else f"`{group}`"
            lines += [f"| {shown} | {name} | {licence(name)} |" for name in own]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
