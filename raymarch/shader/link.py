"""Link the chunks of a shader: pull in what each uses, and sort them so that each follows what it uses.

A module has parts, which blank lines separate; the parts that nothing uses are left out. A name is given by a generated
chunk, or by a module of `raymarch.glsl`. If several modules define it, the plan has chosen one of them; see
`Plan.choices`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from raymarch import glsl
from raymarch.glsl import Declared, Module
from raymarch.shader.chunk import Chunk, Mapped


@dataclass(frozen=True)
class Linked:
    """What some chunks, the roots, use.

    names : all names that are defined there, also in parts of modules that are left out. asked : the name for which
    each module is linked, and the chunk that uses that name.
    """

    roots: Sequence[Chunk]
    used: Sequence[Chunk]
    names: frozenset[str]
    asked: Mapping[str, tuple[str, Chunk]]
    choices: Mapping[str, str]
    variants: frozenset[str]

    @cached_property
    def parts(self) -> dict[str, list[Chunk]]:
        """The parts of chunks that the roots use, directly or not, by the names of the chunks."""
        parts = [p for chunk in self.used for p in _chunks.get((chunk.name, self.variants), (None, chunk, (chunk,)))[2]]
        givers = {name: part for part in parts for name in part.gives}
        reached, pending = set[int](), list(self.roots)
        while pending:
            for name in pending.pop().needs:
                part = givers.get(name)
                if part is not None and id(part) not in reached:
                    reached.add(id(part))
                    pending.append(part)
        kept: dict[str, list[Chunk]] = {}
        for part in parts:
            if id(part) in reached:
                kept.setdefault(part.name, []).append(part)
        return kept

    @property
    def lines(self) -> list[Mapped]:
        """The text of what the roots use: chunks without the parts that nothing uses, and an empty line after each."""
        found: list[Mapped] = []
        for name, parts in self.parts.items():
            lines = [line for part in parts for line in part.lines]
            found += lines[1:] if lines and not lines[0].text else lines
            found.append(Mapped("", name))
        return found

    @property
    def reasons(self) -> dict[str, str]:
        """The reason of each linked module, by its name."""
        asked = {name: asking for name, asking in self.asked.items() if name in self.parts}
        return {name: self.choices.get(name) or f"used by {_use_of(*asking)}" for name, asking in asked.items()}


def module(name: str, variants: frozenset[str] = frozenset()) -> Chunk:
    """The chunk of a module of `raymarch.glsl`. variants : see `raymarch.glsl.load`."""
    found = glsl.load(name, variants)
    read, chunk, _ = _chunks.get((name, variants), (None, None, None))
    if read is not found or chunk is None:
        lines = tuple(
            Mapped(text, f"line {i} of raymarch/glsl/{name}.glsl", uniform=_uniform(text))
            for text, i in zip(found.lines, found.numbers, strict=True)
        )
        chunk = Chunk(name, found.needs, found.gives, lines)
        _chunks[name, variants] = found, chunk, tuple(_parts(chunk))
    return chunk


def _uniform(line: str) -> Declared | None:
    return glsl.declarations(line)[0] if line.startswith("uniform ") else None


_chunks: dict[tuple[str, frozenset[str]], tuple[Module, Chunk, tuple[Chunk, ...]]] = {}
"""The chunks of modules that were linked before, each with the text that it was made of, and its parts."""


def _parts(chunk: Chunk) -> Iterator[Chunk]:
    """The parts of a module. A comment before a blank line belongs to what follows."""
    lines: list[Mapped] = []
    for line in chunk.lines:
        if not line.text and any(not kept.text.startswith("//") for kept in lines):
            yield Chunk.of(chunk.name, lines)
            lines = []
        lines.append(line)
    yield Chunk.of(chunk.name, lines)


def link(
    roots: Sequence[Chunk],
    choices: Mapping[str, str],
    generated: Mapping[str, Callable[[], Chunk]],
    variants: frozenset[str] = frozenset(),
) -> Linked:
    """The chunks that the roots use, directly or not. The roots themselves are not among them.

    choices : chosen modules with their reasons. They are linked if something uses them.
    generated : makes the chunk that gives a name. It is called at most once for each name that is used.
    variants : see `raymarch.glsl.load`.

    Raises AssertionError if no chunk gives a name, if several modules give it and not exactly one is chosen, or if
    chunks use each other in a circle.
    """
    chosen: dict[str, str] = {}
    for choice in choices:
        for given in sorted(glsl.load(choice, variants).gives):
            if chosen.setdefault(given, choice) != choice:
                raise AssertionError(f"both {chosen[given]} and {choice} are chosen to give {given}")
    order: dict[str, Chunk] = {}
    givers: dict[str, Chunk] = {}
    asked: dict[str, tuple[str, Chunk]] = {}
    entered: list[str] = []

    def give(name: str, asking: Chunk) -> Chunk:
        if name in generated:
            found = generated[name]()
        else:
            names = (chosen[name],) if name in chosen else glsl.givers().get(name, ())
            if len(names) != 1:
                raise AssertionError(f"{asking.name} uses {name}, which {' and '.join(names) or 'nothing'} gives")
            found = module(names[0], variants)
            asked[found.name] = name, asking
        for given in found.gives:
            if givers.setdefault(given, found).name != found.name:
                raise AssertionError(f"both {givers[given].name} and {found.name} give {given}")
        return found

    def follow(chunk: Chunk) -> None:
        """Place what a chunk uses."""
        for name in sorted(chunk.needs):
            found = givers.get(name) or give(name, chunk)
            if found.name in order:
                continue
            if found.name in entered:
                raise AssertionError(f"{' uses '.join([*entered, found.name])}")
            entered.append(found.name)
            follow(found)
            entered.pop()
            order[found.name] = found

    for root in roots:
        follow(root)
    return Linked(roots, tuple(order.values()), frozenset(givers), asked, choices, variants)


def _use_of(name: str, asking: Chunk) -> str:
    """What uses a name: the module, or the part of the scene that the line was generated for, with the user's line."""
    for line in asking.lines:
        if name in line.text and not line.made_by.startswith("line "):
            return line.made_by.partition(",")[0] + (f" at {line.where}" if line.where else "")
    return asking.name
