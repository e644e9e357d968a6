"""The atmosphere above a camera on the ground: its effect on the light of each star.

- Air mass: Kasten and Young 1989 (Applied Optics 28, 4735).
- Refraction: Saemundsson 1986 (Sky and Telescope 72, 70), reduced with the observer's height.
- Image motion: for one axis 0.18 lambda^2 r0^(-5/3) D^(-1/3) (Sarazin and Roddier 1990, A&A 227,
  294), with r0 = 0.98 lambda / seeing. During an exposure the wind carries the air across, which
  counts as an aperture of that length: so the variance falls with the exposure's cube root (Martin
  1987, PASP 99, 1360). Apertures below r0 have no other blur.
- Scintillation: Young 1967 (AJ 72, 747): 0.09 D^(-2/3) X^1.75 exp(-h / 8000 m) (2 t)^(-1/2), D in
  cm. That holds for apertures that average the moving shadows. Their size is about the Fresnel
  length sqrt(lambda z); integrated over the weak-turbulence spectrum, a point receives what an
  aperture of 0.84 of it does, 6 cm for z = 10 km. A smaller aperture counts as that one.

Each star is drawn independently of its neighbours. Not modelled: turbulence that changes with time,
the colour of the stars, the glow's rise towards the horizon, and the precession of 0.4 deg between
the stars' axes, which are used here, and the sidereal time's equinox.
"""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.values import REQUIRED, DeclaredValues, flag, number

SIDEREAL_DEG_S = 360 / 86164.0905
"""Rotation rate of the Earth relative to the stars."""

WAVELENGTH_M = 500e-9  # of the given seeing
SCALE_HEIGHT_M = 8000.0
WIND_M_S = 10.0  # of the layers that cause image motion (assumed)
POINT_CM = 6.0  # 0.84 of the Fresnel length for turbulence 10 km up (assumed)
ARCSEC = np.pi / 648_000

Vectors = NDArray[np.float64]


@dataclass(frozen=True)
class Atmosphere(DeclaredValues):
    """An observer on the Earth and the air above; SceneError for a value out of its range."""

    error = SceneError

    latitude_deg: float = number(REQUIRED, "of the observer, north positive", -90, 90)
    sidereal_deg: float = number(
        REQUIRED,
        "right ascension of the zenith at time 0",
        0,
        360,
        instead=("utc", "longitude_deg"),
    )
    height_m: float = number(0.0, "above the sea", -500, 9000)
    seeing_arcsec: float = number(
        2.0, "width at half maximum in a large telescope, at the zenith and 500 nm", 0, 20
    )
    scintillation: bool = flag(True, "stars twinkle")
    extinction_mag: float = number(0.25, "loss of light per air mass", 0, 5)
    sky_mag: float | None = number(
        None, "brightness of the sky, V of a square arcsecond; if omitted, dark", 10, 30
    )

    def zenith(self, time_s: float) -> Vectors:
        latitude = np.radians(self.latitude_deg)
        sidereal = np.radians(self.sidereal_deg + SIDEREAL_DEG_S * time_s)
        across = np.cos(latitude)
        return np.array(
            [across * np.cos(sidereal), across * np.sin(sidereal), np.sin(latitude)], np.float64
        )

    def apparent(
        self,
        vectors: Vectors,
        time_s: float,
        exposure_s: float,
        aperture_mm: float,
        generator: np.random.Generator,
    ) -> tuple[Vectors, NDArray[np.float64]]:
        """Apparent directions of stars in one exposure, and the share of their light that arrives.

        Args:
            vectors: unit vectors (n, 3) to the stars.
            time_s: virtual time of the middle of the exposure.
            exposure_s: its length.
            aperture_mm: diameter of the lens' entrance pupil.
            generator: of this exposure; the same state gives the same air.

        Returns:
            Unit vectors (n, 3), and shares (n,): 0 below the horizon, around 1 without extinction.
        """
        zenith = self.zenith(time_s)
        sine = np.clip(vectors @ zenith, -1, 1)
        height_deg = np.degrees(np.arcsin(sine))
        air = air_mass(height_deg)
        up, sideways, scatter = generator.standard_normal((3, len(vectors)))
        motion = np.sqrt(air) * self._motion_rad(exposure_s, aperture_mm)
        # Tangent to the sphere towards the zenith; at the zenith itself there is none.
        rise = zenith - sine[:, None] * vectors
        rise /= np.maximum(np.linalg.norm(rise, axis=1), 1e-9)[:, None]
        lifted = refraction_rad(height_deg) * np.exp(-self.height_m / SCALE_HEIGHT_M)
        moved = vectors + (lifted + motion * up)[:, None] * rise
        moved += (motion * sideways)[:, None] * np.cross(vectors, rise)
        moved /= np.linalg.norm(moved, axis=1)[:, None]
        light = 10 ** (-0.4 * self.extinction_mag * air)
        if self.scintillation:
            # A log-normal distribution with mean 1.
            variance = np.log1p((self._scintillation(exposure_s, aperture_mm) * air**1.75) ** 2)
            light *= np.exp(np.sqrt(variance) * scatter - variance / 2)
        return moved, np.where(height_deg > 0, light, 0.0)

    def _motion_rad(self, exposure_s: float, aperture_mm: float) -> float:
        """Standard deviation of a star's place at the zenith, along one axis."""
        if not self.seeing_arcsec:
            return 0.0
        r0 = 0.98 * WAVELENGTH_M / (self.seeing_arcsec * ARCSEC)
        length = max(aperture_mm / 1000, WIND_M_S * exposure_s)
        return float(np.sqrt(0.18 * WAVELENGTH_M**2 * r0 ** (-5 / 3) * length ** (-1 / 3)))

    def _scintillation(self, exposure_s: float, aperture_mm: float) -> float:
        """Relative standard deviation of a star's light at the zenith."""
        diameter_cm = max(aperture_mm / 10, POINT_CM)
        height = np.exp(-self.height_m / SCALE_HEIGHT_M)
        return float(0.09 * diameter_cm ** (-2 / 3) * height / np.sqrt(2 * exposure_s))


def air_mass(height_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Air mass towards stars at these heights, relative to that at the zenith; same shape.

    Below the horizon it is 38, as at the horizon.
    """
    above = np.maximum(height_deg, 0)
    return np.asarray(1 / (np.sin(np.radians(above)) + 0.50572 * (above + 6.07995) ** -1.6364))


def refraction_rad(height_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far refraction lifts stars at these true heights, at sea level; same shape."""
    above = np.maximum(height_deg, 0)
    lifted = 1.02 / np.tan(np.radians(above + 10.3 / (above + 5.11)))
    return np.asarray(np.maximum(lifted, 0) * 60 * ARCSEC)


def sidereal_deg(utc: datetime, longitude_deg: float) -> float:
    """Local mean sidereal time in degrees, 0 to 360, at a longitude, east positive.

    A time without time zone is UTC. Source: Astronomical Almanac, Greenwich mean sidereal time, its
    linear part.
    """
    aware = utc if utc.tzinfo else utc.replace(tzinfo=UTC)
    days = (aware - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 86400
    return (280.46061837 + 360.98564736629 * days + longitude_deg) % 360.0


def earth_rate_deg_s(quaternion: ArrayLike) -> Vectors:
    """Body rate (3,) of a camera fixed to the Earth; its attitude (4,) at any time."""
    return SIDEREAL_DEG_S * matrix_from_quaternion(quaternion)[:, 2]
