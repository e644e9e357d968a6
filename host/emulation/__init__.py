"""A powered-up device: its ports, time, controls and history."""
