"""The values of the window, written into the scene file."""

from __future__ import annotations

from dataclasses import replace

from raymarch.errors import SceneError
from raymarch.files import written
from raymarch.window.differences import differences
from raymarch.window.model import Model
from raymarch.window.source import drafted


def write_values(model: Model) -> None:
    """Show what would change in the scene file; the second time, save that."""
    if model.draft is None:
        wanted, refused = differences(model.state)
        draft = drafted(wanted)
        if not draft.files:
            reasons = [*refused, *draft.refused]
            model.notice("\n".join(f"not written: {why}" for why in reasons) or "all values are those of the file")
            return
        model.draft = replace(draft, refused=(*refused, *draft.refused))
        model.say("draft", text=model.draft.text())
        return
    draft, model.draft = model.draft, None
    for file, (before, after) in draft.files.items():
        if file.read_bytes() != before:
            model.notice(f"{file.name} has changed meanwhile; nothing was written")
            return
        try:
            with written(file) as partial:
                partial.write_bytes(after)
        except (SceneError, OSError) as fault:
            model.notice(str(fault))
            return
        model.say("wrote", file=str(file))
    model.notice(f"wrote {', '.join(file.name for file in draft.files)}")
