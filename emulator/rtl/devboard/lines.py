"""The lines of a wiring that a development board needs for its operations on rows."""

from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.devboard import Camera, Lines, Memory


def lines_of(wiring: Wiring) -> Lines:
    """Cameras and memories have the numbers of their places in the wiring."""
    parts = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")
    return Lines(
        tuple(Camera(camera.clock, camera.data, camera.line) for camera in wiring.cameras),
        tuple(Memory(*(memory[part] for part in parts)) for memory in wiring.memories),
        wiring.data_clock,
        wiring.data,
        wiring.acknowledges,
    )
