"""host/cli."""
