"""Instruction-set simulator: runs an unmodified image of a microcontroller on the board."""
