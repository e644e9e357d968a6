"""Power cuts at every change of the flash: what a program remembers, and whether it starts."""
