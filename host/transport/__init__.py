"""Transports: serial port, TCP, RFC 2217, I2C."""
