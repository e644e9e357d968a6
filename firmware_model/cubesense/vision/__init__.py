"""From edges and Sun pixels to directions, in 16-bit arithmetic."""
