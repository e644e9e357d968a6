"""emulator/ports."""
