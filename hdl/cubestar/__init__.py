"""CubeStar's FPGA designs: the published top and its successors."""
