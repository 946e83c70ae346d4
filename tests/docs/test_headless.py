"""The recipes for CI and containers install what the README's command installs, and call commands that exist."""

from __future__ import annotations

import re
from pathlib import Path

from raymarch.cli.commands import app

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "headless.md").read_text()
DOCKERFILE = (ROOT / "Dockerfile").read_text()


def installed(text: str) -> set[str]:
    """The Debian packages of the driver that a text installs."""
    return set(re.findall(r"\blib\w+(?:-[\w-]+)?\b", text))


def test_the_recipes_install_the_driver_of_the_readme() -> None:
    readme = next(line for line in (ROOT / "README.md").read_text().splitlines() if line.startswith("apt-get update"))
    wanted = installed(readme)
    assert len(wanted) == 3
    assert installed(DOCKERFILE) == wanted
    lines = [line for line in PAGE.splitlines() if "apt-get install" in line]
    assert len(lines) == 2 and all(installed(line) == wanted for line in lines)


def test_the_recipes_call_commands_that_exist() -> None:
    code = "\n".join(re.findall(r"^```\w+\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL))
    calls = re.findall(r"(?:run: |^|/work\" )raymarch ([a-z]\w+.*)$", code, re.MULTILINE)
    known = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    assert len(calls) >= 3 and {call.split()[0] for call in calls} <= known


def test_the_image_holds_what_the_package_is_built_from() -> None:
    copied = re.findall(r"^COPY (.*) /src", DOCKERFILE, re.MULTILINE)
    names = {name for line in copied for name in line.split()}
    assert {"pyproject.toml", "README.md", "LICENSE", "raymarch"} == names and all((ROOT / n).exists() for n in names)
