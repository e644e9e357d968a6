"""The contract of CubeStar's published board."""
