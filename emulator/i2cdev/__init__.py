"""/dev/i2c-N for unmodified programs."""
