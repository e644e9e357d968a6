"""CubeStar's client and operator procedures."""
