"""The pages of docs/ as a whole: links and anchors, the navigation, the commands of shell blocks, and the tests and
messages that pages name. Only the long test builds the site."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
import warnings
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch import files
from raymarch.cli.commands import COMMANDS, load
from raymarch.errors import RaymarchError
from tests.lab.words import WAY, parts, words

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]


@cache
def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return re.sub(r"^(```|~~~).*?^\1", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


@cache
def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as code hosts and the site make them."""
    found: set[str] = set()
    for title in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE):
        plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title).replace("`", "")
        name = re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-")
        while name in found:
            name += "_1"
        found.add(name)
    return found


def broken(page: Path) -> list[str]:
    """The links of a page to files or anchors that do not exist, and its pictures without a description."""
    faults = []
    for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", prose(page))):
        file, _, anchor = link.partition("#")
        if re.match(r"\w+:", file):
            continue
        target = (page.parent / file).resolve() if file else page
        if not target.exists():
            faults.append(f"{link}: no such file")
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            faults.append(f"{link}: no such heading, one of {sorted(anchors(target))}")
    return faults + [f"a picture without a description: {each}" for each in re.findall(r"!\[\]\([^)]*\)", prose(page))]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_and_anchors_exist(page: Path) -> None:
    assert not broken(page)


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# A title, with `code`\n[a](#a-title-with-code) [b](#b) [c](c.md) ![](page.md)\n```\n[d](d.md)\n```\n"
    )
    assert [fault.split(":")[0] for fault in broken(page)] == ["#b", "c.md", "a picture without a description"]


@pytest.mark.parametrize("page", PAGES[1:], ids=NAMES[1:])
def test_a_page_begins_with_what_its_reader_can_do(page: Path) -> None:
    words = prose(page).split("\n\n")
    assert words[0].startswith("# ")
    assert words[1].startswith("After this page ") or page.stem == "index", words[1]


def test_the_navigation_has_every_page_once() -> None:
    named = re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
    assert sorted(named) == sorted(page.name for page in PAGES[1:])


def test_a_newcomer_comes_to_glass_within_3000_words() -> None:
    for page, following in pairwise(WAY):
        assert f"({following})" in prose(DOCS / page)
    last = sorted((DOCS / "tutorial").glob("*.py"))[-1].read_text(encoding="utf-8")
    assert "transmission=" in last and "transmission=" in (DOCS / WAY[-1]).read_text(encoding="utf-8")
    assert sum(map(words, WAY)) <= 3000


def test_proofs_and_experiments_stand_in_the_last_part() -> None:
    titles = list(parts())
    first = ["index.md", "First steps", "Scenes", "Light and camera", "Window", "Films and exports"]
    assert titles == [*first, "Accuracy in brief", "Development"]
    assert {"proofs.md", "stability.md", "accuracy.md", "theory.md", "marching.md"} <= set(parts()["Development"])


def test_no_sentence_stands_on_two_pages() -> None:
    """Sentences of twelve words or more; the README is the first page of the repository, index.md that of the site."""
    seen: dict[str, set[str]] = {}
    for page in PAGES[1:]:
        for sentence in re.split(r"(?<=[.:]) |\n\s*\n|\n(?=[-|*] )", prose(page)):
            plain = " ".join(re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", sentence).split())
            if len(plain.split()) >= 12:
                seen.setdefault(plain, set()).add(page.name)
    assert not {sentence: pages for sentence, pages in seen.items() if len(pages) > 1}


def test_extras_are_installed_by_their_packages() -> None:
    """No package of this name is published, so messages name the packages of an extra."""
    for extra, packages in files.EXTRAS.items():
        assert packages.split() == [re.match(r"[\w.-]+", each)[0] for each in EXTRAS[extra]]  # type: ignore[index]
    texts = [
        page.read_text(encoding="utf-8")
        for folder in ("raymarch", "docs")
        for page in (ROOT / folder).rglob("*.*")
        if page.suffix in (".py", ".md")
    ]
    assert not [text for text in texts if "install 'raymarch[" in text]


def test_the_readme_leads_to_every_page() -> None:
    """In two steps at most."""
    first = set(re.findall(r"\]\(docs/([\w-]+\.md)", prose(PAGES[0])))
    second = {name for page in first for name in re.findall(r"\]\(([\w-]+\.md)", prose(DOCS / page))}
    assert {page.name for page in PAGES[1:]} - first - second <= {"index.md"}


# Shell blocks.

BLOCK = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINES = sorted(
    {
        (name, line.strip())
        for name, page in zip(NAMES, PAGES, strict=True)
        for block in BLOCK.findall(page.read_text(encoding="utf-8"))
        for line in block.replace("\\\n", " ").splitlines()
    }
    | {
        (name, command)
        for name, page in zip(NAMES, PAGES, strict=True)
        for command in re.findall(r"`(raymarch [a-z]+ [A-Za-z][^`]*)`", prose(page).replace("\n", " "))
    }
)
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


def wrong(line: str) -> str:
    """Why a line of a shell block cannot run, or nothing."""
    for part in re.split(r"\s+(?:&&|\||>>?)\s+", line):
        words = shlex.split(part, comments=True)
        while words and re.match(r"\w+=|sudo$|xvfb-run$|-a$", words[0]):
            words = words[1:]
        program = Path(words[0]).name if words else ""
        if program == "raymarch" and len(words) > 1 and not words[1].startswith("-"):
            if fault := _unknown(words[1], words[2:]):
                return fault
        elif program in ("python", "python3") and words[1] == "-m" and words[2].startswith("tests."):
            if not (ROOT / (words[2].replace(".", "/") + ".py")).is_file():
                return f"no module {words[2]}"
        elif program in ("python", "python3", "bash") and words[1][:1] != "-" and "/" in words[1]:
            if not (ROOT / words[1]).is_file():
                return f"no file {words[1]}"
        elif program == "pip":
            extras = {extra for names in re.findall(r"\[([\w,]+)\]", part) for extra in names.split(",")}
            if unknown := extras - EXTRAS.keys():
                return f"no extra {unknown}"
    return ""


def _unknown(command: str, words: list[str]) -> str:
    """What a command of the program does not know: itself, an option, a scene file of the repository."""
    if command not in COMMANDS:
        return f"no command {command}"
    options = {name for parameter in load(command).params for name in (*parameter.opts, *parameter.secondary_opts)}
    for word in words:
        name = word.partition("=")[0]
        if re.match(r"--?[a-z]", name) and name not in options | {"--help"}:
            return f"no option {name} of {command}"
        if word.startswith(("examples/", "docs/")) and not (ROOT / word).is_file():
            return f"no file {word}"
    return ""


def test_the_commands_of_shell_blocks_exist() -> None:
    assert len(LINES) > 60
    faults = [f"{name}: {line}: {fault}" for name, line in LINES if (fault := wrong(line))]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    "line",
    [
        "raymarch paint scene.py",
        "apt-get update && .venv/bin/raymarch render scene.py --sizes 4x4",
        "raymarch render examples/helo.py",
        "python -m tests.lab.nothing",
        "bash tests/walk.sh",
        "pip install '.[views]'",
    ],
)
def test_a_wrong_command_is_found(line: str) -> None:
    assert wrong(line)


# What pages name.


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_the_tests_that_a_page_names_exist(page: Path) -> None:
    for file, name in re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", prose(page)):
        assert re.search(rf"^def {name}\(", (ROOT / file).read_text(), re.MULTILINE), f"{file}::{name}"


def cells(page: str, heading: str) -> list[list[str]]:
    """The rows of the tables below a heading of a page."""
    section = prose(DOCS / page).partition(f"## {heading}\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (.+) \|$", section, re.MULTILINE)[1:]
    return [re.split(r" (?<!\\)\| ", row) for row in rows]


TOOLS = ("Shadertoy and GLSL", "fogleman/sdf", "OpenSCAD", "Blender")


@pytest.mark.parametrize("tool", TOOLS)
def test_our_side_of_a_comparison_runs(tool: str) -> None:
    given = {name: getattr(rm, name) for name in ("Material", "Quality", "Scene", "Sun", "AmbientOcclusion")}
    given |= {"rm": rm, "np": np, "ToneMapping": rm.ToneMapping, "Scene": lambda **parts: rm.Scene(rm.box(1), **parts)}
    given |= {"a": rm.sphere(0.4), "b": rm.box(1), "f": rm.sphere(0.4), "g": rm.box(1), "node": rm.sphere(0.4)}
    given |= {"c": 2, "s": 2, "k": 0.2, "angle": 1, "axis": "y", "p0": (0, 0, 0), "p1": (0, 1, 0), "radius": 0.1}
    given |= {"t": 0.1, "r": 0.5, "rate": 0.2, "balls": [rm.sphere(), rm.box(1)], "positions": [(0, 0, 0), (2, 0, 0)]}
    ran = 0
    for row in cells("coming-from.md", tool):
        for code in re.findall(r"`([^`]+)`", row[-1].replace("\\|", "|")):
            if "..." in code or "export" in code or "(" not in code or re.search(r"=[,)]", code):
                continue
            here = given | ({"c": (0, 1, 0)} if "translate(c)" in code else {})
            if "capsule(a, b" in code:
                here |= {"a": (0, 0, 0), "b": (0, 1, 0)}
            if code.endswith(('.hdr")', '.stl")', "cells=256)")):
                continue  # they need files
            eval(f"node{code}" if code[0] == "." else code, here)
            ran += 1
    assert ran >= 5


TABLES = ("No picture: drivers and displays", "The scene file", "The picture is black, empty or wrong", "It is slow")
MESSAGES = [(heading, row) for heading in TABLES for row in cells("troubleshooting.md", heading)]
MADE = [(row[0].strip("`"), row[1].strip("`")) for h, row in MESSAGES if h == "The scene file" and "rm." in row[1]]
MADE = [(message, code) for message, code in MADE if "NAME" not in code and " of " not in code]


@pytest.mark.parametrize(("message", "code"), MADE, ids=[message for message, _ in MADE])
def test_the_code_beside_a_message_makes_it(message: str, code: str) -> None:
    import math

    with pytest.raises(RaymarchError) as error, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        eval(code, {"rm": rm, "math": math})
    assert message in str(error.value)


def test_the_messages_of_the_page_are_those_of_the_package() -> None:
    """Messages without code beside them are looked up in the package, but for those of glfw and drivers."""
    source = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "raymarch").rglob("*.py"))
    foreign = {"requested device index 0, but found 0 devices", "The DISPLAY environment variable is missing"}
    shown = {each for _, row in MESSAGES for each in re.findall(r"`([^`]+)`", row[0])} - {m for m, _ in MADE} - foreign
    assert len(shown) >= 15 and len(MADE) >= 10
    for message in shown:
        assert message.removesuffix(" ...").partition("'")[0] in source, message


@pytest.mark.may_skip
def test_the_site_builds() -> None:
    """`mkdocs build --strict` without the WebGL pages; nothing on the site is loaded from other servers."""
    pytest.importorskip("mkdocs")
    environment = os.environ | {"RAYMARCH_SITE": "pages", "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"], cwd=ROOT, env=environment, capture_output=True
    )
    assert done.returncode == 0, done.stderr.decode()
    for page in (ROOT / "site").glob("*.html"):
        loaded = re.findall(r"<(?:script|img|link|iframe)[^>]* (?:src|href)=\"?(https?:[^\"> ]+)", page.read_text())
        assert not loaded, f"{page.name}: {loaded}"


@pytest.mark.parametrize("name", ["accuracy-tracers", "accuracy-oversteps", "accuracy-fronts"])
def test_letters_of_figures_can_be_read_at_the_width_of_a_page(name: str) -> None:
    """They are 12 pixels high in the file, and pages are 770 pixels wide: at least 7.5 are left."""
    with Image.open(DOCS / "pictures" / f"{name}.png") as picture:
        assert 12 * 770 / picture.width >= 7.5
