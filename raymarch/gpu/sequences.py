"""The position of each sample's ray in its pixel, and its time: low-discrepancy sequences."""

from __future__ import annotations

PLASTIC = 1.3247179572447460
"""The real root of x^3 = x + 1; its powers define the two-dimensional sequence of lowest known discrepancy."""


def r2(index: int) -> tuple[float, float]:
    """Sample `index` of the R2 sequence (Roberts 2018) in [-0.5, 0.5), shifted so that sample 0 is the centre of the
    pixel."""
    x, y = (0.5 + index / PLASTIC) % 1.0, (0.5 + index / PLASTIC**2) % 1.0
    return x - 0.5, y - 0.5


def moment(index: int) -> float:
    """The time of sample `index` in the opening of the shutter, in [-0.5, 0.5): van der Corput's sequence, shifted so
    that sample 0 is the middle."""
    return (_radical_inverse(index, 2) + 0.5) % 1.0 - 0.5


def halton(index: int) -> tuple[float, float]:
    """Sample `index` of the Halton sequence in bases 2 and 3, in [-0.5, 0.5): for short periods."""
    return _radical_inverse(index + 1, 2) - 0.5, _radical_inverse(index + 1, 3) - 0.5


def _radical_inverse(number: int, base: int) -> float:
    value, place = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        value += digit * place
        place /= base
    return value
