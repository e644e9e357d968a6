"""A design on a development board: pin bridge behind a serial port, bitstream, placed netlist."""
