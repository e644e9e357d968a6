"""The part without a board: its registers, and no connections."""

from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.table import Processor

PROCESSOR = Processor("EFM32GG280F1024", LAYOUTS, lambda: "")
