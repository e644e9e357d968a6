"""CubeStar's published telecommands.

CubeSpace family of nodes, interface version 3: IDs, names and layouts. Units, limits and reset
values are assumed where the tables print none; the reset values are those of the CubeStar thesis,
sections 4.1, 4.3, 5.3 and 5.4 and figure 5.12 (optics).
"""

import math

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.field import Field, enum8, f32, u8, u16
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import codes

#: Bytes of an image: one per pixel, row by row.
IMAGE_BYTES = COLUMNS * ROWS

#: Length of the firmware's preallocated arrays (CubeStar thesis, section 5.3.4).
MOST_STARS = 20


def _focal_length(name: str, meaning: str, reset: float) -> Field:
    return f32(name, meaning, "px", reset=reset).within(100.0, 10_000.0, "FocalLengthRangeError")


def _gain(name: str, meaning: str, limit: float, reset: float) -> Field:
    return f32(name, meaning, reset=reset).within(-limit, limit)


def _edge(name: str, meaning: str, maximum: int, reset: int) -> Field:
    return u16(name, meaning, "px", reset=reset).within(None, maximum, "ValidImageRangeSetError")


_SYSTEM = (
    Message(
        1,
        "TogglePowerSW",
        "toggle the load switch of the imager and the frame buffer",
        risk="the supply of imager and frame buffer changes",
    ),
    Message(
        2,
        "Reset",
        "restart the program; settings and counters return to power-up values",
        risk="the program restarts; settings that are not stored are lost",
    ),
    Message(
        3,
        "MCUReset",
        "reset the microcontroller by its system-request reset",
        risk="the microcontroller restarts; settings that are not stored are lost",
    ),
    Message(4, "setDelayTimerTimeout", "delay between Trigger and the first capture").of(
        u8("Time", "delay", "x 10 ms", reset=1).within(1, 100, "DelayTimeSetToLong")
    ),
    Message(5, "ClearWDGResetCounter", "set the count of watchdog resets to zero"),
    Message(6, "ClearErrorFlags", "clear all flags of telemetry ErrorFlags"),
)

_OPTICS = (
    Message(7, "Exposure", "exposure of the image sensor").of(
        u16("exposure", "line times (132.2 us at 10 MHz); 0: longest at the frame rate", "lines")
    ),
    Message(8, "setFocalLength", "focal length for unit vectors, at a pixel pitch of 5.6 um").of(
        f32("FocalLength", "focal length", "mm", reset=6.28).within(
            5.0, 7.0, "FocalLengthRangeError"
        )
    ),
    Message(9, "setFocalLengthComponents", "focal lengths of the distortion model, x and y").of(
        _focal_length("Fx", "along the rows", 1147.5),
        _focal_length("Fy", "along the columns", 1147.4),
    ),
    Message(
        10,
        "setPrincipalPoint",
        "principal point and centre of distortion; it may lie outside of the image",
    ).of(
        f32("Cx", "column, 0 is the middle of the first pixel", "px", reset=539.0).within(
            -COLUMNS, 2 * COLUMNS - 1, "PrincipalPointRangeError"
        ),
        f32("Cy", "row, 0 is the middle of the first pixel", "px", reset=175.5).within(
            -ROWS, 2 * ROWS - 1, "PrincipalPointRangeError"
        ),
    ),
    Message(
        11,
        "setRadialDistortionGains",
        "radial coefficients, distorted to undistorted (equations 4.1.3 and 4.1.4)",
    ).of(
        _gain("K1", "of the squared radius", 100.0, 0.32358),
        _gain("K2", "of its square", 100.0, -0.12456),
    ),
    Message(
        12,
        "setTangentalDistortionGains",
        "tangential coefficients, distorted to undistorted (equations 4.1.3 and 4.1.4)",
    ).of(
        _gain("P1", "along the columns", 10.0, -0.00414),
        _gain("P2", "along the rows", 10.0, 0.00624),
    ),
)

_IMAGE = (
    Message(13, "WriteTo_IS_Register", "write an image sensor register on the selected page").of(
        u8("Reg", "low byte of the register's address"),
        u8("DataH", "must be 0: registers have 8 bits").within(None, 0, "ISSetupError"),
        u8("DataL", "value to write"),
    ),
    Message(
        14,
        "ReadFrom_IS_Register",
        "read an image sensor register on the selected page into telemetry IS_Register",
    ).of(u8("Reg", "low byte of the register's address")),
    Message(
        15,
        "CaptureTestPatern",
        "write a pattern to the image memory (the sensor's own patterns are not published)",
    ).of(
        enum8(
            "TestPaternType",
            "modulo 256: column plus number of the image, column plus row, column",
            choices=codes.TestPattern,
            range_flag="TestPatternConfigError",
        )
    ),
    Message(16, "CaptureImage", "capture an image and transfer it to the processor"),
    Message(
        17,
        "UploadImage",
        "begin an upload: clear the image memory; UploadBlock fills it",
        risk="the image in memory is lost",
    ),
    Message(18, "ImageBlockSet", "select the block that telemetry ImageBlock returns").of(
        u16(
            "BlockNumber",
            "block of the image, row by row",
            high=IMAGE_BYTES // codes.ImageBlockSize.BYTES_32.length - 1,
            high_by=(
                "BlockSize",
                {size: IMAGE_BYTES // size.length - 1 for size in codes.ImageBlockSize},
            ),
            range_flag="ImageBlockSizeError",
        ),
        enum8(
            "BlockSize",
            "size; a shorter block fills the front of ImageBlock, 256 bytes take two reads",
            choices=codes.ImageBlockSize,
            range_flag="ImageBlockSizeError",
            reset=codes.ImageBlockSize.BYTES_128,
        ),
    ),
    Message(19, "StreamDownImage", "send the whole image as ImageBlock frames, unrequested"),
)

_LATER = "; published: {} of a 1280 x 1024 sensor, not mapped; more is rejected"

_DETECTION = (
    Message(20, "setDetectionRegion", "searched part of the 1024 x 512 pixels, ends included").of(
        u8(
            "StepSize", "sample every n-th pixel of every n-th row; 0 acts as 1", "px", reset=3
        ).within(None, 10, "ValidImageRangeSetError"),
        _edge("Xstart", f"first column{_LATER.format('0 to 343')}", COLUMNS - 1, 0),
        _edge("Xend", f"last column{_LATER.format('936 to 1279')}", COLUMNS - 1, COLUMNS - 1),
        _edge("Ystart", f"first row{_LATER.format('7 to 96')}", ROWS - 1, 0),
        _edge("Yend", f"last row{_LATER.format('943 to 1030')}", ROWS - 1, ROWS - 1),
        ordered=(("Xstart", "Xend"), ("Ystart", "Yend")),
    ),
    Message(21, "setDetectionThresholds", "a pixel of a star is above the threshold").of(
        u8("DetectionThreshold", "for a pixel of the search", "DN", reset=6),
        u8("StarThreshold", "for a neighbour while growing", "DN", reset=6),
    ),
    Message(22, "setStarPixels", "number of pixels of a star").of(
        u8("MinPixels", "fewer are noise", "px", reset=6).within(1, 100, "StarPixSetError"),
        u8("MaxPixels", "more are invalid", "px", reset=60).within(1, 100, "StarPixSetError"),
        ordered=(("MinPixels", "MaxPixels"),),
    ),
    Message(23, "setDetectionVariables", "centroiding window, and limits that end the search").of(
        u8(
            "GridSize",
            "side of the centroiding window; an even one acts as the next odd one",
            "px",
            reset=5,
        ).within(None, 15, "CentroidingGridSizeSetError"),
        u8(
            "MaxStars",
            f"limit of stars; 0 acts as 1, more than {MOST_STARS} as {MOST_STARS}",
            reset=MOST_STARS,
        ).within(None, 99, "MaxStarsSetError"),
        u8(
            "MaxInvalidStars",
            "limit of too large areas; 50 is the value of the thesis (section 5.3.3)",
            also=50,
            reset=50,
        ).within(None, 15),
        u8("MaxNoise", "limit of too small areas", reset=255).within(1, None, "MaxNoiseSetError"),
    ),
    Message(24, "DetectStars", "detect stars in the image memory"),
)

_IDENTIFICATION = (
    Message(25, "setIDMode", "how the next image's stars are identified").of(
        enum8(
            "IdMode",
            "tracking starts with an assisted match from setTrackingMode until the first fix",
            choices=codes.IdMode,
            range_flag="SetIDModeError",
            reset=codes.IdMode.LOST_IN_SPACE,
        )
    ),
    Message(26, "setTrackingMode", "rough boresight for the assisted match").of(
        f32("RightAscension", "right ascension of the boresight", "rad").within(
            -math.pi, 2 * math.pi, "RightAscensionSetError"
        ),
        f32("Declination", "declination of the boresight", "rad").within(
            -math.pi / 2, math.pi / 2, "DeclinationSetError"
        ),
    ),
    Message(27, "setIDMargin", "tolerance of the distance between two stars").of(
        u8("Margin", "tolerance", "rad", scale=10_000, low=0.0001, reset=0.001)
    ),
    Message(28, "IDStars", "identify the detected stars"),
    Message(29, "SelectBestStars", "select the three identified stars with the highest confidence"),
    Message(30, "EstimateAttitude", "estimate the attitude from the identified stars"),
)

_OPERATION = (
    Message(31, "ReadConfig", "restore the settings that SaveConfig stored"),
    Message(
        32,
        "SaveConfig",
        "store the settings in flash",
        risk="the settings stored before are replaced",
    ),
    Message(
        33,
        "ClearConfig",
        "erase the stored settings and return to the reset values",
        risk="the stored settings are erased",
    ),
    Message(
        34,
        "TestSRAM",
        "test the image memory; the image is lost",
        risk="the image in memory is lost",
    ),
    Message(
        35,
        "TestWDG",
        "stop serving the watchdog, so that it resets the processor",
        risk="the watchdog resets the microcontroller",
    ),
    Message(36, "CaptureAndProcess", "capture an image, then detect, identify and estimate"),
    Message(37, "ProcessImage", "detect, identify and estimate with the image in memory"),
    Message(38, "Trigger", "start the 1 s loop; it runs until StopLoop or Reset"),
)

PUBLISHED_TELECOMMANDS = _SYSTEM + _OPTICS + _IMAGE + _DETECTION + _IDENTIFICATION + _OPERATION
