"""The MLX75412 image sensor: size, clocks, and its published control registers.

CubeStar thesis, appendix D (and appendix C for the device address). The thesis names registers and
their effects, but prints reset values and the positions of most feature bits only where they matter
to it; values chosen here are marked in each register's ``assumed``. The thesis does not say which
registers wait for the sync register: here all do except the mode select register, whose enable bit
the published firmware uses without a sync.
"""

from functools import partial

from cubestack.firmware_model.interface.cameras.registers import (
    BitField,
    CameraRegister,
    CameraRegisterMap,
)

#: Size of an image in pixels, and the distance between pixel centres (table 3.3).
COLUMNS = 1024
ROWS = 512
PIXEL_PITCH_MM = 0.0056

#: Input clocks of a line, active and blank (appendix C).
LINE_CLOCKS = 1322

#: CubeStar's crystal: all measured frame rates fit 10 MHz, though 11 MHz is printed in places.
CRYSTAL_HZ = 10_000_000  # chosen: required by the published frame rates

#: Value of SYNC that makes written values take effect.
SYNC_APPLY = 0x03

#: Value of EXPOSURE_RULE for the longest exposure that the frame rate allows.
LONGEST_EXPOSURE = 0x0002


_synced = partial(CameraRegister, needs_sync=True)
_stored = partial(_synced, modelled=False)

_REGISTERS = (
    CameraRegister(0x8100, "MODE_SELECT", 0x00, "enable, output depth", assumed="reset value").of(
        BitField("ENABLE", 0, 1, "1 captures images, 0 is idle"),
        BitField(
            "OUTPUT_DEPTH",
            5,
            2,
            "1 is 8 bits; the eight wired lines carry the same bits at every depth",
            modelled=False,
        ),
    ),
    _synced(
        0x8102,
        "HARDWARE_FEATURES",
        0x00,
        "image processing in hardware",
        assumed="reset value; positions of all bits but HISTOGRAM_REMAP",
    ).of(
        BitField("SHARPENING", 0, 1, "sharpens edges", modelled=False),
        BitField("DEFECT_CORRECTION", 1, 1, "interpolates the pixels known as defective"),
        BitField("FPN_CORRECTION", 2, 1, "removes most of the fixed pattern"),
        BitField("DARK_SUBTRACTION", 3, 1, "subtracts the mean of the dark rows"),
        BitField(
            "HISTOGRAM_REMAP",
            6,
            1,
            "compresses 12 bits to 8, with AUTOVIEW; by default the model outputs the upper "
            "8 bits in any case (switch remap)",
        ),
    ),
    _stored(
        0x840B,
        "LINEARITY",
        0,
        "barriers of the high dynamic range response; all zero is linear",
        width=0x841F - 0x840B + 1,
        assumed="reset value; the model is always linear",
    ),
    _synced(
        0x8444,
        "EXPOSURE_RULE",
        0x0000,
        "0x0002 is the longest exposure that the frame rate allows; else EXPOSURE applies",
        width=2,
        assumed="reset value; the second address, printed as 0x8545 in one place",
    ),
    CameraRegister(
        0x8500,
        "SYNC",
        0x00,
        "0x03 makes written values take effect; reads as 0",
        assumed="reset value; value read; other values have no effect",
    ),
    _synced(
        0x8502,
        "FIRMWARE_FEATURES",
        0x00,
        "image processing in the sensor's own software, which fails below 20 MHz",
        assumed="reset value; which of bits 6 and 4 is which",
    ).of(
        BitField("AUTO_DYNAMIC_RANGE", 4, 1, "with BARRIER_UPDATE", modelled=False),
        BitField("AUTO_EXPOSURE", 5, 1, "sets the exposure automatically", modelled=False),
        BitField("BARRIER_UPDATE", 6, 1, "with AUTO_DYNAMIC_RANGE", modelled=False),
        BitField("AUTOVIEW", 7, 1, "updates the histogram remap"),
    ),
    _synced(0x8518, "CLOCKS_PER_SECOND", 27_000_000, "clock of FRAMES_PER_SECOND in Hz", width=4),
    _synced(0x851C, "FRAMES_PER_SECOND", 30, "at an input clock of CLOCKS_PER_SECOND", width=2),
    _synced(0x8526, "EXPOSURE", 512, "lines of 1322 clocks", width=2, assumed="reset value"),
)

# Address 0101_100: image sensor zero.
REGISTERS = CameraRegisterMap("MLX75412", 0x2C, address_bytes=2, registers=_REGISTERS)
