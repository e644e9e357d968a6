"""Virtual time, microcontrollers that run in it, and power supplies."""
