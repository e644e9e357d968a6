"""CubeSense's board."""
