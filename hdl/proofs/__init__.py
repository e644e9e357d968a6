"""Proofs by induction that the shipped designs keep what their documents promise."""
