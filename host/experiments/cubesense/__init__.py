"""Experiments with CubeSense."""
