"""CubeSense's FPGAs on an I2C bus in place of the parallel pins: gateware that no board uses."""
