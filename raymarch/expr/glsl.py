"""The GLSL reading: functions of the expression language as readable GLSL.

One text serves `#version 330 core` and `#version 300 es`. A value gets a temporary only if it is used twice, or if the
nesting would be too deep. Temporaries have the names that the function states, or one for their type.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count, repeat
from types import MappingProxyType

from raymarch.errors import SceneError
from raymarch.expr.atlas import Place
from raymarch.expr.branches import Branch, Leaf, Tree, branched, roots_of
from raymarch.expr.function import Function, Loop
from raymarch.expr.last_reads import LastReads, eager
from raymarch.expr.node import Expr, make, simplify, var
from raymarch.expr.pieces import (
    ATOM,
    UNARY,
    Line,
    Piece,
    constant,
    identifier,
    laid_out,
    literal,
)
from raymarch.expr.pieces import call_text as call_text
from raymarch.expr.raw import RawFunction
from raymarch.expr.rolled import paired, rolled_tree
from raymarch.expr.samples import Samples
from raymarch.expr.tables import Table
from raymarch.expr.templates import TEMPLATES as TEMPLATES
from raymarch.expr.templates import Template
from raymarch.expr.texels import Texels
from raymarch.expr.types import BOOL, FLOAT, STATE, Type
from raymarch.expr.walk import depends_on, direct_calls, find, substitute, topological

DEPTH = 16

TURNS = 256
"""Printed bound of loops that compilers must not unroll. They end by a comparison of floats, which compilers do not
count."""

UNIFORM_PREFIX = "u_"
TIME = "u_time"


class Dialect:
    """How GLSL writes what languages of its kind write differently. Another language is a subclass.

    templates : the text of each operation.
    """

    templates: Mapping[str, Template] = TEMPLATES

    def constant(self, node: Expr) -> str:
        """A constant of any type."""
        return constant(node)

    def head(self, name: str, type: Type, params: Sequence[tuple[Type, str]]) -> str:
        """The first line of a function; its body ends with a closing brace."""
        return f"{type.name} {name}({', '.join([f'{of.name} {param}' for of, param in params])}) {{"

    def declare(self, type: Type, name: str, changes: bool = False) -> str:
        """The declaration of a variable, up to its value. changes : it is assigned later."""
        return f"{type.name} {name} = "

    def loop(self, counter: str, count: int) -> str:
        """The first line of a loop with an integer counter from 0."""
        return f"for (int {counter} = 0; {counter} < {count}; {counter}++) {{"

    def number(self, counter: str) -> str:
        """An integer as a float."""
        return f"float({counter})"

    leave: tuple[str, str] = ("if (", ") break;")
    """What stands around the condition under which a loop ends."""


@dataclass(slots=True)
class Text:
    """The functions of a field in order of definition, and their requirements."""

    names: dict[Function, str]
    functions: list[list[Line]]
    helpers: dict[tuple[str, str], str]
    uniforms: dict[str, Expr]
    uses_time: bool
    samples: dict[str, Samples | Texels | Table] = field(default_factory=dict)
    uniform_names: dict[Expr, str] = field(default_factory=dict)
    needs: set[str] = field(default_factory=set)
    """Functions that it calls and that the shader must define."""
    for_web: bool = False
    """True if browsers must take it, too: WebGL refuses `?:` for structures."""
    dialect: Dialect = field(default_factory=Dialect)
    constants: frozenset[str] = frozenset()
    """Names of the data that the function `constant_number` gives, in place of textures."""
    places: Mapping[str, Place] = field(default_factory=dict)
    """Pictures that are parts of an atlas, by name."""
    trees: Mapping[Function, Branch] = field(default_factory=dict)
    """The functions that return from branches; see `raymarch.expr.branches`."""
    rolled: bool = False
    """True if loops that may end early are not to be unrolled: into branches as deep as they have turns."""
    rolls: bool = False
    """True if long folds over constants are loops; see `raymarch.expr.rolled`."""

    def lines(self) -> list[Line]:
        """Helpers and functions, with an empty line between them."""
        result: list[Line] = []
        for helper in self.helpers.values():
            result += [Line(text, None) for text in helper.split("\n")] + [Line("", None)]
        for lines in self.functions:
            result += [*lines, Line("", None)]
        return result[:-1]


def print_functions(
    roots: Sequence[Function],
    taken: Iterable[str] = (),
    for_web: bool = False,
    constants: frozenset[str] = frozenset(),
    dialect: Dialect | None = None,
    places: Mapping[str, Place] = MappingProxyType({}),
    branches: bool = False,
    rolls: bool = False,
) -> Text:
    """GLSL of some functions and of all their callees, each once. The further arguments : see `Text`."""
    trees: dict[Function, Branch] | None = {} if branches else None
    order = _callees_first(roots, trees)
    names: dict[Function, str] = {}
    expressions = [root.body for root in roots]
    uniforms = _uniforms(expressions, frozenset(taken))
    occupied = {*taken, *uniforms, TIME}
    occupied |= _names_in_raw(expressions, occupied.union(root.name for root in roots))
    numbers: dict[str, int] = {}
    for definition in [*roots, *order]:  # the roots keep their own names
        if definition not in names:
            wanted = definition.name
            names[definition] = wanted if definition in roots else identifier(wanted, occupied, numbers)
            occupied.add(names[definition])
    text = Text(names, [], {}, uniforms, bool(find(expressions, "time")), for_web=for_web, constants=constants)
    text.dialect, text.places, text.trees, text.rolled = dialect or text.dialect, places, trees or {}, branches
    text.rolls = rolls and not for_web
    text.uniform_names = {leaf: name for name, leaf in uniforms.items()}
    for definition in order:
        text.functions.append(FunctionPrinter(definition, text, occupied).run())
    return text


def _names_in_raw(expressions: Sequence[Expr], taken: set[str]) -> set[str]:
    """Names defined by raw GLSL functions; SceneError for duplicates."""
    givers: dict[str, RawFunction] = {}
    for node in find(expressions, "raw", "raw_slope"):
        function: RawFunction = node.data
        for name in function.defines:
            other = givers.setdefault(name, function)
            if name in taken or other.code != function.code:
                whose = "the shader" if name in taken else f"another GLSL function than {function.name}"
                raise SceneError(f"the GLSL name {name} is used by {whose}", legal="another name")
    return set(givers)


def _uniforms(expressions: Sequence[Expr], taken: frozenset[str]) -> dict[str, Expr]:
    """Parameters of some expressions, by GLSL name."""
    uniforms: dict[str, Expr] = {}
    for leaf in find(expressions, "param"):
        name = uniform_name(leaf, taken)
        other = uniforms.setdefault(name, leaf)
        if other is not leaf:
            what = f"the parameters '{other.data.name}' and '{leaf.data.name}' would both be {name} in GLSL"
            legal = "one Param, used twice, or names that differ in letters or digits"
            raise SceneError(what, legal=legal, where=leaf.data.where)
    return uniforms


def uniform_name(leaf: Expr, taken: frozenset[str] = frozenset()) -> str:
    """The GLSL name of a parameter, not among those taken, or of the time. GLSL has the letters of ASCII only."""
    if leaf.op == "time":
        return TIME
    name = "".join(c if c.isascii() else f"x{ord(c):x}" for c in leaf.data.name)
    return identifier(UNIFORM_PREFIX + name, taken | {TIME})


def _callees_first(roots: Sequence[Function], trees: dict[Function, Branch] | None) -> list[Function]:
    """The functions in the order of their text. trees : where given, gets those that return from branches."""
    order: dict[Function, None] = {}
    stack: list[tuple[Function, bool]] = [(root, False) for root in reversed(roots)]
    open_: set[Function] = set()
    while stack:
        definition, done = stack.pop()
        if done:
            order[definition] = None
        elif definition not in open_:
            open_.add(definition)
            stack.append((definition, True))
            tree = branched(definition) if trees is not None else None
            if trees is not None and tree is not None:
                trees[definition] = tree
            callees = [call.data for call in direct_calls(roots_of(tree) if tree else (definition.body,))]
            stack.extend(zip(reversed(callees), repeat(False)))
    return list(order)


# Printing one function


@dataclass(slots=True)
class FunctionPrinter:
    """Prints one function: statements for shared values, one expression for the rest."""

    definition: Function
    text: Text
    taken_outside: set[str]
    lines: list[Line] = field(default_factory=list)
    names: dict[Expr, str] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    numbers: dict[str, int] = field(default_factory=dict)
    wanted: dict[Expr, str] = field(default_factory=dict)
    indent: int = 1

    @property
    def helpers(self) -> dict[tuple[str, str], str]:
        return self.text.helpers

    def run(self) -> list[Line]:
        self.taken = set(self.taken_outside)
        self.wanted = dict(self.definition.names)
        for param in self.definition.params:
            self.names[param] = self._name(param.data)
        params, body = [(p.type, self.names[p]) for p in self.definition.params], self.definition.body
        head = self.text.dialect.head(self.text.names[self.definition], body.type, params)
        tree: Tree | None = self.text.trees.get(self.definition)
        if self.text.rolled and not self.text.for_web:
            tree = tree or Leaf((paired(body),), {})
            tree = rolled_tree(tree) if self.text.rolls else tree
        self._return(tree or Leaf((body,), {}))
        return [Line(head, body), *self.lines, Line("}", None)]

    def _name(self, wanted: str) -> str:
        name = identifier(wanted, self.taken, self.numbers)
        self.taken.add(name)
        return name

    def _return(self, tree: Tree) -> None:
        """Print what returns the value of a tree."""
        for k, value in enumerate(tree.first if isinstance(tree, Branch) else ()):
            self.wanted[value] = "part"
            self.emit([value], lambda _i, _piece: None, roots_of(tree)[k + 1 :])  # what is read later gets a name
        while isinstance(tree, Branch):
            after = [*roots_of(tree.yes), *roots_of(tree.no)]
            self.emit([tree.condition], partial(self._begin_if, tree.condition), after)
            self.indent += 1
            outside = dict(self.names)
            self._return(tree.yes)
            self.names = outside
            self.indent -= 1
            self.lines.append(Line("    " * self.indent + "}", None))
            tree = tree.no
        (value,) = tree.values
        self.emit([value], lambda _i, piece: self._statement("return ", piece, ";", value))

    def _begin_if(self, condition: Expr, _i: int, piece: Piece) -> None:
        self._statement("if (", piece, ") {", condition)

    def emit(self, roots: Sequence[Expr], finish: Callable[[int, Piece], None], after: Sequence[Expr] = ()) -> None:
        """Print statements for shared values, then call `finish(i, piece)` for each root in turn.

        after : what is printed later, and may share values with the roots.
        """
        loops: dict[Expr, _OpenLoop] = {}

        def arguments(node: Expr) -> tuple[Expr, ...]:
            if node in self.names:
                return ()
            if node.op != "loop":
                return node.args
            if node not in loops:
                loops[node] = self._open(node)
            return (*node.args[: len(node.data.state)], *loops[node].hoisted)

        order = topological(roots)
        plain = "loop" not in {node.op for node in order} and self._read_whole(order)
        if not plain:
            order = topological(roots, arguments)
        early = self.text.rolled and not self.text.for_web
        if early and not loops:
            order = eager(order, lambda node: node.args if plain else arguments(node))
        here = set(order)
        uses: defaultdict[Expr, int] = defaultdict(int)
        for root in roots:
            uses[root] += 1
        for node in order:
            for arg in node.args if plain else arguments(node):
                uses[arg] += 1
        for node in topological(after, lambda node: () if node in here else node.args) if after else ():
            uses[node] += node in here
        forced = {h for opened in loops.values() for h in opened.hoisted}
        held = LastReads(uses) if early else None
        pieces: dict[Expr, Piece] = {}
        waiting = list(enumerate(roots))
        final = set(roots)
        for node in order:
            if node.type is STATE:
                self._print_loop(node, loops[node], pieces)
                continue
            piece = self._piece(node, pieces)
            deep = piece.depth > DEPTH or (held is not None and held.ends(node, self.names))
            if (
                (deep or uses[node] > 1 or node in forced)
                and node not in self.names
                and not (uses[node] == 1 and node in final)  # a root that nothing else reads needs no temporary
                and (deep or not self._is_cheap(node))
            ):
                piece = self._temporary(node, piece)
            pieces[node] = piece
            while waiting and waiting[0][1] in pieces:
                i, root = waiting.pop(0)
                finish(i, pieces[root])

    def _read_whole(self, order: Sequence[Expr]) -> bool:
        """True if none of some expressions has a name in place of its arguments."""
        return not [node for node in self.names.keys() & set(order) if node.args]

    def _is_cheap(self, node: Expr) -> bool:
        while node.op in ("swizzle", "field", "neg", "within", "stop_gradient") and node not in self.names:
            node = node.args[0]
        return node.op in ("const", "var", "param", "time", "item") or node in self.names

    def _piece(self, node: Expr, pieces: Mapping[Expr, Piece]) -> Piece:
        if node in self.names:
            return Piece(self.names[node], ATOM, 0)
        if node.op == "const":
            text = self.text.dialect.constant(node)
            return Piece(text, UNARY if text.startswith("-") else ATOM, 0)
        if node.op in ("param", "time"):
            return Piece(self.text.uniform_names.get(node) or uniform_name(node), ATOM, 0)
        if node.op == "var":  # a variable of the shader, or an element of an array
            self.text.needs.add(node.data.partition("[")[0])
            return Piece(node.data, ATOM, 0)
        args = list(map(pieces.__getitem__, node.args))
        if node.op == "call":
            return call_text(self.text.names[node.data], args, node.args)
        return self.text.dialect.templates[node.op](self, node, args)

    def _temporary(self, node: Expr, piece: Piece) -> Piece:
        name = self._name(self.wanted.get(_value_of(node)) or _default_name(node))
        self._statement(self.text.dialect.declare(node.type, name), piece, ";", node)
        self.names[node] = name
        return Piece(name, ATOM, 0)

    def _statement(self, before: str, piece: Piece, after: str, source: Expr | None) -> None:
        self.lines += laid_out("    " * self.indent, before, piece, after, source)

    # Loops

    def _open(self, node: Expr) -> _OpenLoop:
        """The body of a loop over new variables, with the captured values substituted."""
        body: Loop = node.data
        n = len(body.state)
        serial = next(_serials)
        index = var(f"turn {serial}", FLOAT)
        state = tuple(var(f"state {serial} {k}", s.type) for k, s in enumerate(body.state))
        replacements = dict(
            zip((body.index, *body.state, *body.captured), (index, *state, *node.args[n:]), strict=True)
        )
        inner = substitute(body.inner, replacements)
        changing = depends_on(inner, (index, *state))
        hoisted: dict[Expr, None] = {}
        if body.is_branch:  # only captured values are computed outside
            changing = set(topological(inner))
            hoisted.update((a, None) for a in node.args[n:] if not self._is_cheap(a))
            changing -= hoisted.keys()
        for expression in topological(inner):
            if expression in changing:
                outer = [a for a in expression.args if a not in changing]
                hoisted.update((a, None) for a in outer if not self._is_cheap(a))
        hoisted.update((e, None) for e in inner if e not in changing and not self._is_cheap(e))
        for original, renamed in zip(body.state, state, strict=True):
            if original in self.wanted:
                self.wanted[renamed] = self.wanted[original]
        return _OpenLoop(index, state, inner[:n], inner[n] if body.until is not None else None, list(hoisted))

    def _print_loop(self, node: Expr, opened: _OpenLoop, pieces: Mapping[Expr, Piece]) -> None:
        for k, state in enumerate(opened.state):
            self.names[state] = self._name(self.wanted.get(state) or _default_name(state))
            declared = self.text.dialect.declare(state.type, self.names[state], changes=True)
            self._statement(declared, pieces[node.args[k]], ";", node)
            self.names[make("item", state.type, (node,), k)] = self.names[state]
        if node.data.is_branch:
            self._print_branch(node, opened)
            return
        counter = self._name("i")
        self.names[opened.index] = self.text.dialect.number(counter)
        most = node.data.count
        kept = most < TURNS and (node.data.kept or (self.text.rolled and opened.until is not None))
        self.lines.append(Line("    " * self.indent + self.text.dialect.loop(counter, TURNS if kept else most), node))
        self.indent += 1
        if kept:
            before, after = self.text.dialect.leave
            over = f"{self.text.dialect.number(counter)} >= {literal(most)}"
            self.lines.append(Line("    " * self.indent + before + over + after, node))
        outside = dict(self.names)
        roots = ([opened.until] if opened.until is not None else []) + list(opened.step)
        news: list[Piece] = []

        def finish(i: int, piece: Piece) -> None:
            if i == 0 and opened.until is not None:
                before, after = self.text.dialect.leave
                self._statement(before, piece, after, node)
            else:
                news.append(piece)

        self.emit(roots, finish)
        self._close(opened, news, outside)

    def _print_branch(self, node: Expr, opened: _OpenLoop) -> None:
        """A loop of one turn that may end before it, as an `if`."""
        assert opened.until is not None
        self.names[opened.index] = "0.0"
        taken = simplify("not", BOOL, (opened.until,))
        self.emit([taken], lambda _i, piece: self._statement("if (", piece, ") {", node))
        self.indent += 1
        outside = dict(self.names)
        news: list[Piece] = []
        self.emit(opened.step, lambda _i, piece: news.append(piece))
        self._close(opened, news, outside)

    def _close(self, opened: _OpenLoop, news: list[Piece], outside: dict[Expr, str]) -> None:
        """Assign all state variables, each when no other value reads its old value, and end the block."""
        names = [self.names[state] for state in opened.state]
        todo = {k: p for k, p in enumerate(news) if p.text != names[k]}
        while todo:
            others = {k: [p.text for j, p in todo.items() if j != k] for k in todo}
            free = next((k for k in todo if not any(_mentions(text, names[k]) for text in others[k])), None)
            if free is not None:
                self._statement(f"{names[free]} = ", todo.pop(free), ";", opened.step[free])
                continue
            k = next(iter(todo))
            saved = self._name(f"next_{names[k]}")
            declared = self.text.dialect.declare(opened.state[k].type, saved)
            self._statement(declared, todo[k], ";", opened.step[k])
            todo[k] = Piece(saved, ATOM, 0)
        self.names = outside
        self.indent -= 1
        self.lines.append(Line("    " * self.indent + "}", None))


@dataclass(slots=True)
class _OpenLoop:
    index: Expr
    state: tuple[Expr, ...]
    step: Sequence[Expr]
    until: Expr | None
    hoisted: list[Expr]


_serials = count(1)
"""Numbers of loops that are printed, which make their variables distinct."""


def _mentions(text: str, name: str) -> bool:
    return re.search(rf"\b{re.escape(name)}\b", text) is not None


def _value_of(node: Expr) -> Expr:
    """The call of the function itself, for a call that returns its gradient too; any other expression as it is."""
    plain = node.data.stated.gradient_of if node.op == "call" else None
    return node if plain is None else make("call", plain.type, node.args, plain)


def _default_name(node: Expr) -> str:
    if node.type.fields:
        return node.type.name.lower()
    if node.type.is_matrix:
        return "m"
    if node.type.is_vector:
        return {2: "v", 3: "q", 4: "g"}[node.type.size]
    return "c" if node.type is BOOL else "d"
