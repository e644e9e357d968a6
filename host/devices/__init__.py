"""Device declarations and their registry."""
