"""`cubestack upsets`: flipped bits of gateware and memories, and their effects."""
