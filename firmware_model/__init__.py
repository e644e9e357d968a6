"""Microcontroller models: cost tables, hardware interface, algorithms and firmware programs.

Firmware is written the way the part's program would be. It sees bytes that came over its pins and
buses, never the scene, the camera or the truth.
"""
