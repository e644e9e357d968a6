"""CubeSense's FPGA designs: one of the two FPGAs, and a model of both with their link."""
