"""The satellite's serial line and I2C bus, in virtual time."""
