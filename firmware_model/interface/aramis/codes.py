"""Named numbers of AraMiS' star tracker interface: states, outcomes, reasons, actions.

All numbers are assumed. Outcomes are those of the AraMiS thesis, section 5.7; the failure reasons
are those that its use case for the attitude requests (section 2.2).
"""

from enum import IntEnum


class SensorState(IntEnum):
    """Activity of the star tracker."""

    INACTIVE = 0
    ACTIVATING = 1
    READY = 2
    MEASURING = 3
    PROGRAMMING = 4  #: the catalogue's flash is being written


class MeasurementMode(IntEnum):
    """Prior knowledge of the attitude."""

    LOST_IN_SPACE = 0
    AIDED = 1  #: a rough direction: only the triangles around it are searched


class MeasurementOutcome(IntEnum):
    """Outcome of the latest measurement."""

    NOT_MEASURED = 0
    CONCLUSIVE = 1
    AMBIGUOUS = 2
    NONE = 3


class Reason(IntEnum):
    """Why a measurement ended as it did; 16 to 22: there was no image or no catalogue."""

    NOT_MEASURED = 0
    UNIQUE = 1  #: one triangle of the catalogue remained
    CONFIRMED = 2  #: further stars confirm the attitude
    SEVERAL = 3  #: several triangles remained after the last pivot
    TOO_FEW_STARS = 4
    TOO_MANY_PIXELS = 5  #: more bright pixels than stars have
    DEGENERATE = 6  #: the stars lie on a line
    NO_TRIANGLE = 7  #: no triangle of the catalogue has that area and moment
    NO_SHARED_PAIR = 8  #: no candidate shared two stars with that of a pivot triangle
    UNCONFIRMED = 9  #: no attitude was confirmed
    FAR_FROM_HINT = 10  #: the boresight is far from the rough direction
    SMEAR = 11  #: motion blurred the stars
    STRAY_LIGHT = 12  #: the sky is bright or uneven
    SATURATED = 13  #: parts of the field are too bright for stars: the Moon, the Earth
    RADIATION = 14  #: too many pixels are hot or hit by particles
    NO_TIME = 15  #: the measurement timed out before an attitude was confirmed
    NOT_ACTIVE = 16
    CAMERA_OFF = 17  #: its supply is switched off (latch-up action)
    CAMERA_SILENT = 18  #: it did not acknowledge on its control bus
    CAMERA_TIMEOUT = 19  #: no whole frame came in time
    CAMERA_FRAME = 20  #: the frame was shorter, or its lines longer or shorter, than programmed
    NO_CATALOGUE = 21  #: the flash holds none
    CATALOGUE_DAMAGED = 22  #: more bits were wrong than can be corrected
    LENS = 23  #: the stars do not fit the lens as described


class CatalogueState(IntEnum):
    """State of the star and triangle catalogue."""

    NOT_LOADED = 0  #: the star tracker is not active
    GOOD = 1
    MISSING = 2  #: the flash holds none
    DAMAGED = 3  #: uncorrectable bits, or a wrong checksum


class LatchUpStep(IntEnum):
    """A step of the latch-up action."""

    OFF = 0
    ON = 1


class SpikeMethod(IntEnum):
    """Removal of noise spikes (AraMiS thesis, section 3.5)."""

    OFF = 0
    CENTRE = 1  #: method 1: a window of 5 x 5 steps by one and judges the pixel in its middle
    WINDOW = 2  #: method 2: it steps by five and judges the bright pixels in it


class OnOff(IntEnum):
    """A switch."""

    OFF = 0
    ON = 1


class ResetCause(IntEnum):
    """Why the program started."""

    POWER_ON = 1
    TELECOMMAND = 2
