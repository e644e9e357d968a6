"""CubeSense's register map for the thesis' register-pointer protocol on I2C.

CubeSense thesis, section 6.4.3: configuration registers of one byte, measurement registers that
return a signed 16-bit number, and an image register that streams the whole picture. Which
registers there are, their addresses, names and reset values are ours, as the text names none but
the thresholds. The settings and results are the same ones as in the node protocol, so their reset
values are taken from there.
"""

from cubestack.firmware_model.interface.cameras.registers import RegisterAccess
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.register_pointer import PointerMap, PointerRegister
from cubestack.firmware_model.interface.cubesense.codes import (
    IMAGE_BYTES,
    PIXELS_PER_DEGREE,
    Camera,
    CaptureResult,
    DetectResult,
    Measurement,
    NadirSearch,
    Sram,
    SramSelection,
)
from cubestack.firmware_model.interface.cubesense.telecommands import TELECOMMANDS

__all__ = ["REGISTERS"]

_RW = RegisterAccess.READ_WRITE
_RO = RegisterAccess.READ_ONLY
_WO = RegisterAccess.WRITE_ONLY

_RESETS = {message.name: message.reset_values() for message in TELECOMMANDS}


def _settings(camera: Camera) -> tuple[PointerRegister, ...]:
    """Configuration of a camera: 0x00 to 0x05 for the Sun's, 0x08 to 0x0D for the nadir one."""
    number = camera + 1
    settings = _RESETS[f"CameraSettings{number}"]
    rows = (
        ("THRESHOLD", "detection threshold", _RESETS[f"DetectionThreshold{number}"]["Threshold"]),
        ("EXPOSURE", "exposure in two line times, 127 us", settings["Exposure"]),
        ("GAIN", "amplification; the camera gets at most 63", settings["Gain"]),
        ("BLUE_GAIN", "gain of the blue channel", settings["BlueGain"]),
        ("RED_GAIN", "gain of the red channel", settings["RedGain"]),
    )
    registers = [
        PointerRegister(
            8 * camera + index, _RW, Field(f"{camera.name}_{name}", "u8", 0, meaning, reset=reset)
        )
        for index, (name, meaning, reset) in enumerate(rows)
    ]
    auto = Field(f"{camera.name}_AUTO", "u8", 0, "1: the camera adjusts itself", maximum=1)
    return (*registers, PointerRegister(8 * camera + len(rows), _RW, auto))


def _status(camera: Camera) -> tuple[PointerRegister, ...]:
    """Result codes of a camera: 0x20 to 0x22 for the Sun's, 0x28 to 0x2A for the nadir one."""
    start = 0x20 + 8 * camera
    return (
        PointerRegister(
            start,
            _RO,
            Field(
                f"{camera.name}_CAPTURE",
                "u8",
                0,
                "what became of the capture",
                choices=CaptureResult,
            ),
        ),
        PointerRegister(
            start + 1,
            _RO,
            Field(
                f"{camera.name}_DETECT",
                "u8",
                0,
                "what became of the detection",
                choices=DetectResult,
            ),
        ),
        PointerRegister(
            start + 2,
            _RO,
            Field(f"{camera.name}_POINTS", "u8", 0, "edges of the fit, or Sun pixels of the mean"),
        ),
    )


def _centre(camera: Camera) -> tuple[PointerRegister, ...]:
    """Measured centre: 0x40 and 0x41 for the Sun's camera, 0x48 and 0x49 for the nadir one."""
    return tuple(
        PointerRegister(
            0x40 + 8 * camera + index,
            _RO,
            Field(
                f"{camera.name}_{axis}",
                "i16",
                0,
                f"centre from the boresight, undistorted {line}; {PIXELS_PER_DEGREE} px a degree",
                "px",
                100,
            ),
        )
        for index, (axis, line) in enumerate((("X", "column"), ("Y", "row")))
    )


_CONTROL = (
    PointerRegister(
        0x10,
        _WO,
        Field("MEASURE", "u8", 0, "take a picture and measure in it", choices=Measurement),
    ),
    PointerRegister(
        0x11, _WO, Field("CAPTURE", "u8", 0, "take a picture only", choices=Measurement)
    ),
    PointerRegister(
        0x12, _RW, Field("IMAGE_SRAM", "u8", 0, "memory that IMAGE streams", choices=Sram)
    ),
    PointerRegister(
        0x13,
        _WO,
        Field(
            "CLEAR_OVER_CURRENT",
            "u8",
            0,
            "clear over-current flags, and switch the memories on again",
            choices=SramSelection,
        ),
    ),
    PointerRegister(
        0x14,
        _RW,
        Field("NADIR_SEARCH", "u8", 0, "how edges are looked for", choices=NadirSearch),
    ),
    PointerRegister(
        0x30,
        _RO,
        Field("OVER_CURRENT", "u8", 0, "bit 0: SRAM1 drew too much, bit 1: SRAM2", maximum=3),
    ),
)

_IMAGE = PointerRegister(
    0x60, _RO, Field("IMAGE", f"bytes{IMAGE_BYTES}", 0, "640 x 480 pixels, row after row")
)

REGISTERS = PointerMap(
    i2c_address=0x1C,
    registers=(
        *(
            register
            for camera in Camera
            for make in (_settings, _status, _centre)
            for register in make(camera)
        ),
        *_CONTROL,
        _IMAGE,
    ),
    note="The protocol is published; which registers there are, and their addresses, are ours.",
)
