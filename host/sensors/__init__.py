"""Declarations of the built-in sensors."""
