"""Calibrations by least squares: numbers only; no device, no emulator."""
