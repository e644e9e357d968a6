"""CubeStar's published telecommands, first part: the node, optics, sensor and picture.

CubeSpace family of nodes, interface version 3: IDs, names and layouts. Units, limits and reset
values are ours where the tables print none; the reset values of the optics are those of
the CubeStar thesis, section 5.4 and figure 5.12.
"""

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar.codes import (
    ImageBlockSize,
    TestPattern,
)

__all__ = ["DEVICE_TELECOMMANDS", "IMAGE_BYTES"]

#: Bytes of a picture: one for each pixel, row after row.
IMAGE_BYTES = COLUMNS * ROWS


def _focal_length(name: str, offset: int, meaning: str, reset: float) -> Field:
    return Field(
        name,
        "f32",
        offset,
        meaning,
        "px",
        minimum=100.0,
        maximum=10_000.0,
        range_flag="FocalLengthRangeError",
        reset=reset,
    )


def _gain(name: str, offset: int, meaning: str, limit: float, reset: float) -> Field:
    return Field(name, "f32", offset, meaning, minimum=-limit, maximum=limit, reset=reset)


_SYSTEM = (
    Message(1, "TogglePowerSW", 0, "toggle the load switch of the imager and the frame buffer"),
    Message(2, "Reset", 0, "restart the program; settings and counters return to power-up values"),
    Message(3, "MCUReset", 0, "reset the microcontroller, as its system-request reset does"),
    Message(
        4,
        "setDelayTimerTimeout",
        1,
        "delay between Trigger and the first capture",
        (
            Field(
                "Time",
                "u8",
                0,
                "delay",
                "s",
                scale=10,
                maximum=1.0,
                range_flag="DelayTimeSetToLong",
            ),
        ),
    ),
    Message(5, "ClearWDGResetCounter", 0, "set the count of watchdog resets to zero"),
    Message(6, "ClearErrorFlags", 0, "clear all flags of telemetry ErrorFlags"),
)

_OPTICS = (
    Message(
        7,
        "Exposure",
        2,
        "exposure of the image sensor",
        (
            Field(
                "exposure",
                "u16",
                0,
                "exposure in line times (132.2 us at 10 MHz); 0: the longest the frame rate allows",
                "lines",
            ),
        ),
    ),
    Message(
        8,
        "setFocalLength",
        4,
        "focal length that turns undistorted pixels into unit vectors (pixel pitch 5.6 um)",
        (
            Field(
                "FocalLength",
                "f32",
                0,
                "focal length",
                "mm",
                minimum=1.0,
                maximum=100.0,
                range_flag="FocalLengthRangeError",
                reset=6.28,
            ),
        ),
    ),
    Message(
        9,
        "setFocalLengthComponents",
        8,
        "focal lengths that normalise distorted pixels in the distortion model",
        (
            _focal_length("Fx", 0, "along the rows", 1147.5),
            _focal_length("Fy", 32, "along the columns", 1147.4),
        ),
    ),
    Message(
        10,
        "setPrincipalPoint",
        8,
        "principal point and centre of distortion; it may lie outside of the picture",
        (
            Field(
                "Cx",
                "f32",
                0,
                "column, 0 is the middle of the first pixel",
                "px",
                minimum=-COLUMNS,
                maximum=2 * COLUMNS - 1,
                range_flag="PrincipalPointRangeError",
                reset=539.0,
            ),
            Field(
                "Cy",
                "f32",
                32,
                "row, 0 is the middle of the first pixel",
                "px",
                minimum=-ROWS,
                maximum=2 * ROWS - 1,
                range_flag="PrincipalPointRangeError",
                reset=175.5,
            ),
        ),
    ),
    Message(
        11,
        "setRadialDistortionGains",
        8,
        "radial coefficients, distorted to undistorted (equations 4.1.3 and 4.1.4)",
        (
            _gain("K1", 0, "of the squared radius", 100.0, 0.32358),
            _gain("K2", 32, "of its square", 100.0, -0.12456),
        ),
    ),
    Message(
        12,
        "setTangentalDistortionGains",
        8,
        "tangential coefficients, distorted to undistorted (equations 4.1.3 and 4.1.4)",
        (
            _gain("P1", 0, "along the columns", 10.0, -0.00414),
            _gain("P2", 32, "along the rows", 10.0, 0.00624),
        ),
    ),
)

_IMAGE = (
    Message(
        13,
        "WriteTo_IS_Register",
        3,
        "write an image sensor register on the page that SetCameraRegisterPage selects",
        (
            Field("Reg", "u8", 0, "low byte of the register's address"),
            Field(
                "DataH",
                "u8",
                8,
                "must be 0: this sensor's registers have 8 bits",
                maximum=0,
                range_flag="ISSetupError",
            ),
            Field("DataL", "u8", 16, "value to write"),
        ),
    ),
    Message(
        14,
        "ReadFrom_IS_Register",
        1,
        "read an image sensor register on the selected page into telemetry IS_Register",
        (Field("Reg", "u8", 0, "low byte of the register's address"),),
    ),
    Message(
        15,
        "CaptureTestPatern",
        1,
        "write a pattern to the picture memory (the sensor's own patterns are not published)",
        (
            Field(
                "TestPaternType",
                "enum8",
                0,
                "pattern: column, row, or their sum, modulo 256",
                choices=TestPattern,
                range_flag="TestPatternConfigError",
            ),
        ),
    ),
    Message(16, "CaptureImage", 0, "capture a picture and transfer it to the processor"),
    Message(
        17,
        "UploadImage",
        0,
        "begin an upload: clear the picture memory, which UploadBlock then fills",
    ),
    Message(
        18,
        "ImageBlockSet",
        3,
        "select the block that telemetry ImageBlock returns",
        (
            Field(
                "BlockNumber",
                "u16",
                0,
                "block of the picture, row after row",
                maximum=IMAGE_BYTES // ImageBlockSize.BYTES_32.length - 1,
                maximum_by=(
                    "BlockSize",
                    {size: IMAGE_BYTES // size.length - 1 for size in ImageBlockSize},
                ),
                range_flag="ImageBlockSizeError",
            ),
            Field(
                "BlockSize",
                "enum8",
                16,
                "size; a shorter one fills the front of ImageBlock, 256 bytes come as two reads",
                choices=ImageBlockSize,
                range_flag="ImageBlockSizeError",
                reset=ImageBlockSize.BYTES_128,
            ),
        ),
    ),
    Message(
        19,
        "StreamDownImage",
        0,
        "send the whole picture as telemetry ImageBlock frames, 128 bytes each, without requests",
    ),
)

DEVICE_TELECOMMANDS = _SYSTEM + _OPTICS + _IMAGE
