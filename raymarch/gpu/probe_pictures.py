"""The results of the probe as pictures: a colour for each node, and a legend with name and line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.gpu.frame import srgb
from raymarch.gpu.probe import Faults, Slopes
from raymarch.gpu.reports import LEEWAY, Report
from raymarch.gpu.scale import Scale, with_bar, with_legend

COLORS = ((255, 45, 45), (255, 0, 255), (255, 150, 0), (255, 255, 255), (255, 130, 170), (150, 90, 255))
"""Colours of the faulty nodes, by decreasing number of pixels; further nodes share the last one."""

DIM = 0.4
"""Brightness of the picture behind the faults."""

SCALE = Scale(
    "largest slope of a node / its Lipschitz bound; above 1 the colour of the node", 0.0, 1.0, colors="viridis"
)


def fault_picture(faults: Faults) -> Image.Image:
    """The picture in dim grey, with faulty pixels in the colour of the node of their first fault, and a legend."""
    grey = srgb(faults.color).mean(axis=-1, keepdims=True)
    shown = np.repeat(DIM * grey, 3, axis=-1).astype(np.uint8)
    entries = _paint(shown, faults.node, faults.node >= 0, faults.reports, grey)
    pixels = int(np.count_nonzero(faults.node >= 0))
    title = f"first faulty value: {pixels} of {faults.node.size} pixels"
    return with_legend(Image.fromarray(shown), title, entries)


def slope_picture(slopes: Slopes) -> Image.Image:
    """The largest ratio of slope to Lipschitz bound at each pixel, with a bar; ratios above 1 have the colour of their
    node, with a legend."""
    shown = np.asarray(np.rint(255 * SCALE.colored(slopes.ratio)), np.uint8)
    broken = slopes.ratio > 1.0 + LEEWAY
    grey = srgb(slopes.color).mean(axis=-1, keepdims=True)
    entries = _paint(shown, slopes.node, broken, slopes.reports, grey)
    pixels = int(np.count_nonzero(broken))
    title = f"slope above the Lipschitz bound: {pixels} of {broken.size} pixels"
    return with_legend(with_bar(Image.fromarray(shown), SCALE), title, entries)


def fault_numbers(faults: Faults) -> NDArray[np.float32]:
    """(H, W, 3): node counted from 1, 0 for none; kind of the fault; the value."""
    return np.stack([faults.node + 1, faults.kind, faults.value], axis=-1).astype(np.float32)


def slope_numbers(slopes: Slopes) -> NDArray[np.float32]:
    """(H, W, 3): slope / Lipschitz bound; node counted from 1, 0 for none; the slope of that node."""
    taken = np.array([1.0, *(report.taken for report in slopes.reports)])
    return np.stack([slopes.ratio, slopes.node + 1, slopes.ratio * taken[slopes.node + 1]], axis=-1).astype(np.float32)


def _paint(
    shown: NDArray[np.uint8],
    node: NDArray[np.int32],
    where: NDArray[np.bool_],
    reports: Sequence[Report],
    grey: NDArray[np.floating],
) -> list[tuple[tuple[int, int, int], str]]:
    """Colour the pixels of each node, shaded by the picture. Returns the entries of the legend."""
    numbers, counts = np.unique(node[where], return_counts=True)
    entries = []
    for rank, index in enumerate(numbers[np.argsort(-counts, kind="stable")]):
        color = COLORS[min(rank, len(COLORS) - 1)]
        own = where & (node == index)
        shown[own] = (np.array(color) * (0.6 + 0.4 * grey[own] / 255.0)).astype(np.uint8)
        if rank < len(COLORS):
            report = reports[index]
            line = f", {Path(report.where.file).name}:{report.where.line}" if report.where else ""
            more = " and others" if rank == len(COLORS) - 1 and len(numbers) > len(COLORS) else ""
            entries.append((color, f"{report.name}{line}{more}: {counts[numbers == index][0]}"))
    return entries
