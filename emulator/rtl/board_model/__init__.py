"""A development board in simulation, bit by bit on its serial line."""
