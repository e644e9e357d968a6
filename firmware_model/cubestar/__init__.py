"""CubeStar's firmware program for the EFM32GG280F1024."""
