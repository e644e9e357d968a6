"""Memory layouts of CubeStar: how camera, FPGA, SRAM and processor are connected.

CubeStar thesis, options 1 to 3 of section 3.3, and section 7.2.
"""

from enum import Enum
from typing import Never


class Layout(Enum):
    """A layout; its value is its name on the command line. ValueError for another name."""

    COPIED = "1"
    """Option 1, the published one: an SRAM for the FPGA, one for the processor."""

    SHARED = "2"
    """Option 2: one SRAM, the FPGA as bus switch."""

    TWO_MEMORIES = "3"
    """Option 3: two SRAMs at one FPGA, in turn."""

    TWO_BOARDS = "two-boards"
    """Section 7.2: two boards of option 2 on one bus, in turn."""

    @classmethod
    def _missing_(cls, value: object) -> Never:
        names = ", ".join(layout.value for layout in cls)
        raise ValueError(f"{value!r} is none of the layouts {names}")
