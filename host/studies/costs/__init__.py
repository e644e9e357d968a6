"""`cubestack costs`: cycles of a device's program as compiled code."""
