"""The MT9M001C12STM image sensor: size, clocks, and its control registers.

MT9M001 data sheet, revisions C (2005) and K (2011): registers of 16 bits behind addresses of 8 bits
on a two-wire bus, frame timing (tables 3 and 4 there), gain. The first active pixel of the array
(row 12, column 20) follows from the reset values. Bits that must keep their reset value are left
out of the fields.
"""

from functools import partial

from cubestack.firmware_model.interface.cameras.registers import (
    BitField,
    CameraRegister,
    CameraRegisterMap,
    RegisterAccess,
)

#: Active pixels, and the distance between their centres.
COLUMNS = 1280
ROWS = 1024
PIXEL_PITCH_MM = 0.0052

#: Array address of the first active pixel.
ARRAY_ROW = 12
ARRAY_COLUMN = 20

#: Frequency of PIXCLK and of the master clock: the recommended and highest one.
PIXEL_CLOCK_HZ = 48_000_000

#: Pixel clocks for which FRAME_VALID is high before the first LINE_VALID and after the last one, at
#: the smallest HORIZONTAL_BLANKING; more blanking adds to the second.
FRAME_START_CLOCKS = 242
FRAME_END_CLOCKS = 2

#: Smaller values of HORIZONTAL_BLANKING and VERTICAL_BLANKING count as these.
FEWEST_BLANK_CLOCKS = 19
FEWEST_BLANK_ROWS = 15

CHIP_VERSION = 0x8431  # the monochrome version

HIGHEST_GAIN = 15.0


def gain(register: int) -> float:
    """Amplification for a gain register's value.

    Up to 8: bits 5:0 in eighths, doubled by bit 6; above, from 0x60 on, 8 plus bits 2:0.
    """
    value = register & 0x7F
    if value >= 0x60:
        return 8.0 + (value & 7)
    return (1 + (value >> 6)) * (value & 0x3F) * 0.125


def gain_register(amplification: float) -> int:
    """Recommended register value for the gain nearest to ``amplification``.

    Raises ValueError outside of 1 to 15.
    """
    if not 1 <= amplification <= HIGHEST_GAIN:
        raise ValueError(f"the gain must be in 1..{HIGHEST_GAIN:g}, not {amplification:g}")
    recommended = (*range(0x08, 0x21), *range(0x51, 0x61), *range(0x61, 0x68))
    nearest: int = min(recommended, key=lambda value: abs(gain(value) - amplification))
    return nearest


_register = partial(CameraRegister, unit_bits=16)
_stored = partial(_register, modelled=False)


def _gain_register(address: int, name: str, pixels: str) -> CameraRegister:
    return _register(address, name, 0x0008, f"gain of the pixels in {pixels}").of(
        BitField("GAIN", 0, 7, "up to 8 in steps of 1/8 or 1/4, then up to 15 in steps of 1")
    )


_REGISTERS = (
    _register(0x00, "CHIP_VERSION", CHIP_VERSION, "sensor type", access=RegisterAccess.READ_ONLY),
    _register(0x01, "ROW_START", ARRAY_ROW, "first row of the window, an address of the array"),
    _register(0x02, "COLUMN_START", ARRAY_COLUMN, "first column of the window, even, of the array"),
    _register(0x03, "ROW_SIZE", ROWS - 1, "rows of the window minus one; at least 2"),
    _register(0x04, "COLUMN_SIZE", COLUMNS - 1, "columns of the window minus one; odd"),
    _register(0x05, "HORIZONTAL_BLANKING", 9, "pixel clocks between lines minus 225; at least 19"),
    _register(0x06, "VERTICAL_BLANKING", 25, "row times between frames minus one; at least 15"),
    _register(0x07, "OUTPUT_CONTROL", 0x0002, "synchronises changes, enables the read-out").of(
        BitField("HOLD", 0, 1, "1 delays the effect of written values"),
        BitField("CHIP_ENABLE", 1, 1, "0 stops the read-out, 1 starts with a new frame"),
        BitField("TEST_DATA", 6, 1, "1 sends a test pattern", modelled=False),
    ),
    _register(0x09, "SHUTTER_WIDTH", 0x0419, "exposure in row times").of(
        BitField("ROWS", 0, 14, "row times; more than the frame has extend it")
    ),
    _register(0x0B, "RESTART", 0, "aborts the frame and starts a new one").of(
        BitField("RESTART", 0, 1, "1 restarts; reads as 0")
    ),
    _stored(0x0C, "SHUTTER_DELAY", 0, "pixel clocks by which a row's exposure is shorter").of(
        BitField("CLOCKS", 0, 11, "pixel clocks")
    ),
    _register(0x0D, "RESET", 0, "sets all registers to their reset values").of(
        BitField("RESET", 0, 1, "1 holds the sensor in reset")
    ),
    _stored(0x1E, "READ_OPTIONS_1", 0x8000, "skipping, snapshots, strobe").of(
        BitField("COLUMN_SKIP_4", 2, 1, "reads 2 of 8 columns"),
        BitField("ROW_SKIP_4", 3, 1, "reads 2 of 8 rows"),
        BitField("COLUMN_SKIP_8", 4, 1, "reads 2 of 16 columns"),
        BitField("ROW_SKIP_8", 5, 1, "reads 2 of 16 rows"),
        BitField("SNAPSHOT", 8, 1, "waits for a trigger"),
        BitField("STROBE", 9, 1, "drives the strobe pin"),
        BitField("STROBE_WIDTH", 10, 1, "longest strobe"),
        BitField("STROBE_OVERRIDE", 11, 1, "strobe pin high"),
        BitField("RESERVED", 15, 1, "1"),
    ),
    _stored(0x20, "READ_OPTIONS_2", 0x1104, "bad frames, skipping, line valid").of(
        BitField("BAD_FRAMES", 0, 1, "1 sends frames of mixed exposure"),
        BitField("RESERVED_2", 2, 1, "1"),
        BitField("COLUMN_SKIP_2", 3, 1, "reads 2 of 4 columns"),
        BitField("ROW_SKIP_2", 4, 1, "reads 2 of 4 rows"),
        BitField("RESERVED_8", 8, 1, "1"),
        BitField("LINE_VALID_ALWAYS", 9, 1, "lines between frames too"),
        BitField("LINE_VALID_XOR", 10, 1, "inverted between frames"),
        BitField("RESERVED_12", 12, 1, "1"),
    ),
    _gain_register(0x2B, "GREEN_1_GAIN", "even rows, even columns"),
    _gain_register(0x2C, "BLUE_GAIN", "odd rows, even columns"),
    _gain_register(0x2D, "RED_GAIN", "even rows, odd columns"),
    _gain_register(0x2E, "GREEN_2_GAIN", "odd rows, odd columns"),
    _register(0x35, "GLOBAL_GAIN", 0x0008, "writes all four gains; reads as GREEN_1_GAIN").of(
        BitField("GAIN", 0, 7, "as in the four")
    ),
    _stored(0x5F, "BLACK_THRESHOLDS", 0x0904, "range of the black level, in counts of 10 bits").of(
        BitField("LOW", 0, 6, "lower one"),
        BitField("MANUAL", 7, 1, "uses both as written"),
        BitField("HIGH", 8, 7, "upper one"),
        BitField("NO_GAIN_DEPENDENCE", 15, 1, "keeps both at any gain"),
    ),
    _stored(0x62, "BLACK_CONTROL", 0x0498, "calibration of the black level").of(
        BitField("MANUAL", 0, 1, "the offset is as written"),
        BitField("DISABLE", 1, 2, "how the offset is applied"),
        BitField("RESERVED_3", 3, 2, "3"),
        BitField("RESERVED_7", 7, 1, "1"),
        BitField("RESERVED_10", 10, 1, "1"),
        BitField("KEEP_THRESHOLD", 11, 1, "after a sweep"),
        BitField("RECALCULATE", 12, 1, "starts a sweep; reads as 0"),
        BitField("NO_SWEEP", 15, 1, "after changes of gain"),
    ),
    _register(0xF1, "CHIP_ENABLE", 0x0001, "mirror of OUTPUT_CONTROL with swapped bits").of(
        BitField("CHIP_ENABLE", 0, 1, "as in OUTPUT_CONTROL"),
        BitField("HOLD", 1, 1, "as in OUTPUT_CONTROL"),
    ),
)

REGISTERS = CameraRegisterMap("MT9M001", 0x5D, address_bytes=1, registers=_REGISTERS)
