"""Virtual time, the processor that spends it, and the supplies."""
