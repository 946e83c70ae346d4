"""What starts the package: it imports and traces only what is used, and its names are those of an eager import."""

from __future__ import annotations

import ast
import io
import json
import os
import pickle
import subprocess
import sys
import threading
import time
import zipfile
from importlib import import_module
from pathlib import Path

import pytest
from rich.console import Console

import raymarch as rm
from raymarch.cli import progress
from raymarch.cli.commands import COMMANDS, load
from raymarch.expr.function import _Deferred, _trace, function, loop, trace
from raymarch.expr.node import Expr
from raymarch.expr.types import FLOAT

ROOT = Path(rm.__file__).parents[1]
HEAVY = {"numpy", "moderngl", "glcontext", "glfw", "PIL", "pyrr", "scipy", "matplotlib", "trimesh", "imgui_bundle"}
"""Packages that take long to import. `raymarch --help` needs typer and rich besides."""

SHOWN = "import json, sys; sys.stderr.write('\\n' + json.dumps(sorted(sys.modules)))"


def modules_after(*command: str, folder: Path) -> set[str]:
    """The modules that a new process has imported at its end."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-W", "error", *command],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(json.loads(done.stderr.splitlines()[-1]))


def tops(modules: set[str]) -> set[str]:
    return {name.partition(".")[0] for name in modules}


def parts(modules: set[str]) -> set[str]:
    return {".".join(name.split(".")[:2]) for name in modules if name.startswith("raymarch.")}


def in_command(*words: str) -> tuple[str, str]:
    return (
        "-c",
        f"import atexit\natexit.register(lambda: exec({SHOWN!r}))\nfrom raymarch.cli import main\nmain({words!r})",
    )


def test_the_package_imports_none_of_its_parts(tmp_path: Path) -> None:
    found = modules_after("-c", f"import raymarch\n{SHOWN}", folder=tmp_path)
    assert parts(found) == {"raymarch.startup", "raymarch.conveniences"}
    assert not tops(found) & (HEAVY | {"typer", "rich"})


def test_the_help_imports_no_command(tmp_path: Path) -> None:
    found = modules_after(*in_command("--help"), folder=tmp_path)
    assert parts(found) == {"raymarch.startup", "raymarch.conveniences", "raymarch.cli", "raymarch.errors"}
    assert not tops(found) & HEAVY


def test_a_picture_takes_neither_the_reference_nor_the_window(tmp_path: Path) -> None:
    (tmp_path / "hello.py").write_text("import raymarch as rm\nscene = rm.sphere()\n")
    found = modules_after(*in_command("render", "hello.py", "--size", "16x9"), folder=tmp_path)
    assert (tmp_path / "hello.png").exists() and "raymarch.gpu" in parts(found)
    assert not parts(found) & {"raymarch.truth", "raymarch.cost", "raymarch.window"}
    assert not tops(found) & {"glfw", "scipy", "matplotlib", "trimesh", "imgui_bundle", "watchfiles"}
    late = {"rich.progress", "numpy.ma", "PIL.ImageDraw", "PIL.ImageFont", "raymarch.gpu.probe"}
    assert not found & (late - modules_after("-c", f"import numpy\n{SHOWN}", folder=tmp_path))  # NumPy 1 has all parts


def test_no_definition_is_traced_at_import(tmp_path: Path) -> None:
    code = """
import pkgutil, sys
from importlib import import_module
import raymarch.sdf
for module in pkgutil.iter_modules(raymarch.sdf.__path__):
    import_module(f"raymarch.sdf.{module.name}")
import raymarch.scene, raymarch.gpu
from raymarch.sdf.definition import REGISTRY
functions = sys.modules["raymarch.expr.function"]
assert len(REGISTRY) > 120 and len(functions._deferred) > 15
used = {d.name for d in REGISTRY.values() if d._templates or d.programs}
rows = {"sphere", "translate", "circle", "straight_extrusion"}  # the default rows of instances, solid and flat
assert used <= rows, used
assert all(functions._deferred.values()), [name for name, left in functions._deferred.items() if not left]
raymarch.sdf.torus()
assert {d.name for d in REGISTRY.values() if d.programs} <= {*rows, "torus"}
assert "bounds : (-1, -1, -1) to (1, 1, 1)" in raymarch.sdf.sphere.__doc__
"""
    modules_after("-c", code + SHOWN, folder=tmp_path)


# The names


def declared() -> dict[str, str]:
    """The public names and their modules, as a type checker reads them."""
    tree = ast.parse(Path(rm.__file__).read_text(encoding="utf-8"))
    block = next(part for part in tree.body if isinstance(part, ast.If))
    imports = [part for part in block.body if isinstance(part, ast.ImportFrom)]
    listed = [(str(part.module), alias.name) for part in imports for alias in part.names]
    expanded = [(module, import_module(module).__all__ if name == "*" else [name]) for module, name in listed]
    return {name: module for module, names in expanded for name in names}


def test_each_name_is_what_a_type_checker_takes_it_for() -> None:
    found = declared()
    assert {*found, "__version__"} == {*rm.__all__, *rm._BUILT_IN}
    for name, module in found.items():
        owner = import_module(module)
        assert getattr(rm, name) is getattr(owner, name, sys.modules.get(f"raymarch.{name}")), name
    assert set(rm.__all__) <= set(dir(rm))
    with pytest.raises(AttributeError, match=r"raymarch has no 'spher' \(did you mean rm.sphere\?\)"):
        rm.spher  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize(
    "first", ["import raymarch.truth.march", "import raymarch.cost", "import raymarch.cli.cost", ""]
)
def test_the_names_do_not_depend_on_what_is_imported_first(first: str, tmp_path: Path) -> None:
    code = f"""
{first}
import raymarch as rm
import raymarch.truth.march
from raymarch import *
assert callable(rm.truth) and truth is rm.truth and rm.cost.for_error and rm.plan.plan and rm.sdf.round
assert rm.errors.SceneError is rm.SceneError and rm.scene.quality.PRESETS
assert set(rm.__all__) <= set(globals())
"""
    modules_after("-c", code + SHOWN, folder=tmp_path)


def test_a_search_finds_the_package_that_measures(tmp_path: Path) -> None:
    code = """
import sys, raymarch as rm
scene = rm.Scene(rm.sphere())
assert "raymarch.cost" not in sys.modules
for search in (rm.Quality.for_error, rm.Quality.for_time):
    try:
        search(scene, "nothing")
    except rm.CostError:
        continue
    raise AssertionError(search)
"""
    modules_after("-c", code + SHOWN, folder=tmp_path)


def test_the_help_text_of_each_command_is_in_its_own_help() -> None:
    for name, text in COMMANDS.items():
        command = load(name)
        assert command.name == name and command.help == text and command.params


def test_builders_are_functions_to_the_user() -> None:
    assert pickle.loads(pickle.dumps(rm.sphere)) is rm.sphere
    assert repr(rm.sphere) == "<function sphere>"

    class Toy:
        turned = rm.sdf.round

    assert Toy.turned is rm.sdf.round
    with pytest.raises(rm.SceneError, match=r"round of <.*Toy"):
        Toy().turned(0.1)


# Deferred tracing


def test_a_function_is_traced_once_however_many_threads_use_it() -> None:
    calls = []

    def double(x: Expr) -> Expr:
        calls.append(threading.get_ident())
        time.sleep(0.05)
        return 2.0 * x

    made = _Deferred("double", lambda: _trace("double", double, [("x", FLOAT)], double.__code__))
    assert made.name == "double" and not calls
    bodies: list[Expr] = []
    threads = [threading.Thread(target=lambda: bodies.append(made.body)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(calls) == 1 and len({id(body) for body in bodies}) == 1 and len(bodies) == 4
    assert pickle.loads(pickle.dumps(made)) is made
    with pytest.raises(AttributeError):
        made.nothing  # noqa: B018


def test_a_function_that_is_traced_within_a_loop_is_that_traced_alone() -> None:
    def halved(x: Expr) -> Expr:
        return loop(3, [x], lambda i, y: [0.5 * y + i])[0]

    alone = trace("halved", halved, [("x", FLOAT)])
    inner = _Deferred("halved", lambda: _trace("halved", halved, [("x", FLOAT)], halved.__code__))
    outer = trace("outer", lambda x: loop(2, [x], lambda i, y: [inner(y)])[0], [("x", FLOAT)])
    assert inner.body is alone.body and outer.body is not alone.body


def test_a_users_function_is_traced_at_its_definition() -> None:
    with pytest.raises(rm.SceneError, match="must return an expression") as caught:

        @function(x=FLOAT)
        def wrong(x: Expr) -> str:
            return "nothing"

    assert caught.value.where is not None and caught.value.where.file == __file__


# The process


def test_garbage_is_collected_again_when_a_command_runs(tmp_path: Path) -> None:
    text = "import gc\nimport raymarch as rm\nassert gc.isenabled() and gc.get_freeze_count()\nscene = rm.sphere()\n"
    (tmp_path / "hello.py").write_text(text)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "raymarch", "explain", "hello.py"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    code = "import gc, raymarch\nraymarch.sphere()\nassert gc.isenabled() and not gc.get_freeze_count()\n"
    modules_after("-c", code + SHOWN, folder=tmp_path)


@pytest.mark.parametrize("columns", ["0", "000", "", "1"])
def test_text_is_printed_whatever_the_width(columns: str) -> None:
    code = "from raymarch.cli.common import Output; Output().print('a line')"
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": columns}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "a line\n"


def test_work_of_several_rounds_has_no_time_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr(progress.clock_time, "perf_counter", lambda: now[0])
    tell = progress.logged()
    for what, share in (("a", 0.5), ("a", 0.75), ("b", 0.25), ("b", 0.5)):
        now[0] += 11.0
        tell(what, share)
    assert capsys.readouterr().err.splitlines() == [" 50 %  a, 11 s left", " 75 %  a, 7 s left", " 25 %  b", " 50 %  b"]


def test_a_log_gets_lines_of_progress(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Where the error stream is no terminal, as in CI: one line in every so many seconds."""
    now = [0.0]
    monkeypatch.setattr(progress.clock_time, "perf_counter", lambda: now[0])
    with progress.bar("exporting", 4.0) as tell:
        for second in range(25):
            now[0] = float(second)
            tell(second / 10)
    assert capsys.readouterr().err.splitlines() == [" 25 %  exporting, 30 s left", " 50 %  exporting, 20 s left"]


def test_a_bar_counts_the_seconds_before_it_appears(monkeypatch: pytest.MonkeyPatch) -> None:
    now, shown = [0.0], io.StringIO()
    monkeypatch.setattr(progress.clock_time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(progress, "errors", Console(file=shown, force_terminal=True, width=100))
    with progress.bar("measuring", 1.0) as tell:
        tell(0.0)
        now[0] = 30.0
        tell(0.5)
    assert "50% 30 s 30 s left" in shown.getvalue()


def test_the_package_works_from_a_zip_archive(tmp_path: Path) -> None:
    """As a wheel on PYTHONPATH: templates, GLSL modules and what workers are sent are read from the archive."""
    with zipfile.ZipFile(tmp_path / "raymarch.whl", "w") as archive:
        for file in (ROOT / "raymarch").rglob("*"):
            if file.is_file() and file.suffix != ".pyc":
                archive.write(file, file.relative_to(ROOT))
    (tmp_path / "hello.py").write_text("import raymarch as rm\nscene = rm.sphere()\n")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "raymarch.whl")}
    code = f"""
import sys
from raymarch.cli import main
from raymarch.cost.html import templates
assert {str(tmp_path)!r} in sys.modules["raymarch"].__file__
templates()
main(["export", "hello.py", "-o", "hello.html"])
"""
    done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and (tmp_path / "hello.html").stat().st_size > 20_000, done.stderr
