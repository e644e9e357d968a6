"""File and socket formats that emulator and host both speak."""
