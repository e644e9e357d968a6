"""CubeSense's links to the outside, one for each protocol."""
