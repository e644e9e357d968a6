"""`cubestack campaign`: thousands of skies by a plan."""
