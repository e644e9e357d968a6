"""Upsets of every bit of a device: what each does, and what the firmware makes of it."""
