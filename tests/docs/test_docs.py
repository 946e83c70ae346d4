"""README and docs are run: every Python block, prompt and command, and every name of a package is checked."""

from __future__ import annotations

import ast
import doctest
import importlib.util
import inspect
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

import raymarch as rm
from raymarch import glsl
from raymarch.cli.commands import app, main
from raymarch.expr import arrays, derivative, intervals
from raymarch.expr import glsl as printer
from raymarch.scene import load

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)


GENERATED = {"gallery"}
"""Pages whose code is that of files which other tests run; a test below compares the page with the files."""

PYTHON = [
    (page, i, text) for page in PAGES if page.stem not in GENERATED for i, text in enumerate(blocks(page, "python"))
]


@pytest.mark.parametrize(("page", "i", "text"), PYTHON, ids=[f"{p.stem}-{i}" for p, i, _ in PYTHON])
def test_python_block_runs(page, i, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if ">>>" in text:
        test = doctest.DocTestParser().get_doctest(text, {}, f"{page.name} {i}", str(page), 0)
        report = []
        doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test, out=report.append)
        assert not report, "".join(report)
        return
    # A file of its own, so that definitions have a source and a line.
    file = tmp_path / f"block_{i}.py"
    file.write_text(text)
    namespace = {"__name__": "block", "__file__": str(file)}
    exec(compile(text, str(file), "exec"), namespace)


def test_there_is_something_to_run():
    assert len(PYTHON) >= 8


def test_the_page_of_scenes_shows_the_example_as_it_is():
    shown = blocks(ROOT / "docs" / "scene.md", "python")
    example = (ROOT / "examples" / "csg.py").read_text().partition('"""\n\n')[2]
    assert example in shown


def test_the_first_snippet_of_the_readme_makes_its_first_picture():
    example = (ROOT / "examples" / "hello.py").read_text()
    assert blocks(ROOT / "README.md", "python")[0].startswith(example)
    after = (ROOT / "README.md").read_text().partition("```python")[2].split("```")[1]
    assert "docs/pictures/hello.png" in after


def test_the_new_shape_takes_fifteen_lines_at_most():
    block = blocks(ROOT / "docs" / "extending.md", "python")[0]
    definition = block[block.index("@rm.shape") : block.index("\n\n\nprint")]
    assert len(definition.splitlines()) <= 15


def test_the_commands_run(tmp_path, monkeypatch):
    """Each `raymarch ...` line of the page of commands runs. Those of other pages are parsed: test_site.py."""
    monkeypatch.chdir(tmp_path)
    # A window needs a display, and stays; its own tests open some.
    monkeypatch.setattr("raymarch.window.viewer.Viewer", lambda *_: SimpleNamespace(run=lambda _: 0))
    monkeypatch.setattr("raymarch.cost.search.LADDER", (2.0, 0.1))  # whether all settings are tried is tested elsewhere
    cheap = ["--cross", "normals", "--repeats", "1", "--reference-samples", "1", "--size", "32x18"]
    few = {"cost": cheap, "prove": ["--size", "32x18"]}
    scene = tmp_path / "SCENE.py"
    scene.write_text('import raymarch as rm\nscene = rm.sphere(rm.Param("gap", 1, 0.5, 5))\n')
    lines = [line for block in blocks(ROOT / "docs" / "commands.md", "sh") for line in block.splitlines()]
    commands = [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("raymarch ")]
    assert len(commands) >= 5
    assert {c[0] for c in commands} == {c.name for c in app.registered_commands}
    for command in commands:
        # A hundred scenes, tests/cost/test_device_check.py; and seconds of frames, tests/gpu/test_measured_prices.py.
        if command in (["doctor", "--check"], ["doctor", "--measure"]):
            continue
        small = ["16x9" if part == "1280x720" else "0:2" if part == "0:90" else part for part in command]
        with pytest.raises(SystemExit) as stop:
            main(small + few.get(command[0], []))
        assert stop.value.code == 0, command


def test_the_packages_are_those_on_disk():
    page = (ROOT / "docs" / "how-it-is-built.md").read_text()
    named = set(re.findall(r"^\| `raymarch/([\w.]+)`", page, re.MULTILINE))
    inside = (ROOT / "raymarch").iterdir()
    packages = {p.name for p in inside if p.is_dir() and (p / "__init__.py").exists()} | {"errors.py"}
    assert named == packages


def test_the_tables_and_files_that_the_page_names_exist():
    page = (ROOT / "docs" / "how-it-is-built.md").read_text()
    tables = {"arrays": arrays, "intervals": intervals, "glsl": printer, "derivative": derivative}
    for module, name in re.findall(r"`(arrays|intervals|glsl|derivative)\.([A-Z]+)`", page):
        assert hasattr(tables[module], name)
    text = "\n".join(p.read_text() for p in PAGES)
    for file in re.findall(r"`((?:raymarch|tests|examples|docs)/[\w./-]+)`", text):
        assert (ROOT / file).exists(), file


@pytest.mark.parametrize(
    ("name", "script", "function"),
    [("nodes", "build", "page"), ("parts", "build", "parts_page"), ("api", "api", "page")],
)
def test_a_generated_page_is_that_of_the_code(name, script, function):
    """`docs/{script}.py` generates it; this test does not compare the pictures."""
    code = f"import runpy, sys; sys.stdout.write(runpy.run_path('docs/{script}.py')['{function}']())"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, check=True)
    assert done.stdout.decode() == (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")


def test_the_page_of_parts_lists_every_parameter():
    text = (ROOT / "docs" / "parts.md").read_text(encoding="utf-8")
    for part in (rm.Camera, rm.Quality, rm.Scene, rm.SpotLight, rm.Material, rm.planar, rm.SunSky):
        section = text.partition(f"### {part.__name__}\n")[2].partition("\n### ")[0]
        listed = re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)
        assert listed == list(inspect.signature(part).parameters), part


def test_every_public_name_is_on_a_page():
    text = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    named = set(re.findall(r"\b(?:rm|raymarch)\.(\w+)", text)) | set(re.findall(r"^#+ (\w+)$", text, re.MULTILINE))
    assert set(rm.__all__) - named == {"__version__"}


ROWS = [line for line in (ROOT / "docs" / "nodes.md").read_text(encoding="utf-8").splitlines() if line[:4] == "| !["]
CALLS = [call for line in ROWS for call in re.findall(r"`((?:rm)?\.\w+\([^`]*\))`", line.split(" | ")[1])]


def test_every_node_has_a_call():
    assert len(CALLS) >= len(ROWS) > 100
    assert "rm.sphere(radius=1.0)" in CALLS
    assert ".rotate(angle, axis=None)" in CALLS


@pytest.mark.parametrize("text", sorted(set(CALLS)))
def test_the_printed_calls_of_nodes_bind_to_the_public_functions(text):
    call = ast.parse(text.removeprefix(".").replace(", *,", ","), mode="eval").body
    method = text.startswith(".")
    name = call.func.id if method else call.func.attr
    function = getattr(rm.Node if method else rm, name)
    arguments = ["node"] * method + ["given"] * len(call.args)
    keywords = {keyword.arg: ast.literal_eval(keyword.value) for keyword in call.keywords}
    bound = inspect.signature(function).bind(*arguments, **keywords)
    optional = [q for q in inspect.signature(function).parameters.values() if q.default is not q.empty]
    assert {q.name for q in optional} <= set(bound.arguments), "each default is printed"


PROOFS = runpy.run_path(str(ROOT / "docs" / "proofs.py"))


def test_the_nodes_were_measured():
    """A few new ones may have no figures yet; `python -m tests.lab.renew` measures them."""
    known, rows = set(PROOFS["names"]()), set(PROOFS["ledger"]("nodes"))
    assert len(known & rows) >= 0.9 * len(known)
    assert rows <= known, f"figures of nodes that are no more: {rows - known}; run `python -m tests.lab.renew`"


def test_the_page_of_figures_is_that_of_the_ledger():
    assert PROOFS["page"]() == (ROOT / "docs" / "proofs.md").read_text(encoding="utf-8"), "run python docs/proofs.py"


def test_no_fact_is_violated():
    rows = PROOFS["ledger"]("nodes")
    broken = {name: row["violations"] for name, row in rows.items() if row["violations"]}
    assert not broken
    loose = [row["looseness"] for row in rows.values() if row["looseness"] is not None]
    assert sorted(loose)[len(loose) // 2] <= 1.5
    assert all(row["twin"] <= row["twin_limit"] for row in rows.values() if row["exactness"] != "estimate")


def test_every_module_has_a_header():
    for file in (ROOT / "raymarch" / "glsl").glob("*/*.glsl"):
        glsl.load(f"{file.parent.name}/{file.stem}")


GALLERY = runpy.run_path(str(ROOT / "docs" / "gallery.py"))
COUNTS = json.loads((ROOT / "docs" / "figures" / "gallery.json").read_text())


def test_the_gallery_and_the_tutorial_show_their_scenes_as_their_script_writes_them():
    scenes = [*GALLERY["files"](), *GALLERY["steps"]()]
    assert list(COUNTS) == [GALLERY["name_of"](file) for file in scenes]
    for name, page in (("gallery", "page"), ("tutorial", "tutorial")):
        assert GALLERY[page](COUNTS) == (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8"), "docs/gallery.py"
    assert all((ROOT / "docs" / "pictures" / "gallery" / f"{name}.png").is_file() for name in COUNTS)


@pytest.mark.parametrize("name", ["hello", "csg", "columns"])
def test_the_gallery_states_what_the_plan_chooses(name):
    """All but the size of the shader, which small changes of GLSL alter. `python docs/gallery.py` renews it."""
    chosen = GALLERY["chosen"](load(ROOT / "examples" / f"{name}.py"))
    assert {**chosen, "bytes": 0} == {**COUNTS[name]["plan"], "bytes": 0}


def test_the_tutorial_has_ten_steps_that_go_on_from_each_other():
    steps = GALLERY["steps"]()
    assert [file.stem[:2] for file in steps] == [f"{i:02}" for i in range(1, 11)]
    assert all(GALLERY["docstring"](file)[0].count("\n\n") >= 1 for file in steps)
    used = [set(COUNTS[GALLERY["name_of"](file)]["plan"]["used"]) for file in steps]
    assert "hard shadows" in used[4] and "glass" in used[9] and len(used[9]) > len(used[0])


def test_the_licences_of_all_dependencies_are_listed():
    """Of each package that pyproject.toml names, the licence that the installed one states."""
    made = runpy.run_path(str(ROOT / "docs" / "licences.py"))
    shown = (ROOT / "docs" / "licences.md").read_text()
    assert shown.startswith(made["HEAD"])
    rows = dict(re.findall(r"^\| [^|]+ \| ([\w-]+) \| (.+) \|$", shown, re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for group in ("needed", *(extra for extra in extras if extra not in made["OURS"])):
        for requirement in project["dependencies"] if group == "needed" else extras[group]:
            name = made["name_of"](requirement)
            if importlib.util.find_spec("pythonosc") is None and group == "live" and "CI" not in os.environ:
                continue  # not on every machine
            known, stated = (re.sub(r"[- ].*", "", words) for words in (rows[name], made["licence"](name)))
            assert known == stated, f"{name}: run python docs/licences.py"
    assert "not stated" not in rows.values()
