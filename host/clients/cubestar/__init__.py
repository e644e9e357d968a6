"""CubeStar's client, and what its operator does on the ground."""
