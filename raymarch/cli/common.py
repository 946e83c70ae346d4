"""Shared by all commands: errors, arguments, atomic output files."""

from __future__ import annotations

import errno
import io
import os
import select
import stat
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console

from raymarch.errors import RaymarchError, SceneError, printable


class Errors(Console):
    """A console on the error stream. If nothing can be written there, the exit code alone tells what happened."""

    def __init__(self) -> None:
        # Without emoji=False rich turns the line number in "scene.py:100:" into an emoji.
        super().__init__(stderr=True, highlight=False, soft_wrap=True, emoji=False, markup=False)

    def print(self, *objects: Any, **how: Any) -> None:
        """Print texts, each as one line without control characters."""
        texts = [printable(each) if isinstance(each, str) else each for each in objects]
        if self.is_terminal or how or not all(isinstance(each, str) for each in texts):
            super().print(*texts, **how)
            return
        with suppress(OSError):  # the same in a tenth of the time
            self.file.write(" ".join(texts) + "\n")

    def say(self, *sentences: str) -> None:
        """Print sentences of the program, each on a line of its own."""
        for sentence in sentences:
            self.print(f"raymarch: {sentence}")

    def _write_buffer(self) -> None:
        try:
            super()._write_buffer()
        except OSError:
            self._buffer.clear()


if not os.environ.get("COLUMNS", "0").strip("0"):
    os.environ.pop("COLUMNS", None)  # a terminal without a size; to rich and typer, zero columns have no room for text

errors = Errors()

DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Faults of the disk or device that the output stream is redirected to."""

SIZE = "640x360"
"""Default size of a picture, of `render` and `explain`."""

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE.py", help="Python file that defines a module-level `scene`.")]


Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Value of a Param; may be repeated.")
]


def ignore_measured(ignored: bool) -> bool:
    """For this process and those that it starts."""
    from raymarch.prices import SWITCH  # the help imports little

    if ignored:
        os.environ[SWITCH] = "off"
    return ignored


NoMeasured = Annotated[
    bool,
    typer.Option(
        "--no-measured",
        callback=ignore_measured,
        help="Plan by the prices of the device's class, not those of `raymarch doctor --measure`.",
    ),
]


def among(*names: str) -> Callable[[str], list[str]]:
    """What completes the value of an option in a shell: those of some names that begin as it does."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


Backend = Annotated[
    str,
    typer.Option(help="auto, egl, osmesa or window.", autocompletion=among("auto", "egl", "osmesa", "window")),
]
Device = Annotated[
    int | None, typer.Option(help="Index of the EGL device; no other backend is tried.", show_default="0")
]
OptionalTime = Annotated[float | None, typer.Option(help="Value of `time` in seconds.", show_default="0")]


class CommandError(RaymarchError):
    """Wrong use of the command line. It refers to no line of a file."""

    def __init__(self, what: str, *, legal: str = "") -> None:
        super().__init__(what, legal=legal)
        self.where = None
        self.args = (str(self),)


def parse_size(text: str) -> tuple[int, int]:
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.isdecimal() for p in parts) or not all(int(p) > 0 for p in parts):
        raise CommandError(f"--size {text}", legal="WxH in whole pixels, both at least 1, such as 640x360")
    return int(parts[0]), int(parts[1])


def parse_settings(settings: Sequence[str]) -> dict[str, Any]:
    """Parse NAME=VALUE pairs; a value is one number, several separated by commas, or a colour."""
    values: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        numbers = _numbers(text)
        if not equals or not numbers:
            swept = equals and all(map(_numbers, text.split(":")))
            legal = "NAME=VALUE, where VALUE is a number, several numbers such as 1,0.5,0, or a colour such as tomato"
            what = "; NAME=A:B for the frames of `raymarch render --frames` only" if swept else ""
            raise CommandError(f"--set {setting}", legal=legal + what)
        values[name.strip()] = numbers[0] if len(numbers) == 1 else tuple(numbers)
    return values


Sweep = Callable[[float], dict[str, Any]]
"""The values of the parameters that change from frame to frame, at a share of the frames from 0 to 1."""


def parse_sweeps(settings: Sequence[str]) -> tuple[dict[str, Any], Sweep | None]:
    """Parse NAME=VALUE pairs, and NAME=A:B for a parameter that goes from A to B; None if there is none of these."""
    moving = [setting for setting in settings if ":" in setting.partition("=")[2]]
    fixed = parse_settings([setting for setting in settings if setting not in moving])
    if not moving:
        return fixed, None
    ends: dict[str, tuple[list[float], list[float]]] = {}
    for setting in moving:
        name, _, text = setting.partition("=")
        first, last = (_numbers(part) for part in (text.split(":") if text.count(":") == 1 else ("", "")))
        if not first or len(first) != len(last):
            raise CommandError(f"--set {setting}", legal="NAME=A:B with as many numbers in A as in B, such as 0:1")
        ends[name.strip()] = first, last

    def at(share: float) -> dict[str, Any]:
        found = {
            name: tuple((1.0 - share) * a + share * b for a, b in zip(*both, strict=True))
            for name, both in ends.items()
        }
        return {name: value[0] if len(value) == 1 else value for name, value in found.items()}

    return fixed, at


def _numbers(text: str) -> list[float]:
    """The numbers of a text, separated by commas, or of a colour, in linear RGB; none if it holds anything else."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        from raymarch.expr.colors import linear_color  # the help imports no expressions

        with suppress(SceneError):
            return list(linear_color("--set", text))
        return []


@contextmanager
def piped() -> Iterator[None]:
    """Exit quietly, with code 0, if the reader of the output closes the pipe, as `head` does.

    If the output cannot be written, for example to a full disk, exit with code 2 and one line. A stream that is closed
    from the start is the null device.
    """
    _open_closed_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as stderr: an encoding without a letter is no failure
    output = os.dup(1)  # rich replaces descriptor 1
    code: Any = 0
    try:
        try:
            yield
        except SystemExit as stop:
            code = stop.code
            raise
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        _forget_output()
        sys.exit(0 if code == 1 else code)  # typer and rich exit with 1 then
    except OSError as fault:
        if fault.errno not in DISK or fault.filename is not None:
            raise
        _forget_output()
        errors.print(f"raymarch: cannot write the output: {fault.strerror} (a disk with space)")
        sys.exit(2)
    except SystemExit as stop:
        if stop.code != 1 or not _reader_is_gone(output):  # typer and rich exit with 1 then
            raise
        _forget_output()
        sys.exit(0)
    finally:
        with suppress(OSError):
            os.close(output)


@contextmanager
def output_to_errors() -> Iterator[None]:
    """A context in which output goes to the error stream, also that of libraries and of programs that are started."""
    output = os.dup(1)
    try:
        sys.stdout.flush()
        os.dup2(2, 1)
        with redirect_stdout(sys.stderr):
            yield
    finally:
        sys.stdout.flush()
        os.dup2(output, 1)
        os.close(output)


def _open_closed_streams() -> None:
    """Replace closed standard streams by the null device. Otherwise the next file that is opened takes their place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # takes the smallest free number, this one
        if getattr(sys, name) is None:
            mode = "r" if number == 0 else "w"
            setattr(sys, name, open(number, mode, errors="backslashreplace", closefd=False))  # noqa: SIM115 - stays open


def _reader_is_gone(output: int) -> bool:
    """True if the output is a pipe without a reader."""
    if sys.platform != "win32":
        with suppress(OSError, AttributeError):
            if stat.S_ISFIFO(os.fstat(output).st_mode):
                watch = select.poll()
                watch.register(output, select.POLLOUT)
                return any(event & (select.POLLERR | select.POLLHUP) for _, event in watch.poll(0))
    return False


def _forget_output() -> None:
    """Redirect the rest of the output to the null device, for Python's flush at exit."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


class Output(Console):
    """A console on the output stream; a closed pipe raises BrokenPipeError for `piped`."""

    def __init__(self, soft_wrap: bool = True) -> None:
        super().__init__(highlight=False, soft_wrap=soft_wrap, emoji=False)

    def on_broken_pipe(self) -> NoReturn:
        raise BrokenPipeError(errno.EPIPE, "the reader has closed the pipe")
