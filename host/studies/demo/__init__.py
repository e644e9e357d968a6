"""`cubestack demo`: the devices end to end, with pictures."""
