"""emulator/rtl."""
