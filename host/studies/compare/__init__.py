"""`cubestack compare`: the algorithms that the theses weigh, on the same skies."""
