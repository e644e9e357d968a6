"""The star and triangle database in flash, and its error-correcting code."""
