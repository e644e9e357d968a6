"""Captures of a logic analyser at a board's pins, compared with the emulated FPGA."""
