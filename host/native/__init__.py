"""Libraries of the shipped devices: listed, compiled ahead, and packed into wheels."""
