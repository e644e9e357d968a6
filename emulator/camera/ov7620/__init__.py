"""CubeSense's image sensor OV7620 with its fisheye lens."""
