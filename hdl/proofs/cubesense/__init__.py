"""Formal properties of CubeSense's tops."""
