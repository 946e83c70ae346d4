"""The messages over the picture."""

from __future__ import annotations

from dataclasses import dataclass

from raymarch.scene.legal import violations
from raymarch.scene.parameter import Values
from raymarch.window import commands, inputs
from raymarch.window.model import Model
from raymarch.window.news import near

PATIENT = 0.6
"""Seconds after which a running trial is shown."""


@dataclass(frozen=True, slots=True)
class Message:
    """A block of text.

    text : the lines; a tab separates two columns.
    kind : "error", "note" or "busy".
    corner : "top left", "top right", "bottom left" or "middle" of the picture; at its top, "left" or "right" of the
        divider.
    """

    text: str
    kind: str = "note"
    corner: str = "top left"


def messages_of(model: Model, now: float) -> list[Message]:
    """The messages to show now. Removes expired notices."""
    if model.help:
        return [Message(inputs.help_text(), "note", "middle")]
    messages = _sides(model)
    if model.draft is not None:
        question = f"{model.draft.text()}\n\nF2 writes this into the file, Esc does not"
        messages.append(Message(question, "note", "middle"))
    if model.fault is not None and not model.closed:
        messages.append(Message(model.fault.text(), "error", "bottom left"))
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
    model.notices = [(until, text) for until, text in model.notices if until > now]
    messages += [Message(text, "note", "top left") for _, text in model.notices]
    if model.state.selected is not None:
        messages.append(Message(commands.parameters(model), "note", "top left"))
    if model.pick is not None:
        messages.append(Message(model.pick.text(), "note", "top right"))
    return messages


def _sides(model: Model) -> list[Message]:
    """What the two sides of a split picture are, and how far the reference is computed."""
    side, computed = model.compare.side, "" if model.known == 1.0 else f", {100 * model.known:.0f} % computed"
    messages = []
    if model.compare.errors and computed and side != "truth":
        messages.append(Message(f"reference{computed}", "note", "bottom left"))
    if side != "off":
        colour = "" if model.state.view == "final" else ", colour"
        right = model.stops[-1].name if side == "exact" else f"float64 reference{colour}{computed}"
        messages += [Message("this setting", "note", "left"), Message(right, "note", "right")]
    return messages
