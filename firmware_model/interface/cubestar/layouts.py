"""Memory layouts of CubeStar: connections of camera, FPGA, SRAM and processor.

CubeStar thesis, options 1 to 3 of section 3.3, and section 7.2.
"""

from enum import Enum
from typing import Never


class Layout(Enum):
    """A layout; its value is its name on the command line. Other names raise ValueError."""

    COPIED = "1"  #: option 1, the published one: an SRAM for the FPGA, one for the processor

    SHARED = "2"  #: option 2: one SRAM, the FPGA as bus switch

    TWO_MEMORIES = "3"  #: option 3: two SRAMs at one FPGA, used alternately

    TWO_BOARDS = "two-boards"  #: section 7.2: two boards of option 2 on one bus, used alternately

    @classmethod
    def _missing_(cls, value: object) -> Never:
        names = ", ".join(layout.value for layout in cls)
        raise ValueError(f"{value!r} is none of the layouts {names}")
