"""What disturbs a picture, as far as the picture itself shows it.

A disturbance is the cause and the failure to identify stars its effect, so it is reported first: a
picture at the end of its scale, a bright or uneven sky, streaks, spikes. Only an undisturbed
picture is said to have too few stars. A sensor's limits are well above its undisturbed sky.
"""

from dataclasses import dataclass
from enum import Enum


class Disturbance(Enum):
    """Disturbances, named as the sensors' reasons."""

    SATURATED = "parts of the field are too bright for stars"
    STRAY_LIGHT = "the sky is bright, or uneven"
    SMEAR = "motion drew the stars out"
    RADIATION = "too many pixels are hit by particles, or hot"


@dataclass(frozen=True)
class SkyStatistics:
    """What the search for stars measured of the sky."""

    background: float  #: level of the sky in DN
    background_range: float  #: difference between its bright and its dark parts in DN
    noise: float  #: median standard deviation of a pixel in DN
    saturated: float  #: share of the field that is too bright for stars, 0 to 1
    spikes: int  #: bright pixels and spots that no star leaves: hot pixels, particles


@dataclass(frozen=True)
class DisturbanceLimits:
    """Largest values of an undisturbed picture; ``spikes_per_dn``: more spikes per DN of noise."""

    saturated: float
    background: float
    background_range: float
    spikes: int
    spikes_per_dn: float = 0.0

    def exceeded(
        self, sky: SkyStatistics, *, large: bool = False, smear: bool = False, tracks: bool = False
    ) -> Disturbance | None:
        """The gravest disturbance, None if there is none. ``large``: an area that no star fills;
        ``smear``: streaks in one direction; ``tracks``: in many."""
        spikes = self.spikes + self.spikes_per_dn * sky.noise
        stray_light = (
            sky.background > self.background or sky.background_range > self.background_range
        )
        found = {
            Disturbance.SATURATED: large or sky.saturated > self.saturated,
            Disturbance.STRAY_LIGHT: stray_light,
            Disturbance.SMEAR: smear,
            Disturbance.RADIATION: tracks or sky.spikes > spikes,
        }
        return next((disturbance for disturbance, present in found.items() if present), None)
