"""What `mkdocs build` adds to the pages: the files that they name outside of docs/, and the scenes as WebGL pages.

`RAYMARCH_SITE=pages mkdocs build` leaves the WebGL pages out, which takes a few seconds instead of half a minute.
"""

from __future__ import annotations

import logging
import os
import re
import tempfile
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
OUTSIDE = re.compile(r"\]\(\.\./([^)#]+)\)")
"""A link to a file of the repository that is outside of docs/."""

SCENES = re.compile(r"^- \*\*Browser\*\*: `raymarch export (\S+) -o (\S+)\.html`$", re.MULTILINE)
"""The line of the gallery with the command that writes a scene as a page."""

log = logging.getLogger("mkdocs.hooks.raymarch")


def on_files(files: Files, config: Any) -> Files:
    """Add the files outside of docs/ that pages link to, as text, and the WebGL pages of the gallery."""
    texts = [file.content_string for file in files.documentation_pages()]
    for name in sorted({name for text in texts for name in OUTSIDE.findall(text)}):
        if (ROOT / name).is_file():  # else the strict build fails on the link
            files.append(File.generated(config, _as_text(name), content=(ROOT / name).read_text(encoding="utf-8")))
    if os.environ.get("RAYMARCH_SITE") != "pages":
        gallery = files.get_file_from_path("gallery.md")
        for path, name in SCENES.findall(gallery.content_string if gallery else ""):
            files.append(File.generated(config, f"webgl/{name}.html", content=_webgl(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Any, files: Files, **_: Any) -> str:
    """Turn links to files outside of docs/ into links to their copies, and commands of the gallery into links."""
    # Code hosts read \| in the code of a table as |, Python-Markdown does not.
    markdown = re.sub(r"`[^`\n]+`", lambda match: match[0].replace("\\|", "|"), markdown)
    markdown = OUTSIDE.sub(lambda match: f"]({_as_text(match[1])})", markdown)

    def link(match: re.Match[str]) -> str:
        page = f"webgl/{match[2]}.html"
        return f"{match[0]} ([open it]({page}))" if files.get_file_from_path(page) else match[0]

    return SCENES.sub(link, markdown)


def on_post_page(output: str, **_: Any) -> str:
    """Name the dialogue of the search, for readers of the screen."""
    return output.replace(
        'data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"'
    )


def _as_text(name: str) -> str:
    """The path on the site of a copy of a file: browsers show .txt and download .py."""
    return f"source/{name}.txt"


def _webgl(scene: Path) -> str:
    """A scene as a page; a page with the reason where a page cannot hold the scene."""
    import raymarch as rm
    from raymarch.errors import RaymarchError
    from raymarch.scene import load

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "page.html"
        try:
            rm.export(load(scene), str(file))
        except RaymarchError as error:
            log.warning("%s has no page: %s", scene, error)
            return f"<!doctype html><title>no page</title><p>{error}</p>"
        return file.read_text(encoding="utf-8")
