"""Emulated boards: virtual time, scenes, cameras, FPGA and memory, supplies, buses, ports."""
