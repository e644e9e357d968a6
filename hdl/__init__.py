"""Gateware of the sensors' FPGA boards, written in Amaranth HDL."""
