"""Studies of AraMiS."""
