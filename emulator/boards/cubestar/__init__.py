"""CubeStar's boards."""
