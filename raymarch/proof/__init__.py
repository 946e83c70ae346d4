"""Proofs about pictures: intervals along rays show where no surface lies, and where the field changes its sign."""

from raymarch.proof.proof import Proof, prove

__all__ = ["Proof", "prove"]
