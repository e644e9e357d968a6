"""What the camera looks at: stars, attitudes, scenes."""
