"""Formal properties of CubeStar's tops."""
