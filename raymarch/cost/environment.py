"""The environment of a measurement: a time is meaningless without it."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from typing import Any

import numpy as np

import raymarch


def environment(renderer: Any) -> dict[str, Any]:
    """Driver, clock, machine, versions and date, as plain data.

    renderer : has `context` (with `driver` and `backend`) and `clock` (with `kind` and `verdict`).
    """
    driver = renderer.context.driver
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "driver": {"renderer": driver.renderer, "vendor": driver.vendor, "version": driver.version},
        "draws_on": "CPU" if driver.is_software else "GPU",
        "backend": renderer.context.backend,
        "clock": {"kind": renderer.clock.kind, "verdict": renderer.clock.verdict},
        "machine": {"processor": platform.machine(), "cores": os.cpu_count(), "system": platform.system()},
        "versions": {
            "raymarch": raymarch.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
    }
