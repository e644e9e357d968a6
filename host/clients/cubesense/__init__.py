"""CubeSense's client."""
