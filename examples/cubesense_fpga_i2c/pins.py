"""Pins of CubeSense's FPGAs on I2C: 53, 11 fewer than in table 3.4."""

from cubestack.firmware_model.interface.cubesense.pins import (
    CAMERA_PINS,
    LINK_D,
    OWN_PINS,
    SRAM_PINS,
    halves,
)
from cubestack.firmware_model.interface.pins import Pin

SCL = Pin("SCL", "input", "I2C clock, Schmitt trigger; pulled up on the board", level=1)
RESET_N = Pin("RESET_N", "input", "reset, low active, with the supply")

FPGA = (
    *CAMERA_PINS,
    SCL,
    Pin("SDA", "inout", "I2C data, open drain, Schmitt trigger; pulled up there too", level=1),
    RESET_N,
    LINK_D,
    Pin("LINK_C", "inout", "bit 0 PCLK, bit 1 HREF between the FPGAs; pulled up", 2, level=0b11),
    *SRAM_PINS,
)

#: Both FPGAs as one, without the link.
PAIR = (
    *halves(OWN_PINS),
    SCL,
    Pin("SDA_I", "input", "model only: what all others make of SDA", level=1),
    Pin("SDA", "output", "I2C data with both FPGAs, open drain", level=1),
    RESET_N,
    Pin("CONTENTION", "output", "model only: link data, link control lines have two drivers", 2),
)
