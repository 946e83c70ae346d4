"""Commands and options of other programs, and what is typed for them here. Messages about wrong usage read them."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from difflib import get_close_matches


def _keys(table: Mapping[str, str]) -> dict[str, str]:
    """One entry for each of the names of a row."""
    return {name: text for names, text in table.items() for name in names.split()}


COMMANDS = _keys(
    {
        "run show preview open gui play watch live serve window": "raymarch view SCENE.py",
        "draw image picture save trace": "raymarch render SCENE.py -o a.png",
        "film video animate movie": "raymarch render SCENE.py -o a.mp4 --frames 0:90",
        "mesh stl convert write": "raymarch export SCENE.py -o a.stl",
        "info check backends gpu devices system": "raymarch doctor",
        "compare bench benchmark profile measure": "raymarch cost SCENE.py",
        "plan shader glsl": "raymarch explain SCENE.py",
        "verify certify": "raymarch prove SCENE.py",
        "new init create": "a file with `import raymarch as rm` and `scene = rm.sphere()`",
        "help": "raymarch --help",
        "version": "raymarch --version",
    }
)
"""Names of commands, and what to type."""

OPTIONS = _keys(
    {
        "--width --height --resolution --res --dimensions -s -r -w": "--size WxH|--cells N",
        "--spp --aa --antialias --antialiasing --rays --samples": "--samples N|--reference-samples N|--quality NAME",
        "--frame --at --seconds -t": "--time SECONDS|--frames A:B",
        "--start --end --duration --animation --animate --length": "--frames A:B",
        "--out --file --dest --output-file --save": "-o FILE|--json FILE",
        "--format --type -f": "-o FILE: its suffix is the format",
        "--param --params --define --value -p -D": "--set NAME=VALUE",
        "--transparent --transparency --no-background": "--alpha",
        "--background --bg --sky --light --lights --material --color --colour": "in the scene: rm.Scene(node, sky=...)",
        "--camera --eye --position --target --fov --look-at": "in the scene: rm.Scene(node, rm.Camera(eye, target))",
        "--gpu --cuda --headless --egl --cpu --software": "--backend NAME|--device N",
        "--threads --jobs --processes -j": "--cluster local",
        "--preset --settings-preset": "--quality NAME",
        "--accuracy --max-error --precision --within": "--error 0.5px|--tolerance 0.05px",
        "--max-time --limit --timeout": "--within 16ms",
        "--shader": "--glsl|-o FILE.glsl",
        "--reload --watch --hot-reload": "nothing: the window reloads a saved file",
    }
)
"""Names of options, and what to type: the first of the options that the command has, or words."""

NEAR = 0.8
"""How similar names are (`difflib`) of which one is suggested for the other."""


def for_command(name: str) -> str:
    """What to type for an unknown command; nothing for a name that says nothing."""
    return COMMANDS.get(name.lower(), "")


def for_option(name: str, known: Collection[str]) -> str:
    """What to type for an unknown option of a command; nothing for a name that says nothing.

    known : the options of the command.
    """
    for text in OPTIONS.get(name, "").split("|"):
        first = re.split(r"[ :.]", text)[0]
        if text and (not first.startswith("-") or first in known):
            return text
    longer = [option for option in known if len(name) > 3 and option.startswith(name)]
    return next(iter(longer or get_close_matches(name, list(known), 1, NEAR)), "")
