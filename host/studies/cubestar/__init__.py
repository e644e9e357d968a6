"""Studies of CubeStar."""
