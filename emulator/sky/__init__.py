"""emulator/sky."""
