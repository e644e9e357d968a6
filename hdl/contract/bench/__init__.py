"""What surrounds a design in a testbench: camera, SRAM, processor and their rates."""
