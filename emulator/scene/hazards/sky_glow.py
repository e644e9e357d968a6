"""The glow of the dark sky: zodiacal light and Milky Way.

Zodiacal light: Leinert et al. 1998 (A&AS 127, 1), table 17, 500 nm, divided by 1.28 to get S10,
stars of V = 10 per square degree; the logarithm is interpolated linearly. Closer to the Sun than
the table, it has the table's greatest value. Milky Way: 30 S10 at the galactic poles, 160 on the
equator away from the centre and 640 towards it (Schlyter, Radiometry and photometry in astronomy,
after Allen). Assumed between those: a slab of stars and dust, brighter towards the centre within 15
deg of the equator. Clouds, rifts and catalogue stars are not included.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.hazards import ephemeris
from cubestack.emulator.scene.hazards.contract import Brightness, CameraState, SkyHazard, Vectors
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number

S10 = 1e-4 * (180 / math.pi) ** 2
"""In V = 0 stars per steradian."""

W_PER_S10 = 1.28
"""One S10 of the Sun's colour at 500 nm in the unit of table 17, 1e-8 W / (m^2 sr um)."""

LONGITUDES_DEG = (0, 5, 10, 15, 20, 25, 30, 35, 40, 45, 60, 75, 90, 105, 120, 135, 150, 165, 180)
LATITUDES_DEG = (0, 5, 10, 15, 20, 25, 30, 45, 60, 75, 90)
#: A row for each ecliptic longitude from the Sun's, a column for each latitude.
ZODIACAL = (
    (11500, 11500, 11500, 3140, 1610, 985, 640, 275, 150, 100, 77),
    (11500, 11500, 11500, 2940, 1540, 945, 625, 271, 150, 100, 77),
    (11500, 11500, 4740, 2470, 1370, 865, 590, 264, 148, 100, 77),
    (11500, 6780, 3440, 1860, 1110, 755, 525, 251, 146, 100, 77),
    (6400, 4480, 2410, 1410, 910, 635, 454, 237, 141, 99, 77),
    (3840, 2830, 1730, 1100, 749, 545, 410, 223, 136, 97, 77),
    (2480, 1870, 1220, 845, 615, 467, 365, 207, 131, 95, 77),
    (1650, 1270, 910, 680, 510, 397, 320, 193, 125, 93, 77),
    (1180, 940, 700, 530, 416, 338, 282, 179, 120, 92, 77),
    (910, 730, 555, 442, 356, 292, 250, 166, 116, 90, 77),
    (505, 442, 352, 292, 243, 209, 183, 134, 104, 86, 77),
    (338, 317, 269, 227, 196, 172, 151, 116, 93, 82, 77),
    (259, 251, 225, 193, 166, 147, 132, 104, 86, 79, 77),
    (212, 210, 197, 170, 150, 133, 119, 96, 82, 77, 77),
    (188, 186, 177, 154, 138, 125, 113, 90, 77, 74, 77),
    (179, 178, 166, 147, 134, 122, 110, 90, 77, 73, 77),
    (179, 178, 165, 148, 137, 127, 116, 96, 79, 72, 77),
    (196, 192, 179, 165, 151, 141, 131, 104, 82, 72, 77),
    (230, 212, 195, 178, 163, 148, 134, 105, 83, 72, 77),
)

POLE_S10, EQUATOR_S10, CENTRE_S10 = 30.0, 400.0, 240.0
"""Milky Way: at the poles; the mean on the equator; how much more it is towards the centre."""

BULGE_DEG = 15.0
DAYS_PER_DEG = 365.2422 / 360
SLAB = -math.log(1 - POLE_S10 / EQUATOR_S10)
"""Optical depth of the slab, perpendicular to its plane."""

TO_GALACTIC = np.array(
    [
        [-0.0548755604, -0.8734370902, -0.4838350155],
        [+0.4941094279, -0.4448296300, +0.7469822445],
        [-0.8676661490, -0.1980763734, +0.4559837762],
    ]
)
"""Rotation (3, 3) from ICRS (The Hipparcos and Tycho Catalogues, volume 1, section 1.5.3)."""


@dataclass(frozen=True, kw_only=True)
class SkyGlow(SkyHazard):
    """Light of the sky itself, in ICRS axes."""

    julian_date: float = number(
        ephemeris.NEW_YEAR_2026,
        "Julian date, for the Sun's place",
        ephemeris.FIRST_DATE,
        ephemeris.LAST_DATE,
    )
    zodiacal: float = number(1.0, "zodiacal light relative to the published one", 0, 100)
    milky_way: float = number(1.0, "Milky Way relative to the published one", 0, 100)

    meaning = "zodiacal light and Milky Way"
    strength = Strength(
        "longitude from the Sun", "deg", (180.0, 90.0, 60.0, 45.0, 30.0, 20.0, 15.0)
    )

    @classmethod
    def sample(cls, strength: float, state: CameraState, generator: np.random.Generator) -> Self:
        """At a date in 2026 when the Sun's longitude is this far from the boresight's."""
        x, y, _ = state.boresight @ ephemeris.FROM_ECLIPTIC
        wanted = math.degrees(math.atan2(y, x)) + strength * generator.choice([-1, 1])
        date = ephemeris.NEW_YEAR_2026
        date += (wanted - ephemeris.sun_longitude_deg(date)) % 360 * DAYS_PER_DEG
        for _ in range(2):  # the Sun's speed varies by 3 % over the year
            missed = (wanted - ephemeris.sun_longitude_deg(date) + 180) % 360 - 180
            date += missed * DAYS_PER_DEG
        return cls(julian_date=float(date))

    def glow(self, state: CameraState, vectors: Vectors) -> Brightness:
        del state
        s10 = self.zodiacal * self._zodiacal(vectors) + self.milky_way * milky_way(vectors)
        return np.asarray(S10 * s10, np.float32)

    def _zodiacal(self, vectors: Vectors) -> NDArray[np.float64]:
        x, y, z = (vectors @ ephemeris.FROM_ECLIPTIC).T
        sun_deg = ephemeris.sun_longitude_deg(self.julian_date)
        from_sun = np.abs((np.degrees(np.arctan2(y, x)) - sun_deg + 180) % 360 - 180)
        return zodiacal(from_sun, np.degrees(np.arcsin(np.clip(np.abs(z), 0, 1))))


def zodiacal(longitude_deg: NDArray[np.float64], latitude_deg: NDArray[np.float64]) -> Vectors:
    """Zodiacal light (n,), S10, at longitudes from the Sun's, 0 to 180, and latitudes, 0 to 90."""
    table = np.log(np.array(ZODIACAL) / W_PER_S10)
    row, down = _between(longitude_deg, LONGITUDES_DEG)
    column, right = _between(latitude_deg, LATITUDES_DEG)
    above = table[row, column] * (1 - right) + table[row, column + 1] * right
    below = table[row + 1, column] * (1 - right) + table[row + 1, column + 1] * right
    return np.asarray(np.exp(above * (1 - down) + below * down))


def milky_way(vectors: Vectors) -> NDArray[np.float64]:
    """Light of the Milky Way (n,), S10, along ICRS ``vectors`` (n, 3)."""
    x, y, z = (vectors @ TO_GALACTIC.T).T
    slab = EQUATOR_S10 * -np.expm1(-SLAB / np.maximum(np.abs(z), 1e-6))
    latitude_deg = np.degrees(np.arcsin(np.clip(np.abs(z), 0, 1)))
    cos_longitude = x / np.maximum(np.hypot(x, y), 1e-12)
    bulge = CENTRE_S10 * cos_longitude * np.exp(-latitude_deg / BULGE_DEG)
    return np.asarray(np.maximum(slab + bulge, 0))


def _between(
    values: NDArray[np.float64], nodes: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Index of the node below each value, and its relative distance from there, 0 to 1."""
    places = np.interp(values, nodes, np.arange(len(nodes)))
    index = np.minimum(places.astype(np.int64), len(nodes) - 2)
    return index, places - index
