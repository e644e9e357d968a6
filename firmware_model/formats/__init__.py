"""File and socket formats that emulator and host share."""
