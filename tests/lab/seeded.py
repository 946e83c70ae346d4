"""Runs the tests on seeded faults: each fault in a forked process, the tests most likely to notice it first.

All tests are collected once. A first process runs them without a fault and notes what each has drawn and called. The
process of a fault then runs only tests that use what is spoiled, until one fails. A process opens its own OpenGL
context: the first one has none, so that it can be forked.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import pickle
import re
import select
import signal
import sys
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from raymarch import glsl
from raymarch.gpu.program import Program
from raymarch.gpu.targets import Target

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "raymarch"
FOLDERS = ("functions", "plan", "shader", "render", "gpu", "export/test_shaders.py")
"""The folders of tests that draw, and do so in little time."""

LONGEST = 120.0
"""Seconds for a single test of a fault; a loop that never ends is noticed too."""

ENOUGH = 3.0
"""CPU seconds that all tests of a fault may take, as they did without it: enough for what is easily noticed."""

ENVIRONMENT = {"LP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "GALLIVM_PERF": "nopt"}
"""As in tests/run.sh."""


# What is spoiled


@contextmanager
def reads(file: Path, number: int, text: str) -> Iterator[None]:
    """While it lasts, a line of a file of GLSL, from 1, is a text in every shader that is read or compiled.

    Texts that were read before, such as constants of a test, have the line after the first line of the file.
    """
    lines = file.read_text(encoding="utf-8").split("\n")
    line, top = lines[number - 1], _top(lines, number - 1)
    same = sum(lines[i] == line and _top(lines, i) == top for i in range(number - 1))
    read, made = Path.read_text, Program.__init__

    def read_text(self: Path, *args: Any, **how: Any) -> str:
        found = read(self, *args, **how)
        if self.name != file.name or self.resolve() != file.resolve():
            return found
        return "\n".join([*lines[: number - 1], text, *lines[number:]])

    def make(program: Program, context: Any, vertex: str, fragment: str, *rest: Any, **how: Any) -> None:
        made(program, context, vertex, spoiled(fragment), *rest, **how)

    def spoiled(fragment: str) -> str:
        found = fragment.split("\n")
        if lines[0] not in found:
            return fragment
        begin = found.index(lines[0])
        places = [i for i in range(begin, min(begin + len(lines), len(found))) if found[i] == line]
        places = [i for i in places if _top(found, i) == top]
        if len(places) > same:
            found[places[same]] = text
        return "\n".join(found)

    Path.read_text, Program.__init__ = read_text, make
    _forget()
    try:
        yield
    finally:
        Path.read_text, Program.__init__ = read, made
        _forget()


def _top(lines: Sequence[str], at: int) -> str:
    """The line that begins the function around a line."""
    return next((lines[i] for i in range(at, -1, -1) if lines[i][:1].isalpha()), "")


def _forget() -> None:
    glsl.load.cache_clear()
    glsl.givers.cache_clear()


def functions_of(module: ModuleType) -> dict[str, FunctionType]:
    """The functions and methods that a module defines, by qualified name."""
    found: dict[str, FunctionType] = {}
    pending: list[Any] = list(vars(module).values())
    for value in pending:
        if inspect.isclass(value) and value.__module__ == module.__name__:
            pending += vars(value).values()
        match value:
            case property():
                value = value.fget
            case cached_property():
                value = value.func
            case classmethod() | staticmethod():
                value = value.__func__
        if type(value).__module__ in ("builtins", "functools"):
            value = inspect.unwrap(value)
        if isinstance(value, FunctionType) and value.__code__.co_filename == module.__file__:
            found[value.__qualname__] = value
    return found


def replace_code(module: ModuleType, tree: ast.Module, names: Sequence[str] | None = None) -> None:
    """Give functions of a module, all if none is named, the bodies that they have in another tree of its text."""
    codes: dict[str, CodeType] = {}
    pending = [compile(ast.fix_missing_locations(tree), str(module.__file__), "exec", dont_inherit=True)]
    for code in pending:
        inner = [c for c in code.co_consts if isinstance(c, CodeType)]
        codes |= {c.co_qualname: c for c in inner}
        pending += inner
    for name, function in functions_of(module).items():
        if (names is None or name in names) and codes[name].co_freevars == function.__code__.co_freevars:
            function.__code__ = codes[name]


def tree_of(module: ModuleType) -> ast.Module:
    return ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))


# What the tests use


@dataclass
class Use:
    """What a test did while nothing was wrong: its CPU time, the texts that it drew with, what it read and called."""

    seconds: float = 0.0
    texts: set[int] = field(default_factory=set)
    digest: int = 0
    called: set[str] = field(default_factory=set)


@dataclass
class Uses:
    """Of all tests by their ids; the lines of each text; and the tests that fail without a fault."""

    tests: dict[str, Use] = field(default_factory=dict)
    lines: dict[int, frozenset[str]] = field(default_factory=dict)
    red: list[str] = field(default_factory=list)


class Recorder:
    """Notes what the present test draws with and reads."""

    def __init__(self) -> None:
        self.now = Use()
        self.lines: dict[int, frozenset[str]] = {}
        made, drawn, read = Program.__init__, Program.draw, Target.channels
        texts: dict[int, int] = {}

        def make(program: Program, context: Any, vertex: str, fragment: str, *rest: Any, **how: Any) -> None:
            made(program, context, vertex, fragment, *rest, **how)
            program.text = zlib.crc32(fragment.encode())
            if program.text not in texts:
                texts[program.text] = 1
                self.lines[program.text] = frozenset(fragment.split("\n"))

        def draw(program: Program, *args: Any, **how: Any) -> None:
            self.now.texts.add(program.text)
            drawn(program, *args, **how)

        def channels(target: Target, *args: Any, **how: Any) -> Any:
            found = read(target, *args, **how)
            self.now.digest = zlib.crc32(found.tobytes(), self.now.digest)
            return found

        Program.__init__, Program.draw, Target.channels = make, draw, channels

    def calls(self, folders: Sequence[str]) -> None:
        """Note from now on which functions of some packages a test calls."""
        for name in (name for folder in folders for name in modules_of(folder)):
            module = importlib.import_module(name)
            tree = tree_of(module)
            for scope, function in functions_in(tree):
                mark = ast.parse(f"_noted.add({f'{name}:{scope}'!r})").body
                at = 1 if ast.get_docstring(function) is not None else 0
                function.body[at:at] = mark
            module._noted = self.called
            replace_code(module, tree)

    @property
    def called(self) -> Any:
        recorder = self

        class Called:
            def add(self, name: str) -> None:
                recorder.now.called.add(name)

        return Called()


def code_of(line: str) -> str:
    return line.partition("//")[0].strip()


def modules_of(folder: str) -> list[str]:
    """The names of the modules of a package of raymarch."""
    return [f"raymarch.{folder}.{f.stem}" for f in sorted((PACKAGE / folder).glob("*.py")) if f.stem != "__init__"]


def functions_in(tree: ast.Module) -> list[tuple[str, ast.FunctionDef]]:
    """The functions and methods at the top of a module and of its classes, with their qualified names."""
    found = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            found.append((node.name, node))
        elif isinstance(node, ast.ClassDef):
            found += [(f"{node.name}.{inner.name}", inner) for inner in node.body if isinstance(inner, ast.FunctionDef)]
    return found


# The processes


class Bench:
    """A plugin of pytest that, in place of running the tests once, lets `work(bench)` run some of them at will."""

    def __init__(self, work: Callable[[Bench], None], recorded: Path | None, longest: float) -> None:
        self.work, self.recorded, self.longest = work, recorded, longest
        self.items: dict[str, pytest.Item] = {}
        self.uses = Uses()
        self.noticed: dict[str, Counter[str]] = {}
        self.alone: dict[str, bool] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        assert not session.testsfailed, "tests cannot be collected"
        self.items = {item.nodeid: item for item in session.items}
        if self.recorded is not None and self.recorded.exists():
            self.uses = pickle.loads(self.recorded.read_bytes())
        else:
            self.uses = self._record()
            if self.recorded is not None:
                self.recorded.write_bytes(pickle.dumps(self.uses))
        for name in self.uses.red:
            print(f"red without a fault, and not asked: {name}", flush=True)
        self.work(self)
        return True

    def _record(self) -> Uses:
        """Run all tests without a fault."""
        found = Uses()

        def record(tell: Callable[[Any], None]) -> None:
            recorder = Recorder()
            recorder.calls(("plan", "shader"))
            for name, red, seconds in self._run(list(self.items)):
                recorder.now.seconds = seconds
                tell((name, red, recorder.now, recorder.lines))
                recorder.now, recorder.lines = Use(), {}
            tell("done")

        def take(said: Any) -> None:
            if said == "done":
                return
            name, red, use, lines = said
            found.lines |= lines
            if red:
                found.red.append(name)
            else:
                found.tests[name] = use
            if self.recorded is not None and len(found.tests) % 100 == 0:
                self.recorded.with_suffix(".part").write_bytes(pickle.dumps(found))

        said = self._forked(record, 4 * 3600.0, take)
        assert said == "done", f"the tests break off without a fault: {said}"
        return found

    def _run(self, names: Sequence[str]) -> Iterator[tuple[str, bool, float]]:
        """Run tests one after the other: the name of each, whether it is red, and its CPU seconds."""
        items = [self.items[name] for name in names if name in self.items]
        for item, following in zip(items, [*items[1:], None], strict=True):
            begun = time.process_time()
            reports = runtestprotocol(item, log=False, nextitem=following)
            yield item.nodeid, any(report.failed for report in reports), time.process_time() - begun

    def _forked(
        self, work: Callable[[Callable[[Any], None]], None], longest: float, hear: Callable[[Any], None] | None = None
    ) -> Any:
        """What the last call of `tell` said in a forked process that runs `work(tell)`; `hear` gets all.

        None if it did not say anything; "late" with what it said last if it says nothing for `longest` seconds.
        """
        out, into = os.pipe()
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.setpgid(0, 0)
                os.close(out)
                nothing = os.open(os.devnull, os.O_RDWR)
                for descriptor in (0, 1, 2):
                    os.dup2(nothing, descriptor)

                def tell(said: Any) -> None:
                    data = pickle.dumps(said)
                    with os.fdopen(os.dup(into), "wb") as pipe:
                        pipe.write(len(data).to_bytes(8, "little") + data)

                work(tell)
                status = 0
            except BaseException:
                tell(("broke", traceback.format_exc()))
            finally:
                os._exit(status)
        os.close(into)
        said: Any = None
        with os.fdopen(out, "rb", buffering=0) as pipe:
            while True:
                if not select.select([pipe], [], [], longest)[0]:
                    said = ("late", said)
                    break
                head = pipe.read(8)
                if not head:
                    break
                length, data = int.from_bytes(head, "little"), b""
                while len(data) < length:
                    data += pipe.read(length - len(data))
                said = pickle.loads(data)
                if hear is not None:
                    hear(said)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return said

    def verdict(self, seed: Callable[[], Any], names: Sequence[str]) -> str:
        """The first of some tests that notices a fault; else "unchanged" if no array that they read changed a
        bit, or "missed".

        seed : puts the fault in place, for good.
        """

        def ask(tell: Callable[[Any], None]) -> None:
            recorder = Recorder()
            tell(("begun", ""))
            _held = seed()
            changed = False
            for name, red, _ in self._run(names):
                changed |= recorder.now.digest != self.uses.tests[name].digest
                recorder.now = Use()
                tell(("red" if red else "green", name))
                if red:
                    return
            tell(("done", "missed" if changed else "unchanged"))

        while True:
            said = self._forked(ask, LONGEST)
            match said:
                case ("late", (_, last)):
                    return f"a test that does not end, after {last or 'none'}"
                case ("done", found):
                    return str(found)
                case ("red", str(name)):
                    if self.is_green(name):
                        return name
                    names = [other for other in names if other != name]
                case ("broke", trace):
                    raise RuntimeError(trace)
                case _:
                    return f"a test that breaks off, after {said[1] if said else 'none'}"

    def is_green(self, name: str) -> bool:
        """Whether a test passes by itself without a fault: what it notices is then the fault's doing."""
        if name not in self.alone:

            def ask(tell: Callable[[Any], None]) -> None:
                tell([red for _, red, _ in self._run([name])] == [False])

            self.alone[name] = self._forked(ask, LONGEST) is True
            if not self.alone[name]:
                print(f"red by itself without a fault, and not asked: {name}", flush=True)
        return self.alone[name]

    def ordered(self, names: Sequence[str], about: str) -> list[str]:
        """Tests in the order in which they are asked: those of single functions, then the quickest of each file, the
        second quickest, and so on; of each, first those that noticed other faults of the same thing.

        Of the tests of more than a function, those beyond `longest` CPU seconds in all are left out.
        """
        known = self.noticed.get(about, Counter())
        quick = sorted((name for name in names if self.alone.get(name, True)), key=lambda n: self.uses.tests[n].seconds)
        places: Counter[str] = Counter()
        order = {}
        for name in quick:
            file = name.partition("::")[0]
            places[file] += 1
            alone = file.startswith("tests/functions/")
            order[name] = (not alone, -known[name], 0 if alone else places[file], self.uses.tests[name].seconds)
        chosen = sorted(quick, key=order.__getitem__)
        ends = accumulate(order[name][0] * self.uses.tests[name].seconds for name in chosen)
        return [name for name, end in zip(chosen, ends, strict=True) if end <= self.longest or name in known]

    def note(self, about: str, found: str) -> None:
        if found in self.uses.tests:
            self.noticed.setdefault(about, Counter())[found] += 1

    def drawing(self, holds: Callable[[frozenset[str]], bool]) -> list[str]:
        """The tests that drew with a text of whose lines something holds."""
        texts = {text for text, lines in self.uses.lines.items() if holds(lines)}
        return [name for name, use in self.uses.tests.items() if use.texts & texts]

    def calling(self, function: str) -> list[str]:
        """The tests that called a function, "raymarch.plan.lights:table"."""
        return [name for name, use in self.uses.tests.items() if function in use.called]


def run(
    work: Callable[[Bench], None],
    folders: Sequence[str] = FOLDERS,
    recorded: Path | None = None,
    longest: float = ENOUGH,
) -> None:
    """Collect the tests of some folders and let `work` ask them.

    recorded : a file that keeps what the tests use; read if it is there, else written.
    longest : CPU seconds that all tests of a fault may take, as they did without it.
    """
    os.environ.update({name: os.environ.get(name, value) for name, value in ENVIRONMENT.items()})
    paths = [str(ROOT / "tests" / folder) for folder in folders]
    bench = Bench(work, recorded, longest)
    status = pytest.main(["-q", "-s", "-p", "no:cacheprovider", "--no-header", *paths], plugins=[bench])
    assert status in (0, 5), f"pytest ended with {status}"


# Text of GLSL


def arguments(code: str, start: int) -> tuple[list[str], int]:
    """The arguments of a call, of which `start` is the place after "(", and the place of its ")"."""
    depth, begin, found = 0, start, []
    for k in range(start, len(code)):
        if code[k] in "([":
            depth += 1
        elif code[k] in ")]":
            if depth == 0:
                return [*found, code[begin:k]], k
            depth -= 1
        elif code[k] == "," and depth == 0:
            found.append(code[begin:k])
            begin = k + 1
    return [], len(code)


def calls(code: str, name: str) -> Iterator[re.Match[str]]:
    return re.finditer(rf"\b{name}\(", code)
