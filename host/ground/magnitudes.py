"""How bright stars are, for those who look at a picture of them."""

from functools import lru_cache

from cubestack.emulator.scene.hipparcos import load_sky


@lru_cache(maxsize=4096)
def magnitude(hipparcos: int) -> float | None:
    """V of a star by its Hipparcos number; None for one that the catalogue does not have."""
    sky = load_sky()
    at = int(sky.hip.searchsorted(hipparcos))
    known = at < len(sky) and sky.hip[at] == hipparcos
    return round(float(sky.v_mag[at]), 2) if known else None
