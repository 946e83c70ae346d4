"""The words of the pages of docs/ by part of the navigation, and the way of a newcomer to a scene with glass.

python -m tests.lab.words
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
WAY = ("index.md", "start.md", "tutorial.md")
"""The pages that lead a newcomer from the first page to a scene with glass; each links to the next."""


def words(page: str) -> int:
    """The words of a page, code and tables included."""
    return len((DOCS / page).read_text(encoding="utf-8").split())


def parts() -> dict[str, list[str]]:
    """The pages of each part of the navigation, in order."""
    found: dict[str, list[str]] = {}
    title = ""
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    for line in navigation.splitlines():
        if match := re.fullmatch(r"  - ([\w ]+):", line):
            title = match[1]
        elif match := re.search(r": ([\w-]+\.md)$", line):
            found.setdefault(title if line.startswith("      ") else match[0][2:], []).append(match[1])
    return found


def main() -> None:
    for title, pages in parts().items():
        print(f"{sum(map(words, pages)):7,}  {title}: {', '.join(f'{page} {words(page):,}' for page in pages)}")
    print(f"{sum(words(page.name) for page in DOCS.glob('*.md')):7,}  in all")
    print("\nfrom the first page to a scene with glass:")
    for page in WAY:
        print(f"{words(page):7,}  {page}")
    print(f"{sum(map(words, WAY)):7,}  in all")


if __name__ == "__main__":
    main()
