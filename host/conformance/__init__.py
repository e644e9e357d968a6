"""The protocol suite: a device's answers against its tables."""
