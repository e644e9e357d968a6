"""Cameras: lenses, light on the pixels, and the MLX75412, MT9M001 and OV7620 image sensors."""
