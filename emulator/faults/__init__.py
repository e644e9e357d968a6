"""Fault injection: faults are declared in one table, planned in TOML, injected at virtual times."""
