"""CubeSense's FPGA designs: one of the two FPGAs, and both with their link."""
