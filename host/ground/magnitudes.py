"""Magnitudes of stars that the page marks."""

from functools import lru_cache

from cubestack.emulator.scene.hipparcos import load_sky


@lru_cache(maxsize=4096)
def magnitude(hipparcos: int) -> float | None:
    """V of a star by its Hipparcos number; None if the catalogue does not have it."""
    sky = load_sky()
    at = int(sky.hip.searchsorted(hipparcos))
    known = at < len(sky) and sky.hip[at] == hipparcos
    return round(float(sky.v_mag[at]), 2) if known else None
