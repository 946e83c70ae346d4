"""Cells that are kept on disk, because their build takes long."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch import cache
from raymarch.errors import warn
from raymarch.expr.glsl import print_functions
from raymarch.files import sources
from raymarch.plan.cells import Builder, Cells
from raymarch.sdf.rows import Rows

KEPT_FROM, KEPT_SECONDS, KEPT_BYTES = 1000, 0.5, 2 << 30
"""Number of objects, and seconds of their build, from which cells are kept on disk; bytes of all cells there."""


def build(rows: Rows, exact: float) -> Cells:
    """The cells of some rows, from the cache on disk if their build took long before.

    exact : distance to surfaces up to which the field must be exact.
    """
    builder = Builder(rows, exact)
    folder = cache.folder() if len(rows) >= KEPT_FROM and not rows.live else None
    if folder is None:
        return builder.run()
    file = folder / "cells" / f"{_key(builder)}.npz"
    stored = cache.load(file)
    made = None if stored is None else _restored(stored)
    if made is not None:
        with suppress(OSError):
            os.utime(file)  # it was used: see `cache.save`
        return made
    begin = time.perf_counter()
    made = builder.run()
    if time.perf_counter() - begin >= KEPT_SECONDS:
        fault = cache.save(file, {f.name: getattr(made, f.name) for f in fields(Cells)}, limit=KEPT_BYTES)
        if fault:
            warn(f"the cells of {len(rows):,} objects are built again in each run: {fault}")
    return made


def _restored(stored: Mapping[str, NDArray[Any]]) -> Cells | None:
    """Cells from the arrays of a file; None if some are missing."""
    if not {f.name for f in fields(Cells)} <= stored.keys():
        return None
    plain = {name: a if a.ndim else a.item() for name, a in stored.items()}
    low, high = plain["unbounded"].tolist()
    return Cells(**plain | {"unbounded": (low, high)})


def _key(builder: Builder) -> str:
    """The content from which the cells are built, and the code that builds them."""
    digest = hashlib.sha256()
    for _, code in sources("plan/cells.py", "plan/lists.py"):
        digest.update(code)
    digest.update(repr((builder.rows.k, builder.rows.family, builder.need, np.__version__)).encode())
    for form in builder.forms:
        digest.update("".join(line.text for line in print_functions([form.columns.field]).lines()).encode())
        facts = (form.lower, form.upper, form.radius, form.spread, form.lipschitz, form.order)
        for array in (*form.columns.values, *facts):
            digest.update(repr((array.shape, form.exact)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:24]
