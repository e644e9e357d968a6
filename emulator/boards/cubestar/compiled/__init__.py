"""Costs of compiled code on CubeStar's processor: builds, operations, phases of an image."""
