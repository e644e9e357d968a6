"""CubeSense's external links, one per protocol."""
