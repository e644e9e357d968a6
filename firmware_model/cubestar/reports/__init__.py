"""Telemetry of results: stars, attitude, and messages that are plain tables of values."""
