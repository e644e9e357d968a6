"""The host's side of the I2C bus: Linux's device files for programs that know nothing of it."""
