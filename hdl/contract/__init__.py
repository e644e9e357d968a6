"""A device's contract at the pins of its FPGA, which any design can be checked against."""
