"""Formal properties of CubeStar's tops."""

from cubestack.hdl.proofs.cubestar import published, successors

#: By name.
PROOFS = published.PROOFS | successors.PROOFS
