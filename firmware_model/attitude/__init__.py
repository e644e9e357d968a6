"""Attitude from vectors, in single precision: what both star trackers share."""
