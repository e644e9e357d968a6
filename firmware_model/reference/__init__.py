"""CubeStar's program in C for the EFM32GG280: sources, generated tables, and the image."""
