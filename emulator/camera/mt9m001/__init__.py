"""The MT9M001 image sensor of AraMiS."""
