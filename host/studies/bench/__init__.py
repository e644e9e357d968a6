"""`cubestack bench`: cost of the hot paths."""
