"""CubeSense's register map for the thesis' register-pointer protocol on I2C and backup UART.

CubeSense thesis, section 6.4.3: configuration registers of one byte, measurement registers with a
signed 16-bit number, and an image register that streams the whole image. The text names only the
thresholds; the other registers, all addresses, names and reset values are assumed. The settings and
results are those of the node protocol, and so are their reset values.
"""

from collections.abc import Iterator

from cubestack.firmware_model.interface.cameras.registers import RegisterAccess
from cubestack.firmware_model.interface.codec.field import Field, byte_array, i16, u8
from cubestack.firmware_model.interface.codec.register_pointer import PointerMap, PointerRegister
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.telecommands import TELECOMMANDS

_RW = RegisterAccess.READ_WRITE
_RO = RegisterAccess.READ_ONLY
_WO = RegisterAccess.WRITE_ONLY

_RESETS = {message.name: message.reset_values() for message in TELECOMMANDS}


def _camera(camera: codes.Camera) -> Iterator[PointerRegister]:
    """Registers of a camera; the nadir camera's addresses are 8 above the Sun camera's."""
    number, name = camera + 1, camera.name
    resets = _RESETS[f"CameraSettings{number}"] | _RESETS[f"DetectionThreshold{number}"]
    settings = (
        ("THRESHOLD", "Threshold", "detection threshold"),
        ("EXPOSURE", "Exposure", "exposure in two line times, 127 us"),
        ("GAIN", "Gain", "amplification; the camera gets at most 63"),
        ("BLUE_GAIN", "BlueGain", "gain of the blue channel"),
        ("RED_GAIN", "RedGain", "gain of the red channel"),
    )
    fields = {
        address: u8(f"{name}_{register}", meaning, reset=resets[parameter])
        for address, (register, parameter, meaning) in enumerate(settings)
    } | {
        0x05: u8(f"{name}_AUTO", "1: the camera adjusts itself", high=1),
        0x20: u8(f"{name}_CAPTURE", "outcome of the capture", choices=codes.CaptureResult),
        0x21: u8(f"{name}_DETECT", "outcome of the detection", choices=codes.DetectResult),
        0x22: u8(f"{name}_POINTS", "edges of the fit, or Sun pixels of the mean"),
        0x40: _centre(f"{name}_X", "column"),
        0x41: _centre(f"{name}_Y", "row"),
    }
    for address, field in fields.items():
        yield PointerRegister(8 * camera + address, _RW if address < 0x20 else _RO, field)


def _centre(name: str, line: str) -> Field:
    meaning = (
        f"undistorted {line} of the centre, from the boresight; {codes.PIXELS_PER_DEGREE} px/deg"
    )
    return i16(name, meaning, "px", 100)


_COMMON = (
    PointerRegister(0x10, _WO, u8("MEASURE", "capture and measure", choices=codes.Measurement)),
    PointerRegister(0x11, _WO, u8("CAPTURE", "capture only", choices=codes.Measurement)),
    PointerRegister(0x12, _RW, u8("IMAGE_SRAM", "memory that IMAGE streams", choices=codes.Sram)),
    PointerRegister(
        0x13,
        _WO,
        u8(
            "CLEAR_OVER_CURRENT",
            "clear over-current flags, and switch the memories on again",
            choices=codes.SramSelection,
        ),
    ),
    PointerRegister(0x14, _RW, u8("NADIR_SEARCH", "search method", choices=codes.NadirSearch)),
    PointerRegister(0x30, _RO, u8("OVER_CURRENT", "bit 0: SRAM1 cut off, bit 1: SRAM2", high=3)),
    PointerRegister(0x60, _RO, byte_array(codes.IMAGE_BYTES, "IMAGE", "640 x 480 px by row")),
)

REGISTERS = PointerMap(
    i2c_address=0x1C,
    baud=115_200,  # that of appendix E: the part has one UART
    registers=(*_camera(codes.Camera.SUN), *_camera(codes.Camera.NADIR), *_COMMON),
    note="The protocol is published; the registers and their addresses are assumed.",
)
