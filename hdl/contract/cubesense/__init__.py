"""The contract of CubeSense's pair of FPGAs."""
