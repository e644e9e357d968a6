"""Devices by name, and what opens one."""
