"""emulator/camera."""
