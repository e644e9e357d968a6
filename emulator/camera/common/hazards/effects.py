"""Combined effect of several hazards of sensor and lens; without any, images are unchanged.

The uneven response, whose cause is the pixels' gain, applies to stray light, starlight and all
charge that hazards add. The imager adds the shot noise of this charge.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.hazards.contract import Exposure, Field, Lens, SensorHazard
from cubestack.emulator.scene.file import SceneError

WIDEST_PX = 20.0  # largest standard deviation of a spot, assumed: few stars remain visible
SHORTEST, LONGEST = 0.85, 1.15
"""Range of the focal length relative to the nominal one; lenses in use differ less."""

Hazards = tuple[SensorHazard, ...]
Grey = NDArray[np.uint8]


def lens(own: Lens, hazards: Hazards, temperature_c: float) -> Lens:
    """The lens ``own`` as changed by the hazards; SceneError if they exceed the limits."""
    for hazard in hazards:
        own = hazard.lens(own, temperature_c)
    if own.spot_px > WIDEST_PX:
        raise SceneError(
            f"the hazards' spot at {temperature_c:g} C must be at most {WIDEST_PX:g} px, "
            f"not {own.spot_px:.3g}"
        )
    if not SHORTEST <= own.scale <= LONGEST:
        raise SceneError(
            f"the hazards' focal length at {temperature_c:g} C must be {SHORTEST:g} to "
            f"{LONGEST:g} of the nominal one, not {own.scale:.3g}"
        )
    return own


def hot_pixels(hazards: Hazards) -> int:
    return sum(hazard.hot_pixels() for hazard in hazards)


def dark_rise(hazards: Hazards) -> float:
    return math.prod(hazard.dark_rise() for hazard in hazards)


def variance(hazards: Hazards, exposure: Exposure) -> float:
    """Variance of the noise that they add in each pixel, electrons squared."""
    return sum(hazard.noise(exposure) ** 2 for hazard in hazards)


@lru_cache(maxsize=4)
def response(hazards: Hazards, shape: tuple[int, int]) -> Field | None:
    """Relative response (rows, columns) of the pixels; None for an even one."""
    fields = [field for hazard in hazards if (field := hazard.response(shape)) is not None]
    return math.prod(fields[1:], start=fields[0]) if fields else None


def charge(hazards: Hazards, exposure: Exposure, seed: Sequence[int]) -> Field | None:
    """Electrons (rows, columns) that they add to the frame with ``seed``, or None."""
    total: Field | None = None
    for number, hazard in enumerate(hazards):
        drawn = np.random.SFC64([*seed, 0x4A2, number, hazard.seed])
        added = hazard.charge(exposure, np.random.Generator(drawn))
        if added is not None:
            total = added if total is None else total + added
    return total


def disturb_light(
    light: Field, hazards: Hazards, exposure: Exposure, seed: Sequence[int], electrons: float = 1.0
) -> Field:
    """Signal (rows, columns) from ``light``, in whose unit there are ``electrons`` electrons."""
    added, uneven = charge(hazards, exposure, seed), response(hazards, exposure.shape)
    if added is not None:
        light = light + added / np.float32(electrons)
    return light if uneven is None else light * uneven


def disturb_photograph(
    pixels: Grey, hazards: Hazards, exposure: Exposure, seed: Sequence[int]
) -> Grey:
    """Grey values of a photograph with the hazards' effects on the pixels, not the lens."""
    added, uneven = charge(hazards, exposure, seed), response(hazards, exposure.shape)
    sigma = math.sqrt(variance(hazards, exposure))
    if added is None and uneven is None and not sigma:
        return pixels
    per_count = np.float32(exposure.electrons_per_count)
    signal: Field = pixels.astype(np.float32)
    if added is not None:
        signal += added / per_count
    if uneven is not None:
        signal *= uneven
    if sigma:
        generator = np.random.Generator(np.random.SFC64([*seed, 0x4A3]))
        signal += (
            np.float32(sigma) / per_count * generator.standard_normal(pixels.shape, np.float32)
        )
    nearest: Field = np.clip(signal + np.float32(0.5), 0, 255)
    return nearest.astype(np.uint8)
