"""Proofs about pictures: intervals along rays show where no surface lies, and where the field changes its sign."""

from raymarch.proof.proof import COLORS, Proof, prove

__all__ = ["COLORS", "Proof", "prove"]
