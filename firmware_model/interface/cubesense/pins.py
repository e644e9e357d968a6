"""Pins of CubeSense's microcontroller, and what its current monitors show.

CubeSense thesis, section 3.2 and table 3.3 (two data lines for each camera and one more control
line, a switch for each memory, eight data lines and six control lines for both FPGAs, analogue
inputs for the 3.3 V supply and both memories) and table 6.3. Names are assumed where table 6.3 has
none; so are the third line of each camera, which switches its supply, the monitor of the 5 V
supply, which the node protocol reports, and the monitors' scale.
"""

from enum import StrEnum

from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram

__all__ = [
    "ADC_FULL_SCALE",
    "CAMERA_POWER",
    "CAMERA_SCL",
    "CAMERA_SDA",
    "ENABLE",
    "MA_PER_COUNT",
    "SRAM_POWER",
    "Monitor",
]

#: Low-active enable of each half's FPGA; ``Camera`` and ``Sram`` number the halves alike.
ENABLE = ("SUNEN", "NADEN")

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


#: Largest value of a conversion.
ADC_FULL_SCALE = 1023

#: Current of one count. Sense and load resistors are not published: a range of 200 mA, assumed.
MA_PER_COUNT = 200.0 / ADC_FULL_SCALE
