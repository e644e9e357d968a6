"""Proofs by induction of the properties that the designs' documents state."""
