"""Proofs by induction that designs keep what their documents promise."""
