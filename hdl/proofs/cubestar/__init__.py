"""Formal properties of CubeStar's tops."""

from cubestack.hdl.proofs.cubestar import published, successors

__all__ = ["PROOFS"]

#: By name.
PROOFS = published.PROOFS | successors.PROOFS
