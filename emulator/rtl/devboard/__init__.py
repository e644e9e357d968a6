"""The FPGA on a development board, in place of the compiled model."""
