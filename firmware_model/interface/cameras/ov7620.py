"""Size, registers and frame timing of the OV7620 image sensor, as far as CubeSense needs them.

OV7620 product specifications, revision 1.3: addresses and bits; CubeSense thesis, section 3.2 and
appendix A. Registers are written over SCCB, an I2C dialect, with one address byte; writes to other
addresses are ignored. Each register states its reset value and what is not modelled.
"""

from functools import partial

from cubestack.firmware_model.interface.cameras.registers import (
    BitField,
    CameraRegister,
    CameraRegisterMap,
)

#: Transmitted pixels, out of 664 x 492.
COLUMNS = 640
ROWS = 480

PIXEL_CLOCK_HZ = 13_500_000

#: Pixel clocks per line, blanking included.
CLOCKS_PER_LINE = 858

#: Lines per frame, blanking included: 33.37 ms per frame (CCIR-601).
LINES_PER_FRAME = 525

#: Line times per count of EXPOSURE: 127 us.
EXPOSURE_LINES = 2

_WINDOW_LEFT, _COLUMNS_PER_COUNT = 0x2F, 4
_WINDOW_TOP, _ROWS_PER_COUNT = 0x05, 2


def window_column(column: int) -> int:
    """HSTART or HSTOP for a window edge at ``column``, 0 to 640, rounded down to 4."""
    return _WINDOW_LEFT + column // _COLUMNS_PER_COUNT


def window_row(row: int) -> int:
    """VSTART or VSTOP for a window edge at ``row``, 0 to 480, rounded down to 2."""
    return _WINDOW_TOP + row // _ROWS_PER_COUNT


_COLOUR = "a monochrome image does not depend on it"
_FRAME = "the model's frame has 525 lines of 858 clocks"
_PICTURE = "reset value; the Y output of the model has no such processing"

_stored = partial(CameraRegister, modelled=False)

_REGISTERS = (
    CameraRegister(0x00, "GAIN", 0x00, "amplification of all pixels").of(
        BitField("FINE", 0, 4, "gain (1 + FINE / 16), times the two others"),
        BitField("DOUBLE", 4, 1, "1 doubles the gain"),
        BitField("DOUBLE_AGAIN", 5, 1, "1 doubles it again"),
    ),
    _stored(0x01, "BLUE_GAIN", 0x80, "gain of the blue channel", assumed=_COLOUR),
    _stored(0x02, "RED_GAIN", 0x80, "gain of the red channel", assumed=_COLOUR),
    _stored(0x03, "SATURATION", 0x80, "saturation of colours", assumed="reset value"),
    _stored(0x06, "BRIGHTNESS", 0x80, "brightness", assumed=_PICTURE),
    _stored(0x07, "SHARPNESS", 0xC6, "enhancement of edges", assumed=_PICTURE),
    _stored(0x0C, "BLUE_BIAS", 0x24, "bias of the white balance, blue", assumed="reset value"),
    _stored(0x0D, "RED_BIAS", 0x24, "bias of the white balance, red", assumed="reset value"),
    CameraRegister(0x10, "EXPOSURE", 0x7F, "in two line times", assumed="reset value; 0 acts as 1"),
    _stored(0x11, "CLOCK_DIVIDER", 0x00, "pixel clock divider", assumed="the clock is fixed").of(
        BitField("PRESCALER", 0, 6, "pixel clock / (PRESCALER + 1)"),
        BitField("SYNC_POLARITY", 6, 2, "polarity of the sync outputs"),
    ),
    CameraRegister(0x12, "COMMON_A", 0x24, "reset, mirror, automatic functions").of(
        BitField("AUTO_WHITE_BALANCE", 2, 1, "1 adjusts the colours", modelled=False),
        BitField("AUTO_GAIN", 5, 1, "1 adjusts GAIN, if AUTO_ADJUST is set"),
        BitField("MIRROR", 6, 1, "1 sends every line from right to left"),
        BitField("RESET", 7, 1, "1 resets all registers, and itself"),
    ),
    CameraRegister(0x13, "COMMON_B", 0x01, "enable of the automatic functions").of(
        BitField("AUTO_ADJUST", 0, 1, "1 enables the automatic functions")
    ),
    _stored(0x14, "COMMON_C", 0x04, "size of the image", assumed="the model sends full size").of(
        BitField("QVGA", 5, 1, "1 sends 320 x 240 pixels")
    ),
    CameraRegister(0x17, "HSTART", window_column(0), "first column of the window"),
    CameraRegister(0x18, "HSTOP", window_column(640), "column after the window"),
    CameraRegister(0x19, "VSTART", window_row(0), "first row of the window", assumed="reset value"),
    CameraRegister(0x1A, "VSTOP", window_row(480), "row after the window"),
    CameraRegister(
        0x28,
        "COMMON_H",
        0x20,
        "scan and black-and-white mode",
        assumed="position of BLACK_AND_WHITE; the model always scans all rows",
    ).of(
        BitField("PROGRESSIVE", 5, 1, "1 scans all rows, 0 interlaces", modelled=False),
        BitField("BLACK_AND_WHITE", 6, 1, "1 sends brightness only"),
    ),
    CameraRegister(0x29, "COMMON_I", 0x00, "control of the exposure").of(
        BitField("MANUAL_EXPOSURE", 7, 1, "1 uses the written EXPOSURE")
    ),
    _stored(0x2A, "FRAME_RATE_HIGH", 0x00, "adjustment of the frame rate", assumed=_FRAME),
    _stored(0x2B, "FRAME_RATE_LOW", 0x00, "adjustment of the frame rate, low byte", assumed=_FRAME),
    _stored(0x2D, "COMMON_J", 0x81, "band filter against flickering lamps", assumed="reset value"),
)

# SCCB address 0x42 to write, 0x43 to read.
REGISTERS = CameraRegisterMap("OV7620", 0x21, address_bytes=1, registers=_REGISTERS)
