"""Insight into firmware, with its symbols: profile, coverage, stack and fault reports."""
