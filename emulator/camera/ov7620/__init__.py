"""The OV7620 image sensor of CubeSense, with its fisheye."""
