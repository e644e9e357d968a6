"""Formal properties of CubeSense's tops."""

from cubestack.hdl.proofs.cubesense.pair import PROOFS

__all__ = ["PROOFS"]
