"""`cubestack calibrate`: lens parameters from pictures."""
