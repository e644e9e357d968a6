"""Mutants of the designs: one wrong gate each, which the testbenches have to notice."""
