"""Faults on purpose: declared in one table, planned in TOML, injected at virtual times."""
