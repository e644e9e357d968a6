"""Versions of what is stored or spoken: files, folders, protocols and designs.

Each has a whole number, raised when an older program could misread it. Files that people write
themselves need none: those without one are version 1.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Versioned:
    """A kind of file or protocol, with the versions that this program reads.

    Attributes:
        what: its name in messages.
        current: the version that this program writes or speaks.
        oldest: the oldest one that it reads.
        unmarked: version of one that does not say its own; None if each must.
        remedy: what to do about one that is too old.
    """

    what: str
    current: int = 1
    oldest: int = 1
    unmarked: int | None = None
    remedy: str = ""

    def check(self, found: object = None) -> int:
        """``found``, or ``unmarked`` for None; raises ValueError for a version that is not read."""
        if found is None:
            if self.unmarked is None:
                raise ValueError(f"the {self.what} does not say its version; {self._remedy}")
            return self.unmarked
        if isinstance(found, bool) or not isinstance(found, int):
            shown = f"{found!r:.80}"
            raise ValueError(f"the version of the {self.what} must be a whole number, not {shown}")
        if self.oldest <= found <= self.current:
            return found
        known = " and ".join(map(str, range(self.oldest, self.current + 1)))
        advice = "update cubestack" if found > self.current else self._remedy
        raise ValueError(
            f"the {self.what} has version {found}, this program reads {known}; {advice}"
        )

    @property
    def _remedy(self) -> str:
        return self.remedy or f"make the {self.what} again"


RECORDING = Versioned("recording", 2)
SCENE = Versioned("scene file", unmarked=1)
FAULT_PLAN = Versioned("plan of faults", unmarked=1)
CAMPAIGN_PLAN = Versioned("plan of a campaign", unmarked=1)
CAMPAIGN = Versioned("campaign's folder", unmarked=1, remedy="run the campaign again")
POWERFAIL_SCENARIO = Versioned("scenario of power cuts", unmarked=1)
POWERFAIL_ROWS = Versioned("rows of power cuts", remedy="run powerfail again")
CONTROL = Versioned("control protocol", unmarked=1, remedy="update the emulation's cubestack")
I2C_SOCKET = Versioned("I2C protocol", remedy="update the client")
DEVELOPMENT_BOARD = Versioned("protocol of the board", remedy="write a new bitstream")
GATEWARE = Versioned("board of a design's pins", unmarked=1, remedy="adapt its pins")
SENSOR = Versioned("interface cubestack.sensor", remedy="adapt the sensor")

KINDS = (
    *(RECORDING, SCENE, FAULT_PLAN, CAMPAIGN_PLAN, CAMPAIGN, POWERFAIL_SCENARIO, POWERFAIL_ROWS),
    *(CONTROL, I2C_SOCKET, DEVELOPMENT_BOARD, GATEWARE, SENSOR),
)


def interface_of(title: str, version: int) -> Versioned:
    """The interface of a device, whose firmware reports its version."""
    return Versioned(f"interface of {title}", version, version, remedy="update the firmware")
