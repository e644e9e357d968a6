"""CubeStar's program in C for the EFM32GG280: sources, what is made for them, and the image."""
