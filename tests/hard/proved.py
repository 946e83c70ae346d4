"""The share of the pixels of hard cases whose hits `rm.prove` proves: a judge that knows no other tracer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu import Frame
from tests.hard.world import Case, World

LEDGER = Path(__file__).parents[2] / "docs" / "figures" / "proved.json"
MOST = 6
"""Largest number of frames of a case that are proved: the first of different scenes."""
LARGEST = 160 * 120
"""Pixels of the largest frames that are proved. Estimates are left out: rays end before their surfaces, and proofs of
fractals take a minute each."""

EXPLAINED = {
    "81-roofs-thinner-than-a-pixel": "with epsilon 0.5, rays may pass a roof that is thinner than that",
    "82-rays-that-rise-out-of-steps": "rays that ran out of 64 steps show the surface that they are near",
}
"""Why some hits of a case are contradicted."""


class Proving(World):
    """Keeps the frames that a case draws, with their depths, to prove them after."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: dict[int, tuple[rm.Scene, Frame, dict[str, Any]]] = {}

    def draw(self, scene: rm.Scene, *args: Any, **how: Any) -> Frame:
        frame = super().draw(scene, *args, **how)
        small = frame.size[0] * frame.size[1] <= LARGEST and scene.node.exactness != "estimate"
        if "pose" not in how and small and frame.drawn("depth") is not None and len(self.kept) < MOST:
            frame.depth  # noqa: B018  it is read before another frame is drawn
            self.kept.setdefault(id(scene), (scene, frame, how))
        return frame

    def proved(self) -> dict[str, int] | None:
        """Counts of the frames that were kept since the last call; None if there are none."""
        found = {"frames": 0, "pixels": 0, "proved": 0, "contradicted": 0}
        for scene, frame, how in self.kept.values():
            found["frames"] += 1
            found["pixels"] += frame.size[0] * frame.size[1]
            try:
                proof = rm.prove(scene, frame, params=how.get("params"))
            except RaymarchError:
                continue  # its pixels stay open
            found["proved"] += proof.proved
            found["contradicted"] += proof.contradicted
        self.kept.clear()
        return found if found["frames"] else None


def ledger() -> dict[str, Any]:
    return dict(json.loads(LEDGER.read_text(encoding="utf-8"))) if LEDGER.exists() else {}


def write(found: Mapping[str, Any]) -> None:
    LEDGER.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def share(case: Case, found: Mapping[str, Any]) -> str:
    """The cell of a case: "99.93 %", "99.93 %, 2 contradicted", or a dash if it draws nothing that can be proved."""
    row = found.get(case.id)
    if row is None:
        return "–"
    percent = 100.0 * row["proved"] / row["pixels"]
    text = "100 %" if row["proved"] == row["pixels"] else f"{min(percent, 99.99):.2f} %"
    if not row["contradicted"]:
        return text
    return f"{text}, {row['contradicted']} contradicted: {EXPLAINED.get(case.id, 'unexplained')}"
