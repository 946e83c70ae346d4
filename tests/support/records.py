"""What was measured of each node: docs/figures/nodes.json, which tests.lab.measure writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.support.node_samples import definitions

NODES = Path(__file__).parents[2] / "docs" / "figures" / "nodes.json"


def measured() -> dict[str, dict[str, Any]]:
    """The figures of each node, by its name."""
    return json.loads(NODES.read_text(encoding="utf-8")) if NODES.exists() else {}


def unmeasured() -> list[str]:
    """The nodes without figures, such as new ones."""
    known = measured()
    return [d.name for d in definitions() if d.name not in known]
