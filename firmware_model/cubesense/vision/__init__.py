"""Directions from edges and Sun pixels, in 16-bit arithmetic."""
