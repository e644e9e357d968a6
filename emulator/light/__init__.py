"""Inner loops of light: spots and noise on pixels, in C++ and, bit for bit the same, in NumPy."""
