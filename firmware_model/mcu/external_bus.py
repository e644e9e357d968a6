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
    """Phases of a transaction in cycles of the core clock, the same for reads and writes."""

    address_setup: int  #: the upper address is on the lines and ALE is high
    address_hold: int  #: the upper address is still there, and ALE is low
    setup: int  #: the lower address is on the lines, with the byte of a write; chip select is low
    strobe: int  #: the read or write strobe is low too; a read samples its byte at the end
    hold: int  #: as in set-up

    def __post_init__(self) -> None:
        """Raise ValueError for values outside of the registers' range; no phase may be 0."""
        for name, longest in LONGEST.items():
            cycles = getattr(self, name)
            if not 1 <= cycles <= longest:
                raise ValueError(f"{name} must be 1 to {longest} cycles, not {cycles}")

    @property
    def cycles(self) -> int:
        return sum(getattr(self, name) for name in LONGEST)


#: From the lower address to the end of the strobe: 62.5 ns at 48 MHz. The SRAM needs 12 ns, and the
#: path through the FPGA 25 ns each way (assumed). One strobe cycle less, 41.7 ns, is too short.
EBI = BusTiming(address_setup=1, address_hold=1, setup=1, strobe=2, hold=1)
