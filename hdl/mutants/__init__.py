"""Mutants of the designs: one wrong gate each, which the test benches have to notice."""
