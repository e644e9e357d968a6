"""Studies of CubeSense."""
