"""Instruction-set simulator: runs unmodified firmware images of a microcontroller."""
