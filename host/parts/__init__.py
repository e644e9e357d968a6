"""The declarations of the shipped parts: microcontrollers without a sensor around them."""
