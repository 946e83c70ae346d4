"""Chunks are pulled in by the names that they use, and each follows what it uses."""

from __future__ import annotations

from functools import partial

import pytest

from raymarch.shader.chunk import Chunk, Mapped
from raymarch.shader.link import link


def chunk(name: str, *lines: str) -> Chunk:
    return Chunk.of(name, [Mapped(line, f"the {name}") for line in lines])


MAIN = chunk("main", "void main() { shade(lit(1.0)); }")


def made(**texts: str) -> dict[str, partial[Chunk]]:
    return {name: partial(chunk, name, text) for name, text in texts.items()}


def test_what_is_used_comes_first_and_what_is_not_used_stays_out() -> None:
    generated = made(
        shade="void shade(float x) { base(x); }",
        lit="float lit(float x) { return base(x) + contact(vec3(x), x); }",
        base="float base(float x) { return x; }",
        unused="float unused() { return 1.0; }",
        contact_share="const float contact_share = 1.0;",
        epsilon_pixels="const float epsilon_pixels = 1.0;",
    )
    linked = link([MAIN], {"march/widths": "chosen", "view/camera": "chosen"}, generated)
    order = list(linked.parts)
    for before, after in (
        ("base", "lit"),
        ("base", "shade"),
        ("march/contact", "lit"),
        ("march/nearness", "march/contact"),
    ):
        assert order.index(before) < order.index(after)
    assert "unused" not in order and len(order) == len(set(order))
    assert linked.reasons["march/widths"] == "chosen"
    assert linked.reasons["march/contact"] == "used by the lit"
    assert linked.reasons["march/nearness"] == "used by march/contact"


@pytest.mark.parametrize(
    ("text", "choices", "message"),
    [
        ("void main() { nowhere(); }", (), "main uses nowhere, which nothing gives"),
        ("void main() { safe_step(1.0); }", (), "main uses safe_step, which march/safe_step and"),
        ("void main() { loop(); }", (), "loop uses turn uses loop"),
        (
            "void main() {}",
            ("march/bracketing", "march/plain"),
            "both march/bracketing and march/plain are chosen to give step_length",
        ),
    ],
)
def test_names_that_no_chunk_or_several_give_are_refused(text: str, choices: tuple[str, ...], message: str) -> None:
    generated = made(
        loop="void loop() { turn(); }",
        turn="void turn() { loop(); }",
    )
    with pytest.raises(AssertionError, match=message):
        link([chunk("main", text)], dict.fromkeys(choices, "chosen"), generated)
