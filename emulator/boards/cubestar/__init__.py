"""CubeStar's board."""
