"""Formal properties of CubeStar's tops."""

from cubestack.hdl.proofs.cubestar import published, successors

PROOFS = published.PROOFS | successors.PROOFS
