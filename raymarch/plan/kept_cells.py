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
from raymarch.prices import STANDARD, Prices
from raymarch.sdf.rows import Rows

KEPT_BYTES = 2 << 30
"""Bytes of all cells on disk."""


def build(rows: Rows, exact: float, prices: Prices = STANDARD) -> Cells:
    """The cells of some rows, from the cache on disk if their build took long before.

    exact : distance to surfaces up to which the field must be exact. prices : of the device.
    """
    builder = Builder(rows, exact, prices)
    folder = cache.folder() if len(rows) >= prices.kept_objects and not rows.live else None
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
    if time.perf_counter() - begin >= prices.kept_seconds:
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
    prices = builder.prices
    digest.update(repr((prices.crowded, prices.halved, prices.fine_objects, prices.fine_cells)).encode())
    digest.update(repr((builder.rows.k, builder.rows.family, builder.need, np.__version__)).encode())
    for form in builder.forms:
        digest.update("".join(line.text for line in print_functions([form.columns.field]).lines()).encode())
        facts = (form.lower, form.upper, form.radius, form.spread, form.lipschitz, form.order)
        for array in (*form.columns.values, *facts):
            digest.update(repr((array.shape, form.exact)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:24]
