"""Scenes: stars, Earth, Sun, photographs, and the pose; independent of sensors."""
