"""Attitude from vectors, in single precision: what all star trackers share."""
