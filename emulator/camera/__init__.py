"""Cameras: lenses, light on the pixels, and the MLX75412 and OV7620 image sensors."""
