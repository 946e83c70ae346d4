"""Leave out what a linked text never reads: functions, structs and their fields, parameters, and variables.

Alternatives of a function share one signature, and structs hold what any effect needs, so a scene's text holds some
that none of its functions reads. They are found from the words of the text, as a compiler finds them, and taken out
where they are declared, given and set. What is given is taken out only if computing it changes nothing else. Names
count, not their scopes, so a name that is read anywhere stays.

The text is that of the package: one name in each declaration, overloads that differ in more than what they do not read,
no macros. GLSL that a user wrote may be any; it stays as it is, and so does what bears one of its words.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import compress

from raymarch import glsl
from raymarch.shader.chunk import Mapped

_SETS = frozenset(("=", "+=", "-=", "*=", "/="))
_CHANGES = _SETS | {"++", "--"}
_INTERFACE = frozenset(("uniform", "in", "out", "layout", "precision"))
_BEGINS = frozenset((";", "{", "}"))
_AFTER_NAMES = frozenset(("=", ";", "[", ","))
_OPEN, _CLOSE = frozenset("([{"), frozenset(")]}")
_BRACKETS = _OPEN | _CLOSE

FEW = 4
"""Most uses of a variable that is looked at."""

Span = tuple[int, int]
"""The first word of some, and the one after the last."""


def trimmed(lines: Sequence[Mapped], roots: frozenset[str] = frozenset({"main"})) -> list[Mapped]:
    """The lines of a whole text, the mains of all passes among them, without what none of them reads.

    roots : the functions that the driver or a host calls.
    """
    roots |= {word for line in lines if line.given for word in glsl.words(line.text.replace("#", " "))}  # macros too
    gone = _unread(tuple([() if line.given else _shape(line.text) for line in lines]), roots)
    kept: list[Mapped] = []
    for line, left_out in zip(lines, gone, strict=True):
        text = _without(line.text, left_out) if left_out else line.text
        if not left_out or glsl.placed_words(text)[0]:
            kept.append(line if text == line.text else replace(line, text=text))
            continue
        while kept and kept[-1].text.startswith("//"):  # a comment on what is gone
            kept.pop()
    return kept


@lru_cache(8192)
def _shape(line: str) -> tuple[str, ...]:
    """The words of a line, with one number for all numbers."""
    words, _ = glsl.placed_words(line)
    return tuple(["0" if word.lstrip(".")[:1].isdigit() else word for word in words])


@lru_cache(256)
def _unread(lines: tuple[tuple[str, ...], ...], roots: frozenset[str]) -> tuple[frozenset[int], ...]:
    """Which words of each line of a text are never read."""
    words = [word for line in lines for word in line]
    left = list(range(len(words)))
    while spans := _Words(words, roots).unread():
        stay = bytearray(b"\1") * len(words)
        for first, last in spans:
            stay[first:last] = bytes(last - first)
        left, words = list(compress(left, stay)), list(compress(words, stay))
    kept, begin, found = set(left), 0, []
    for line in lines:
        found.append(frozenset(i for i in range(len(line)) if begin + i not in kept))
        begin += len(line)
    return tuple(found)


def _without(line: str, left_out: frozenset[int]) -> str:
    """A line without some of its words and the space behind them."""
    words, places = glsl.placed_words(line)
    text, at = "", 0
    for i in sorted(left_out):
        text += line[at : places[i]]
        at = max(at, places[i] + len(words[i]))
        at += len(line[at:]) - len(line[at:].lstrip(" "))
    return (text + line[at:]).rstrip()


@dataclass(frozen=True, slots=True)
class _Body:
    """What the words of a function's body say by themselves; places count from its first word.

    uses : how often each word occurs. called : the names before a round bracket.
    declared : the places of the names that follow a type. own : these names, and what else a declaration lists.
    changed : the variable before each change and, of ++ and --, the word after it.
    members : the places of what follows a dot. read : what is used otherwise than to declare or to set it.
    """

    uses: Counter[str]
    called: frozenset[str]
    declared: tuple[int, ...]
    own: frozenset[str]
    changed: frozenset[tuple[str, str]]
    members: tuple[int, ...]
    read: frozenset[str]


@lru_cache(4096)
def _body(words: tuple[str, ...]) -> _Body:
    """Most functions of a text are those of other texts, and stay while others lose words."""
    declared: list[int] = []
    own, changed, called, read = set[str](), set[tuple[str, str]](), set[str](), set[str]()
    opened, opens = list[int](), dict[int, int]()
    for i, word in enumerate(words[:-1]):
        after = words[i + 1]
        if word in _OPEN:
            opened.append(i)
            if word == "(" and words[i - 1].isidentifier():
                called.add(words[i - 1])
        elif word in _CLOSE:
            opens[i] = opened.pop()
        elif word in _CHANGES:
            first = i - 1
            while words[first] in _CLOSE or words[first - 1] == "." or words[first] == ".":
                first = opens[first] - 1 if words[first] in _CLOSE else first - 1
            changed.add((words[first], after if word in ("++", "--") else ""))
        elif after in _AFTER_NAMES and word.isidentifier():
            if glsl.is_type(words[i - 1]):
                declared.append(i)
                own.add(word)
            elif after == "=" and words[i - 1] == ",":
                own.add(word)
        if after not in _SETS and words[i - 1] != "." and not (after == ";" and declared[-1:] == [i]):
            read.add(word)
    members = tuple([i + 1 for i, word in enumerate(words) if word == "."])
    found = frozenset(called), tuple(declared), frozenset(own), frozenset(changed), members, frozenset(read)
    return _Body(Counter(words), *found)


@dataclass(frozen=True, slots=True)
class _Defined:
    """A function: its parameters, each with its qualifier, name and words; and the words of its body, none for a
    prototype."""

    name: str
    given: tuple[tuple[str, str, Span], ...]
    body: Span
    head: Span


@dataclass
class _Words:
    """The words of a text without those that are left out, and what they declare."""

    words: list[str]
    roots: frozenset[str]
    structs: dict[str, list[tuple[str, Span]]] = field(default_factory=dict)
    functions: list[_Defined] = field(default_factory=list)
    globals: list[tuple[str, Span, Span]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pair()
        self._declare()

    def _pair(self) -> None:
        """Where each bracket closes."""
        self.closes: dict[int, int] = {}
        opened: list[int] = []
        for i in [i for i, word in enumerate(self.words) if word in _BRACKETS]:
            if self.words[i] in _OPEN:
                opened.append(i)
            else:
                self.closes[opened.pop()] = i

    def _declare(self) -> None:
        words, at = self.words, 0
        while at < len(words):
            if words[at] == "struct":
                end = self.closes[at + 2]
                self.structs[words[at + 1]] = [
                    (words[last - 2], (first, last)) for first, last in self._fields(at, end)
                ]
                at = end + 2
                continue
            opened = next((i for i in range(at, len(words)) if words[i] in ("(", "=", ";", "{")), len(words))
            if opened < len(words) and words[opened] == "(" and words[at] != "layout":
                close = self.closes[opened]
                body = (close + 1, self.closes[close + 1] + 1) if words[close + 1] == "{" else (close + 1, close + 1)
                given = tuple(self._parameter(span) for span in self._split(opened))
                self.functions.append(_Defined(words[opened - 1], given, body, (at, close + 1)))
                at = body[1] + (words[close + 1] == ";")
                continue
            first = at
            while at < len(words) and words[at] != ";":
                at = self.closes.get(at, at) + 1
            at += 1
            if words[first] not in _INTERFACE:
                self.globals.append((words[opened - 1], (opened + 1, at), (first, at)))

    def _fields(self, at: int, end: int) -> Iterator[Span]:
        """The words of each field of a struct, with its semicolon."""
        first = at + 3
        for i in range(first, end):
            if self.words[i] == ";":
                yield first, i + 1
                first = i + 1

    def _split(self, opened: int) -> list[Span]:
        """What the commas between two brackets separate."""
        found, first, i, close = [], opened + 1, opened + 1, self.closes[opened]
        while i < close:
            if self.words[i] == ",":
                found.append((first, i))
                first = i + 1
            i = self.closes.get(i, i) + 1
        return [*found, (first, close)] if close > opened + 1 and self.words[opened + 1] != "void" else []

    def _parameter(self, span: Span) -> tuple[str, str, Span]:
        first, last = span
        bracket = next((i for i in range(first, last) if self.words[i] == "["), last)
        return self.words[first], self.words[bracket - 1], span

    # What is read

    @cached_property
    def _types(self) -> frozenset[str]:
        return glsl.LANGUAGE | self.structs.keys()

    @cached_property
    def _sites(self) -> dict[str, list[int]]:
        """The words at which functions and structs are called or declared, by name: of the opening brackets."""
        found: dict[str, list[int]] = defaultdict(list)
        for i in self.closes:
            if self.words[i] == "(" and self.words[i - 1].isidentifier():
                found[self.words[i - 1]].append(i)
        for places in found.values():
            places.sort()
        return found

    def _is_pure(self, span: Span) -> bool:
        """Whether computing an expression changes nothing else."""
        return not any(word in _CHANGES for word in self.words[slice(*span)]) and self._called(span) <= self._pure

    def _called(self, span: Span) -> set[str]:
        """The functions of the text that some words call."""
        words = self.words
        called = {words[i - 1] for i in range(span[0] + 1, span[1]) if words[i] == "(" and words[i - 1].isidentifier()}
        return called - self._types

    @cached_property
    def _pure(self) -> set[str]:
        """The functions that change nothing but their own variables, and call only such."""
        impure = {each.name for each in self.functions if not self._changes_only_its_own(each)}
        calls = [(each.name, self._of_body(each).called - self._types) for each in self.functions]
        pure = {each.name for each in self.functions} - impure
        while more := {name for name, called in calls if name in pure and not called <= pure}:
            pure -= more
        return pure

    def _changes_only_its_own(self, function: _Defined) -> bool:
        if function.body[0] == function.body[1] or any(word in ("out", "inout") for word, *_ in function.given):
            return False
        body = self._of_body(function)
        own = body.own.union([name for _, name, _ in function.given])
        return all(before in own or after in own for before, after in body.changed)

    def unread(self) -> list[Span]:
        """What is never read, to be taken out at once."""
        parts = (self._fields_unread(), self._parameters(), self._variables(), self._uncalled())
        return [span for spans in parts for span in spans]

    def _uncalled(self) -> Iterator[Span]:
        """The functions that nothing calls, and the structs that nothing names."""
        for function in self.functions:
            if function.name not in self.roots and self._uses[function.name] == 1:
                yield function.head[0], function.body[1]
        for struct, fields in self.structs.items():
            if struct not in self.roots and self._uses[struct] == 1:
                yield fields[0][1][0] - 3, fields[-1][1][1] + 2

    @cached_property
    def _uses(self) -> Counter[str]:
        return Counter(self.words)

    def _statement(self, at: int) -> Span | None:
        """The statement that sets what ends at a word, if it is one by itself and does nothing else."""
        first = at
        while self.words[first - 1] == "." or (self.words[first] == "." and self.words[first - 1].isidentifier()):
            first -= 1
        end = at + 1
        while self.words[end] != ";":
            end = self.closes.get(end, end) + 1
        whole = self.words[first - 1] in _BEGINS and self._is_pure((at + 2, end))
        return (first, end + 1) if whole else None

    def _fields_unread(self) -> Iterator[Span]:
        dead: dict[tuple[str, str], list[Span]] = {}
        for of, places in self._uses_of_fields().items():
            if all(self.words[i + 1] in _SETS for i in places):
                statements = [span for i in places if (span := self._statement(i)) is not None]
                if len(statements) == len(places):
                    dead[of] = statements
        for struct, fields in self.structs.items():
            chosen = {i for i, (name, _) in enumerate(fields) if (struct, name) in dead}
            if not chosen:
                continue
            calls = [self._split(site) for site in self._sites[struct]]
            chosen = {i for i in chosen if all(self._is_pure(call[i]) for call in calls)}
            if len(chosen) == len(fields) or struct in self.roots:
                continue
            for i in chosen:
                yield fields[i][1]
                yield from dead[struct, fields[i][0]]
            for call in calls:
                yield from _left_out(call, chosen)

    def _uses_of_fields(self) -> dict[tuple[str, str], list[int]]:
        """The words that name each field of each struct behind a dot, also where another type may have it."""
        words = self.words
        owners: dict[str, list[str]] = defaultdict(list)
        for struct, fields in self.structs.items():
            for name, _ in fields:
                owners[name].append(struct)
        uses: dict[tuple[str, str], list[int]] = {(of, name): [] for name, those in owners.items() for of in those}
        for places, types in [*self._bodies(), (self._between(), {})]:
            for i in places:
                if words[i] in owners:
                    of = types.get(words[i - 2]) if words[i - 3] != "." else None
                    for struct in owners[words[i]] if of is None else (of,):
                        if (struct, words[i]) in uses:
                            uses[struct, words[i]].append(i)
        return uses

    def _bodies(self) -> Iterator[tuple[list[int], dict[str, str | None]]]:
        """The words behind dots in each function's body, and the struct of each of its variables, None for several
        types."""
        words = self.words
        for function in self.functions:
            types: dict[str, str | None] = {}
            body, first = self._of_body(function), function.body[0]
            named = [(words[last - 2], name) for _, name, (_, last) in function.given if words[last - 1] == name]
            named += [(words[first + i - 1], words[first + i]) for i in body.declared]
            for type, name in named:
                types[name] = type if types.get(name, type) == type else None
            structs = {name: type if type in self.structs else None for name, type in types.items()}
            yield [first + i for i in body.members], structs

    def _between(self) -> list[int]:
        """The words behind dots outside of functions."""
        ends = [0, *(end for function in self.functions for end in function.body), len(self.words)]
        spans = zip(ends[::2], ends[1::2], strict=True)
        return [i for first, last in spans for i in range(first + 1, last) if self.words[i - 1] == "."]

    def _parameters(self) -> Iterator[Span]:
        by_name: dict[str, list[_Defined]] = defaultdict(list)
        for each in self.functions:
            by_name[each.name].append(each)
        for name, definitions in by_name.items():
            if name in self.roots:
                continue
            chosen = set.intersection(*map(self._unused, definitions))
            if not chosen or len({len(each.given) for each in definitions}) != 1:
                continue
            heads = {each.head[1] for each in definitions}
            calls = [self._split(i) for i in self._sites[name] if self.closes[i] + 1 not in heads]
            given = [[span for *_, span in each.given] for each in definitions]
            if any(len(spans) != len(given[0]) for spans in calls):
                continue
            chosen = {i for i in chosen if all(self._is_pure(call[i]) for call in calls)}
            for spans in (*given, *calls):
                yield from _left_out(spans, chosen)

    def _unused(self, function: _Defined) -> set[int]:
        """The parameters that a function does not name, by their places."""
        uses = self._of_body(function).uses
        return {i for i, (_, name, _) in enumerate(function.given) if name not in uses}

    def _of_body(self, function: _Defined) -> _Body:
        found = self._known.get(function.body)
        if found is None:
            found = self._known[function.body] = _body(tuple(self.words[slice(*function.body)]))
        return found

    @cached_property
    def _known(self) -> dict[Span, _Body]:
        return {}

    def _variables(self) -> Iterator[Span]:
        """The statements that declare and set variables that are not read."""
        words = self.words
        for name, value, span in self.globals:
            if name not in self.roots and self._uses[name] <= FEW and self._is_pure(value):
                yield from self._unread_variable(name, -1, self._uses[name], (), span)
        for function in self.functions:
            first, body = function.body[0], self._of_body(function)
            places = [first + i for i in body.declared]
            declared = [i for i in places if words[i + 1] in ("=", ";") and words[i - 2] in _BEGINS]
            for name in {words[i] for i in declared} - body.read:
                if body.uses[name] <= FEW:
                    yield from self._unread_variable(name, first, body.uses[name], declared)

    def _unread_variable(
        self, name: str, i: int, uses: int, declared: Sequence[int], declaration: Span = (0, 0)
    ) -> list[Span]:
        """What declares and sets a variable that is not read; nothing of one that is. i : after which it is used."""
        found: list[Span] = []
        for _ in range(uses):
            i = self.words.index(name, i + 1)
            if self.words[i - 1] == ".":
                continue
            if declaration[0] <= i < declaration[1]:
                found.append(declaration)
                continue
            end = i
            while self.words[end] != ";":
                end = self.closes.get(end, end) + 1
            if i in declared and self._is_pure((i + 2, end)):
                found.append((i - 1, end + 1))
                continue
            statement = self._statement(i) if self.words[i + 1] in _SETS else None
            if statement is None:
                return []
            found.append(statement)
        return found


def _left_out(spans: Sequence[Span], chosen: set[int]) -> Iterator[Span]:
    """Some of the parts between commas, each with one comma."""
    kept = False
    for i, (first, last) in enumerate(spans):
        if i > 0 and not (kept and i not in chosen):
            yield first - 1, first
        if i in chosen:
            yield first, last
        else:
            kept = True
