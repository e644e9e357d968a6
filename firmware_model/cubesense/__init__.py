"""CubeSense's firmware program for the PIC18F45K20."""
