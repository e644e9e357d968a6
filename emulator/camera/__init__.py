"""CubeStar's camera: lens, exposure, pixels, and the MLX75412 sensor."""
