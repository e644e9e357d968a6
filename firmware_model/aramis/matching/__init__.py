"""From stars to an attitude: planar triangles, pivots, verification."""
