"""The MLX75412 image sensor of CubeStar."""
