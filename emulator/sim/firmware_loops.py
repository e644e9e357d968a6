"""Gives firmware programs their inner loops in C++."""

from pathlib import Path

from cubestack import firmware_model
from cubestack.emulator.native.inner_loops import inner_loops
from cubestack.firmware_model.mcu.inner_loops import loops_in_use, use_loops

TITLE = "the inner loops of the firmware"


def offer_firmware_loops() -> None:
    """Have the programs of this process use C++, where it can be built; once."""
    if loops_in_use() is None:
        folder = Path(firmware_model.__file__).parent
        use_loops(inner_loops(TITLE, folder.rglob("*.cpp")))
