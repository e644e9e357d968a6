"""`cubestack hazards`: rates of right, refused and wrong results under hazards."""
