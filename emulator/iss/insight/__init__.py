"""What a firmware does, in its own names: symbols, profile, coverage, stack and fault reports."""
