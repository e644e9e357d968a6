"""Blocks that several FPGA designs share: counters, frame writer and reader, bus port."""
