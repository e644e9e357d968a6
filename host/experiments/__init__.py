"""Measurements end to end: scene in, result beside truth out."""
