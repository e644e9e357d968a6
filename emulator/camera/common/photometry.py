"""From a star's V magnitude to electrons, and from electrons to the sensor's counts.

CubeStar thesis, section 3.4.4 (equation 3.4.2) with the real lens' aperture, and appendix E
(responsivity). Equation 3.4.2 multiplies aperture, transmission, bandwidth and the flux of the
star; transmission, bandwidth and quantum efficiency are one factor here, an effective width.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "APERTURE_MM",
    "DN12_PER_DN8",
    "EFFECTIVE_WIDTH_A",
    "ELECTRONS_PER_DN12",
    "FULL_SCALE_DN12",
    "electrons_per_second",
]

APERTURE_MM = 5.0
"""Diameter of the entrance pupil: 6 mm focal length at f/1.2 (published)."""

PHOTONS_V0 = 1000.0
"""Flux of a star of V = 0 in photons / (s cm^2 Angstrom) (published, eq. 3.4.2)."""

EFFECTIVE_WIDTH_A = 4780.0
"""Bandwidth in Angstrom times transmission times quantum efficiency: fitted.

A star of V = 3.8 so gives 300 counts of 8 bits, summed over its spot, in the 385.6 ms of the
default frame rate, near the published detection limit. The thesis' own factors without a quantum
efficiency range from 0.6 x 3000 to 0.8 x 6000 Angstrom, so this is a bright lens.
"""

ELECTRONS_PER_DN12 = 2.28
"""Electrons per count of 12 bits (published)."""

FULL_SCALE_DN12 = 4095
"""The converter saturates here."""

DN12_PER_DN8 = 16
"""Only the upper 8 of 12 bits are wired (appendix C)."""


def electrons_per_second(
    v_mag: ArrayLike,
    aperture_mm: float = APERTURE_MM,
    effective_width_a: float = EFFECTIVE_WIDTH_A,
) -> NDArray[np.float64]:
    """Electrons a second that a star of magnitude ``v_mag`` gives on the axis, same shape.

    The lens' aperture and the effective width are CubeStar's unless given.
    """
    area_cm2 = np.pi * (aperture_mm / 20) ** 2
    flux = PHOTONS_V0 * 10 ** (-0.4 * np.asarray(v_mag, np.float64))
    return np.asarray(area_cm2 * effective_width_a * flux, np.float64)
