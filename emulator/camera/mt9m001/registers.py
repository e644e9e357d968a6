"""Settings from the MT9M001's registers, and side effects of writing them.

MT9M001 data sheet, register list. A write to GLOBAL_GAIN sets all four gains, CHIP_ENABLE and
OUTPUT_CONTROL share two bits, RESET restores all reset values, RESTART reads as 0.
"""

from dataclasses import dataclass, replace

from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.firmware_model.interface.cameras import mt9m001 as chip

GAINS = ("GREEN_1_GAIN", "BLUE_GAIN", "RED_GAIN", "GREEN_2_GAIN")


@dataclass(frozen=True)
class SensorSettings:
    """Settings of a frame, decoded from the registers."""

    enabled: bool  # whether frames are sent
    # first pixel of the window, counted from the first active one; may be negative
    row: int
    column: int
    # size of the window
    rows: int
    columns: int
    row_clocks: int  # pixel clocks from line to line
    blank_rows: int  # minimum of row times between the last line and the next frame
    exposure_rows: int  # exposure in row times
    # for even rows and columns; odd rows, even columns; even rows, odd columns; both odd
    gains: tuple[float, float, float, float]

    @property
    def timing(self) -> tuple[int, ...]:
        """Settings whose change would cause frames of mixed exposure."""
        return (
            *(self.row, self.column, self.rows, self.columns),
            *(self.row_clocks, self.blank_rows, self.exposure_rows),
        )

    @property
    def frame_rows(self) -> int:
        """Row times from frame to frame (tables 3 and 4)."""
        return max(self.rows + self.blank_rows, self.exposure_rows + 1)


def read_settings(registers: RegisterFile, before: SensorSettings | None = None) -> SensorSettings:
    """Settings from the registers; those of ``before`` while HOLD is set."""
    output = chip.REGISTERS["OUTPUT_CONTROL"]
    control = registers.active("OUTPUT_CONTROL")
    resetting = registers.active("RESET") & 1
    enabled = bool(output.field("CHIP_ENABLE").of(control)) and not resetting
    if before is not None and output.field("HOLD").of(control):
        return replace(before, enabled=enabled)
    value = registers.active
    columns = (value("COLUMN_SIZE") & 0x7FF | 1) + 1
    blank_clocks = max(value("HORIZONTAL_BLANKING") & 0x7FF, chip.FEWEST_BLANK_CLOCKS)
    blank_clocks += chip.FRAME_START_CLOCKS + chip.FRAME_END_CLOCKS - chip.FEWEST_BLANK_CLOCKS
    even, odd_row, odd_column, odd = (chip.gain(value(name)) for name in GAINS)
    return SensorSettings(
        enabled=enabled,
        row=(value("ROW_START") & 0x7FF) - chip.ARRAY_ROW,
        column=(value("COLUMN_START") & 0x7FE) - chip.ARRAY_COLUMN,
        rows=max(value("ROW_SIZE") & 0x7FF, 2) + 1,
        columns=columns,
        row_clocks=columns + blank_clocks,
        blank_rows=max(value("VERTICAL_BLANKING") & 0x7FF, chip.FEWEST_BLANK_ROWS) + 1,
        exposure_rows=max(value("SHUTTER_WIDTH") & 0x3FFF, 1),
        gains=(even, odd_row, odd_column, odd),
    )


def write_word(registers: RegisterFile, word: int) -> bool:
    """Write the next register; returns whether that ends the present frame."""
    register = registers.write(word)
    if register is None:
        return False
    if register.name == "GLOBAL_GAIN":
        for name in GAINS:
            registers.store(name, word & 0x7F)
    elif register.name == "GREEN_1_GAIN":
        registers.store("GLOBAL_GAIN", word & 0x7F)
    elif register.name == "CHIP_ENABLE":
        test = registers.active("OUTPUT_CONTROL") & ~0b11
        registers.store("OUTPUT_CONTROL", test | (word & 1) << 1 | word >> 1 & 1)
    elif register.name == "OUTPUT_CONTROL":
        registers.store("CHIP_ENABLE", (word & 1) << 1 | word >> 1 & 1)
    elif register.name == "RESET" and word & 1:
        registers.reset()
        registers.store("RESET", 1)
        return True
    elif register.name == "RESTART":
        registers.store("RESTART", 0)
        return bool(word & 1)
    return False
