"""CubeStar's image sensor MLX75412."""
