"""Numbers with names in AraMiS' star tracker interface: states, outcomes, reasons, actions.

All numbers are assumed. Outcomes are those of the AraMiS thesis, section 5.7; the failure reasons
are what its use case for the attitude asks for (section 2.2).
"""

from enum import IntEnum


class SensorState(IntEnum):
    """What the star tracker is doing."""

    INACTIVE = 0
    ACTIVATING = 1
    READY = 2
    MEASURING = 3
    PROGRAMMING = 4
    """The catalogue's flash is being written."""


class MeasurementMode(IntEnum):
    """What is known beforehand."""

    LOST_IN_SPACE = 0
    AIDED = 1
    """A rough direction: only the triangles around it are searched."""


class MeasurementOutcome(IntEnum):
    """How the latest measurement ended."""

    NOT_MEASURED = 0
    CONCLUSIVE = 1
    AMBIGUOUS = 2
    NONE = 3


class Reason(IntEnum):
    """Why a measurement ended as it did; from 16 on there was no picture or no catalogue."""

    NOT_MEASURED = 0
    UNIQUE = 1
    """One triangle of the catalogue was left."""
    CONFIRMED = 2
    """Further stars confirm the attitude."""
    SEVERAL = 3
    """Several triangles were left after the last pivot."""
    TOO_FEW_STARS = 4
    TOO_MANY_PIXELS = 5
    """Too many pixels were lit to be stars."""
    DEGENERATE = 6
    """The stars stand on a line."""
    NO_TRIANGLE = 7
    """No triangle of the catalogue has that area and moment."""
    NO_SHARED_PAIR = 8
    """No candidate shared two stars with a pivot triangle's."""
    UNCONFIRMED = 9
    """No attitude was confirmed."""
    FAR_FROM_HINT = 10
    """The boresight is far from the rough direction."""
    SMEAR = 11
    """Motion drew the stars out."""
    STRAY_LIGHT = 12
    """The sky is bright, or not evenly so."""
    SATURATED = 13
    """Parts of the field are too bright for stars: the Moon, the Earth."""
    RADIATION = 14
    """Too many pixels are hit by particles or hot."""
    NO_TIME = 15
    """The time of a measurement was over before an attitude was confirmed."""
    NOT_ACTIVE = 16
    CAMERA_OFF = 17
    """Its supply is switched off (latch-up action)."""
    CAMERA_SILENT = 18
    """It did not acknowledge on its control bus."""
    CAMERA_TIMEOUT = 19
    """No whole frame came in time."""
    CAMERA_FRAME = 20
    """The frame was shorter, or its lines longer or shorter, than programmed."""
    NO_CATALOGUE = 21
    """The flash holds none."""
    CATALOGUE_DAMAGED = 22
    """More bits were wrong than can be corrected."""


class CatalogueState(IntEnum):
    """State of the star and triangle catalogue."""

    NOT_LOADED = 0
    """The star tracker is not active."""
    GOOD = 1
    MISSING = 2
    """The flash holds none."""
    DAMAGED = 3
    """More bits were wrong than can be corrected, or its checksum does not fit."""


class LatchUpStep(IntEnum):
    """A step of the latch-up action."""

    OFF = 0
    ON = 1


class SpikeMethod(IntEnum):
    """How spikes of noise are removed (AraMiS thesis, section 3.5)."""

    OFF = 0
    CENTRE = 1
    """Method 1: a window of 5 x 5 steps by one and judges the pixel in its middle."""
    WINDOW = 2
    """Method 2: it steps by five and judges the bright pixels in it."""


class OnOff(IntEnum):
    """A switch."""

    OFF = 0
    ON = 1


class ResetCause(IntEnum):
    """Why the program started."""

    POWER_ON = 1
    TELECOMMAND = 2
