"""What makes pictures hard: lights and veils in front of the lens, each on a scale of strength."""
