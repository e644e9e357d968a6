"""What there is to look at: stars, Earth, Sun, pictures, and the pose; no sensor."""
