"""The EFM32GG's External Bus Interface in its mode of 24 address and 8 data bits, D8A24ALE.

CubeStar thesis, section 5.2.1 and appendix C. The vendor's peripheral library for this part
(em_ebi.h) names the phases and their limits: address set-up and hold, strobe set-up and strobe
hold of at most 3 cycles of the core clock, a strobe of at most 63. The thesis prints no timing
registers, so their values are assumed.
"""

from dataclasses import dataclass

LONGEST = {"address_setup": 3, "address_hold": 3, "setup": 3, "strobe": 63, "hold": 3}


@dataclass(frozen=True)
class BusTiming:
    """Phases of a transaction in cycles of the core clock, the same for reads and writes.

    Attributes:
        address_setup: the upper address is on the lines and ALE high.
        address_hold: it still is, and ALE low.
        setup: the lower address is on the lines, with the byte of a write, and chip select low.
        strobe: the read or write strobe is low besides; a read takes its byte at the end.
        hold: as in set-up.
    """

    address_setup: int
    address_hold: int
    setup: int
    strobe: int
    hold: int

    def __post_init__(self) -> None:
        """Refuse what the registers can not hold: no phase may be missing here; ValueError."""
        for name, longest in LONGEST.items():
            cycles = getattr(self, name)
            if not 1 <= cycles <= longest:
                raise ValueError(f"{name} must be 1 to {longest} cycles, not {cycles}")

    @property
    def cycles(self) -> int:
        """Length of a transaction."""
        return sum(getattr(self, name) for name in LONGEST)


EBI = BusTiming(address_setup=1, address_hold=1, setup=1, strobe=2, hold=1)
"""From the lower address to the end of the strobe there are 62.5 ns at 48 MHz: 12 ns of the SRAM,
and 25 ns each for the way out and the way back through the FPGA (assumed). One strobe cycle less,
41.7 ns, would be too short."""
