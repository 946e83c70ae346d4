"""The program `raymarch`: its commands, each in a module that is imported when the command is called.

Exit codes: 0 done, also if the reader of a pipe closes it early; 1 an internal error, or figures
that `cost --check` found grown; 2 bad input, with one message that names file and line; 130 after Ctrl+C, SIGTERM or
SIGHUP.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
import typer.main
from typer.core import TyperCommand

import raymarch
from raymarch import startup
from raymarch.cli import hints
from raymarch.cli.common import errors, piped
from raymarch.errors import RaymarchError

COMMANDS = {
    "render": "Render a scene to a picture file, without a screen.",
    "explain": (
        "Show the plan of a scene: facts, passes, modules and effects, each used or left out for a stated reason."
    ),
    "doctor": (
        "Show which OpenGL backends work here, with driver, limits and clock, and the packages to install for the "
        "others."
    ),
    "cost": "Measure error and time of quality settings, and show which are Pareto-optimal.",
    "prove": "Prove by intervals that each hit of a picture is where a surface is, and that none lies before it.",
    "export": "Write a scene to a file for other programs: a shader, a page or a triangle mesh.",
    "view": "Show a scene in a window and reload it when its file is saved. Press H for the keys.",
}
"""The help text of each command. The module of the same name in this package has its options, as those of `run`."""

OPTIONS: dict[str, Any] = {"pretty_exceptions_enable": False}

app = typer.Typer(
    help="Signed-distance scenes in Python, compiled to one GLSL fragment shader.", no_args_is_help=True, **OPTIONS
)


class Deferred(TyperCommand):
    """A command whose module is imported when it is called. Until then it has its name and its help text only."""

    def make_context(self, *args: Any, **kwargs: Any) -> Any:
        """The context of the command itself: it parses the options, and is invoked."""
        return load(str(self.name)).make_context(*args, **kwargs)


def load(name: str) -> Any:
    """The command with its options."""
    run = import_module(f"raymarch.cli.{name}").run
    startup.end()
    alone = typer.Typer(add_completion=False, **OPTIONS)
    alone.command(name, help=COMMANDS[name])(run)
    return typer.main.get_command(alone)


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and exit. Wrong usage is one line, with code 2."""
    with piped():
        try:
            code = _run(args)
            startup.close()
        except KeyboardInterrupt:
            code = startup.INTERRUPTED
        sys.exit(code)


def _run(args: Sequence[str] | None) -> int:
    """The exit code of the command line."""
    try:
        code = app(args=args, prog_name="raymarch", standalone_mode=False)
    except RaymarchError as fault:
        errors.say(str(fault))
        return 2
    except Exception as fault:
        if not hasattr(fault, "format_message"):  # the exceptions of wrong usage have it; typer moves their classes
            raise
        _show_usage(fault, sys.argv[1:] if args is None else args)
        return 2
    return code if isinstance(code, int) else 0


def _show_usage(fault: Any, args: Sequence[str]) -> None:
    """Print wrong usage as one line; the help, if a command was called without arguments."""
    context = getattr(fault, "ctx", None)
    command = context.command_path if context is not None else "raymarch"
    if not str(fault.format_message()).strip() or type(fault).__name__.startswith("NoArgs"):
        fault.show()
        return
    text = " ".join(str(fault.format_message()).split()).removesuffix(".")
    scene = re.fullmatch(r"No such command '(.+\.py)'", text)
    if scene:
        shown = f"{scene[1]} is no command (raymarch render {scene[1]}, or raymarch view {scene[1]})"
        errors.say(shown)
        return
    wrong = re.fullmatch(r"Invalid value for '(?:.* / )?(--[\w-]+)': Input should be (.+?)(?:, unable.*)?", text)
    if wrong:
        legal = wrong[2].replace("a valid integer", "an integer").replace("a valid", "a")
        errors.say(f"{wrong[1]} {_given(wrong[1], args)} ({legal}; {command} --help)")
        return
    errors.say(f"{_hinted(text, context)} ({command} --help)")


def _given(option: str, args: Sequence[str]) -> str:
    """The value of an option, as it was typed last."""
    for before, after in reversed(list(zip(args, [*args[1:], ""], strict=True))):
        if before == option or before.startswith(f"{option}="):
            return before.partition("=")[2] or after
    return ""


def _hinted(text: str, context: Any) -> str:
    """A message of wrong usage, with what is typed here for the names of other programs."""
    unknown = re.match(r"No such (command|option):? '?(-*[\w-]+)'?", text)
    extra = re.match(r"Got unexpected extra argument\(?s?\)? \((\S+)", text)
    if extra and "--output" in _options(context):
        return f"{text}; use -o {extra[1].rstrip(')')}"
    if unknown is None:
        return text
    given = unknown[2]
    hint = hints.for_command(given) if unknown[1] == "command" else hints.for_option(given, _options(context))
    told = text.partition(" (Possible")[0] if unknown[1] == "option" else text.partition(". Did")[0] if hint else text
    return f"{told}; use {hint}" if hint else told


def _options(context: Any) -> list[str]:
    """The options of the command that was called."""
    return [name for q in context.command.params for name in (*q.opts, *q.secondary_opts)] if context else []


def _version(asked: bool) -> None:
    if asked:
        typer.echo(raymarch.__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def _deferred() -> None:
    """The function of a deferred command. It is not called."""


for _name, _help in COMMANDS.items():
    app.command(_name, help=_help, cls=Deferred)(_deferred)
