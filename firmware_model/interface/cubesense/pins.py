"""Pins of CubeSense: its two FPGAs, its microcontroller, and the current monitors.

CubeSense thesis, table 3.4 for the FPGAs (64 pins), section 3.2 and table 3.3 for the
microcontroller (two data lines for each camera and one more control line, a switch for each memory,
eight data lines and six control lines for both FPGAs, analogue inputs for the 3.3 V supply and both
memories), table 6.3 for the FPGAs' control lines, section 9.2.2 for addresses on the data lines.
Names that table 6.3 does not print are assumed; so are the third line of each camera, which
switches its supply, the monitor of the 5 V supply, which the node protocol reports, and the
monitors' scale.

Tables of pins are in the order of the gateware's ports.
"""

from collections.abc import Iterable
from enum import StrEnum

from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.interface.pins import Direction, Pin, sram_pins

Y = Pin("Y", "input", "pixel data from the camera", 8)
HREF = Pin("HREF", "input", "high while a row's pixels are sent")
PCLK = Pin("PCLK", "input", "pixel clock")
RNW = Pin("RNW", "input", "read, not write; with SHIFT the direction across the link")
CLK = Pin("CLK", "input", "data clock")
EDGE = Pin("EDGE", "input", "edge data instead of the image")
SHIFT = Pin("SHIFT", "input", "across the link")
DATA = Pin("DATA", "tristate", "bytes to the microcontroller, on a bus for both FPGAs", 8)
LINK_D = Pin("LINK_D", "inout", "data between the FPGAs", 8)
LINK_C = Pin(
    "LINK_C",
    "inout",
    "bit 0: sun's enable or PCLK; bit 1: nadir's enable or HREF; pulled up",
    2,
    level=0b11,
    enables=2,
)

#: The microcontroller's bytes on DATA, with address control.
DATA_I = f"{DATA}_I"

CAMERA_PINS = (Y, HREF, PCLK)
SRAM_PINS = sram_pins(19, "SRAM address, row : column")

#: Table 3.4.
FPGA = (
    *CAMERA_PINS,
    Pin("EN", "input", "own enable, low active: SUNEN or NADEN", level=1),
    RNW,
    CLK,
    EDGE,
    SHIFT,
    Pin("ACK", "output", "a whole image is stored: SUNACK or NADACK"),
    DATA,
    LINK_D,
    LINK_C,
    *SRAM_PINS,
)

_ADDRESSED = "bytes to the microcontroller and addresses from it, on a bus for both FPGAs"

#: With address control from the microcontroller: DATA is bidirectional; no other pin is needed.
ADDRESSING = tuple(Pin(DATA, "inout", _ADDRESSED, 8) if pin == DATA else pin for pin in FPGA)

#: Prefixes of the pins that each half has separately.
PREFIXES = {"sun": "SUN_", "nadir": "NAD_"}

OWN_PINS = (*CAMERA_PINS, *SRAM_PINS)

#: Control lines of the microcontroller that lead to both FPGAs.
COMMON_PINS = (RNW, CLK, EDGE, SHIFT)

#: Low-active enable of each half's FPGA; ``Camera`` and ``Sram`` number the halves alike.
ENABLE = (
    Pin("SUNEN", "input", "sun's enable, low active", level=1),
    Pin("NADEN", "input", "nadir's enable, low active", level=1),
)

#: Signals that a whole image is stored, by memory.
ACKNOWLEDGE = {
    Sram.SRAM1: Pin("SUNACK", "output", "a whole image is in the sun's memory"),
    Sram.SRAM2: Pin("NADACK", "output", "a whole image is in the nadir's memory"),
}

#: The lines whose levels form a command, in the order of table 6.4.
CONTROLS = (SHIFT, EDGE, RNW, *ENABLE)

CONTENTION = Pin(
    "CONTENTION",
    "output",
    "model only: DATA, link data, link control lines 0 and 1 have two drivers",
    4,
)


def pair_pins(mcu_addressing: bool = False) -> tuple[Pin, ...]:
    """Pins of both FPGAs as one, without those of the link."""
    direction: Direction = "inout" if mcu_addressing else "tristate"
    return (
        *halves(OWN_PINS),
        *COMMON_PINS,
        *ENABLE,
        *ACKNOWLEDGE.values(),
        Pin(DATA, direction, "bytes to the microcontroller", 8, bare=True),
        CONTENTION,
    )


def halves(pins: Iterable[Pin]) -> tuple[Pin, ...]:
    """Pins that each half has separately, as pins of the pair: the sun's, then the nadir's."""
    return tuple(
        pin.copy(prefix + pin, meaning=f"{side}: {pin.meaning}")
        for side, prefix in PREFIXES.items()
        for pin in pins
    )


#: Control bus of each camera, open drain: level 1 releases the line.
CAMERA_SCL = {Camera.SUN: "SUN_SCL", Camera.NADIR: "NAD_SCL"}
CAMERA_SDA = {Camera.SUN: "SUN_SDA", Camera.NADIR: "NAD_SDA"}

#: Supply of each camera: 1 is on.
CAMERA_POWER = {Camera.SUN: "SUN_POWER", Camera.NADIR: "NAD_POWER"}

#: Supply of each memory: 1 is on.
SRAM_POWER = {Sram.SRAM1: "SRAM1_POWER", Sram.SRAM2: "SRAM2_POWER"}


class Monitor(StrEnum):
    """A current monitor on an input of the 10-bit converter."""

    SUPPLY_3V3 = "3V3"
    SRAM1 = "SRAM1"
    SRAM2 = "SRAM2"
    SUPPLY_5V = "5V"


#: Largest value of the converter.
ADC_FULL_SCALE = 1023

#: Current per count. Sense and load resistors are not published: a range of 200 mA is assumed.
MA_PER_COUNT = 200.0 / ADC_FULL_SCALE
