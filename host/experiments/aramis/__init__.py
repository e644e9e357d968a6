"""Experiments with the star tracker of AraMiS."""
