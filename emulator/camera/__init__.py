"""Cameras: lenses, light on the pixels, and the image sensors MLX75412, MT9M001 and OV7620."""
