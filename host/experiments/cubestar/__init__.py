"""Experiments with CubeStar."""
