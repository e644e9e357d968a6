"""The protocol suite: what a device answers beside what its tables declare."""
