"""SunSlit: a one-axis Sun sensor of a slit above a linear photodiode array."""
