"""CubeStar's memory layouts, and the pins of their FPGAs in the order of the gateware's ports.

CubeStar thesis, table C.2, for the published board (option 1 of section 3.3). The boards on the
processor's external bus, options 2 and 3 of that section and two boards of option 2 (section 7.2),
were not built: their pins are assumed, and keep those of the published board where possible. BANK
is assumed too: the published board's memory holds two images, but no pin selects one.
"""

from enum import Enum
from typing import Never

from cubestack.firmware_model.interface.pins import Pin, sram_pins


class Layout(Enum):
    """Connections of camera, FPGA, SRAM and processor, named as on the command line.

    Other names raise ValueError.
    """

    COPIED = "1"  #: option 1, the published one: an SRAM for the FPGA, one for the processor

    SHARED = "2"  #: option 2: one SRAM, the FPGA as bus switch

    TWO_MEMORIES = "3"  #: option 3: two SRAMs at one FPGA, used alternately

    TWO_BOARDS = "two-boards"  #: section 7.2: two boards of option 2 on one bus, used alternately

    @classmethod
    def _missing_(cls, value: object) -> Never:
        names = ", ".join(layout.value for layout in cls)
        raise ValueError(f"{value!r} is none of the layouts {names}")


PIXCLK = Pin("PIXCLK", "input", "pixel clock")
PIXDATA = Pin("PIXDATA", "input", "pixel data from the image sensor", 8)
HSYNC = Pin("HSYNC", "input", "low between rows")
VSYNC = Pin("VSYNC", "input", "low between images")
ENABLE = Pin("ENABLE", "input", "leave standby")
RNW = Pin("RNW", "input", "read, not write")
BANK = Pin("BANK", "input", "image bank, latched by ENABLE; tied low in the published wiring")
INTO = Pin("INTO", "input", "memory to store in, latched by the falling RNW")
DCLK = Pin("DCLK", "input", "data clock from the microcontroller")
ACK = Pin("ACK", "output", "a whole image is stored")
DATA = Pin("DATA", "output", "stored bytes to the microcontroller", 8)
AD_HIGH = Pin("AD_HIGH", "input", "bus: address bits 23..16, then 7..0", 8)
AD_LOW = Pin("AD_LOW", "inout", "bus: address bits 15..8, then the data", 8)
ALE = Pin("ALE", "input", "bus: address latch enable, high active")
CS_N = Pin("CS_N", "input", "bus: chip select, low active", level=1)
RE_N = Pin("RE_N", "input", "bus: read strobe, low active", level=1)
WE_N = Pin("WE_N", "input", "bus: write strobe, low active", level=1)
CONTENTION = Pin("CONTENTION", "output", "model only: both boards drive the bus")

_CAMERA = (PIXCLK, PIXDATA, HSYNC, VSYNC)
_BUS = (AD_HIGH, AD_LOW, ALE, CS_N, RE_N, WE_N)
_SRAM = sram_pins(20)

#: Header positions of the published board's pins.
HEADER = {
    PIXDATA: "1-8",
    ACK: "9",
    ENABLE: "12",
    HSYNC: "14",
    BANK: "15",
    VSYNC: "16",
    PIXCLK: "18",
    RNW: "19",
    DATA: "23-30",
    DCLK: "32",
}

PUBLISHED = (
    *(
        pin.copy(meaning=f"{pin.meaning} (header {HEADER[pin]})")
        for pin in (*_CAMERA, ENABLE, RNW, BANK, DCLK, ACK, DATA)
    ),
    *_SRAM,
)

SHARED = (
    *_CAMERA,
    ENABLE,
    RNW.copy(meaning="the processor has the memory; else an image is stored"),
    BANK.copy(meaning="image bank to store in, latched by ENABLE"),
    ACK,
    *_BUS,
    *_SRAM,
)

DOUBLE = (
    *_CAMERA,
    ENABLE,
    RNW.copy(meaning="low: an image is stored"),
    INTO,
    ACK,
    *_BUS,
    *(
        pin.copy(pin.replace("SRAM", f"SRAM{n}"), meaning=f"{pin.meaning}, memory {n - 1}")
        for n in (1, 2)
        for pin in sram_pins(19)
    ),
)

#: Prefixes of the pins that each of two boards has separately.
BOARD_PREFIXES = ("BOARD1_", "BOARD2_")

OWN_PINS = (ENABLE, RNW, BANK, ACK, CS_N, *_SRAM)

TWO_BOARDS = (
    *(pin for pin in SHARED if pin not in OWN_PINS),
    *(
        pin.copy(f"{prefix}{pin}", meaning=f"board {n}: {pin.meaning}")
        for n, prefix in enumerate(BOARD_PREFIXES, 1)
        for name in OWN_PINS
        for pin in SHARED
        if pin == name
    ),
    CONTENTION,
)
