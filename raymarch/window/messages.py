"""The messages over the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

from raymarch.scene.legal import violations
from raymarch.scene.parameter import Values
from raymarch.window import inputs
from raymarch.window.model import Model
from raymarch.window.news import Excerpt, near
from raymarch.window.state import shown

PATIENT = 0.6
"""Seconds after which a running trial is shown."""


LINES = 9
"""Number of parameters that are listed."""

LISTED = 4.0
"""Seconds for which the list of parameters stays after the last change."""

FADES = (1.0, 0.7, 0.4)
"""Opacities of the list of parameters in the last turns before it goes, for `FADE` seconds each."""

FADE = 0.25


@dataclass(frozen=True, slots=True)
class Message:
    """A block of text.

    text : the lines; a tab separates two columns. An empty line separates paragraphs, which stand in two columns where
        they are too high.
    kind : "error", "note" or "busy".
    corner : "top left", "top right", "bottom left", "bottom right" or "middle" of the picture; at its top, "left" or
        "right" of the divider.
    code : a line of source, which stands below the first line of the text.
    swatch : the colour of squares in the text, sRGB.
    opacity : from 0 to 1.
    """

    text: str
    kind: str = "note"
    corner: str = "top left"
    code: Excerpt | None = None
    swatch: tuple[int, int, int] | None = None
    opacity: float = 1.0


def messages_of(model: Model, now: float) -> list[Message]:
    """The messages to show now. Removes an expired notice."""
    if model.help:
        return [Message(inputs.help_text(), "note", "middle")]
    messages = _sides(model)
    if model.draft is not None:
        question = f"{model.draft.text()}\n\nF2 writes this into the file, Esc does not"
        messages.append(Message(question, "note", "middle"))
    if model.fault is not None and not model.closed:
        messages.append(Message(model.fault.words, "error", "bottom left", model.fault.excerpt))
    elif model.plan is not None and model.plan.conditions:
        shot = model.state.shot()
        broken = violations(model.plan.conditions, Values(shot.params, shot.time))
        messages += [Message(sentence, "busy", "bottom left") for sentence in broken]
    if model.trial is not None and now - model.trial[1] > PATIENT:
        file, since = model.trial
        doing = "a preview without shadows; compiling" if model.preview else "testing"
        waits = f"{near(str(file))}: {doing} for {now - since:.0f} s (Esc stops it)"
        messages.append(Message(waits, "busy", "bottom left"))
    if model.drawn.lights is not None:
        some, every = model.drawn.lights
        messages.append(Message(f"{100 * some // every} % of the light so far", "busy", "bottom left"))
    if model.notice_until <= now:
        model.notice_text = ""
    if model.notice_text:
        messages.append(Message(model.notice_text, "note", "top left"))
    elif model.hint > now:
        messages.append(Message("H: help", "note", "top left"))
    messages += _parameters(model, now)
    if model.pick is not None:
        below = model.pick.pixel[1] < model.area[1] // 2  # beside the point, not over it
        corner = "bottom right" if below else "top right"
        messages.append(Message(model.pick.text(), "note", corner, swatch=model.pick.swatch))
    if model.full_screen:
        messages.append(Message(status(model), "note", "bottom right"))
    return messages


def _parameters(model: Model, now: float) -> list[Message]:
    """The list of parameters, which fades some seconds after the last change."""
    if model.state.selected is None:
        return []
    late = now - model.listed_at - LISTED
    turns = max(math.floor(late / FADE) + 1, 0)
    if turns >= len(FADES):
        return []
    return [Message(parameters(model), "note", "top left", opacity=FADES[turns])]


def parameters(model: Model) -> str:
    """The parameters with values and ranges; the selected one is marked. Of many, those beside it."""
    state = model.state
    names = list(state.specs)
    at = names.index(state.selected) if state.selected in state.specs else 0
    first = min(max(at - LINES // 2, 0), max(len(names) - LINES, 0))
    lines = []
    for name in names[first : first + LINES]:
        mark = ">" if name == state.selected else " "
        lines.append(f"{mark} {name}\t{shown(state.value(name))}   ({state.specs[name].range})")
    above, below = first, len(names) - first - len(lines)
    lines += [f"  {above} more above, {below} below"] if above + below else []
    return "\n".join(lines)


def status(model: Model) -> str:
    """The frame rate, or how far the picture is refined."""
    drawn = model.drawn
    width, height = drawn.size
    if model.preview:
        return "preview, compiling"
    if drawn.whole:
        return f"complete, {drawn.samples} sample{'' if drawn.samples == 1 else 's'}"
    if not drawn.moving:
        return f"{100 * drawn.share:.0f} % of {drawn.wanted} sample{'' if drawn.wanted == 1 else 's'}"
    return f"{model.rate:.0f} frames/s at {width}x{height}"


def _sides(model: Model) -> list[Message]:
    """What the two sides of a split picture are, and how far the reference is computed."""
    side, computed = model.compare.side, "" if model.known == 1.0 else f", {100 * model.known:.0f} % computed"
    messages = []
    if model.verdicts is not None:
        messages.append(Message(model.verdicts.words, "note", "bottom left"))
    if model.compare.over == "errors" and computed and side != "truth":
        messages.append(Message(f"reference{computed}", "note", "bottom left"))
    if side != "off":
        colour = "" if model.state.view == "final" else ", colour"
        right = model.stops[-1].name if side == "exact" else f"float64 reference{colour}{computed}"
        messages += [Message("this setting", "note", "left"), Message(right, "note", "right")]
    return messages
