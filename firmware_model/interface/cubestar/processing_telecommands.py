"""CubeStar's published telecommands, second part: detection, identification, attitude, operation.

CubeSpace family of nodes, interface version 3: IDs, names and layouts. Units, limits and reset
values are ours where the tables print none; the reset values are those of the CubeStar thesis,
sections 4.1, 4.3 and 5.3.
"""

import math

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar.codes import GridSize, IdMode

__all__ = ["PROCESSING_TELECOMMANDS"]


def _edge(name: str, offset: int, meaning: str, maximum: int, reset: int) -> Field:
    return Field(
        name,
        "u16",
        offset,
        meaning,
        "px",
        maximum=maximum,
        range_flag="ValidImageRangeSetError",
        reset=reset,
    )


LARGEST_AREA = 240
"""The list of visited pixels must fit the free half of the external SRAM at every setting."""

_DETECTION = (
    Message(
        20,
        "setDetectionRegion",
        9,
        "part of the picture that is searched, both ends included",
        (
            Field(
                "StepSize",
                "u8",
                0,
                "look at every n-th pixel of every n-th row",
                "px",
                minimum=1,
                maximum=32,
                range_flag="ValidImageRangeSetError",
                reset=3,
            ),
            _edge("Xstart", 8, "first column", COLUMNS - 1, 0),
            _edge("Xend", 24, "last column", COLUMNS - 1, COLUMNS - 1),
            _edge("Ystart", 40, "first row", ROWS - 1, 0),
            _edge("Yend", 56, "last row", ROWS - 1, ROWS - 1),
        ),
        ordered=(("Xstart", "Xend"), ("Ystart", "Yend")),
    ),
    Message(
        21,
        "setDetectionThresholds",
        2,
        "pixel values that make a star; higher than the threshold counts",
        (
            Field("DetectionThreshold", "u8", 0, "for a pixel of the search", "DN", reset=6),
            Field("StarThreshold", "u8", 8, "for a neighbour while growing", "DN", reset=6),
        ),
    ),
    Message(
        22,
        "setStarPixels",
        2,
        "number of pixels of a star",
        (
            Field(
                "MinPixels",
                "u8",
                0,
                "fewer are noise",
                "px",
                minimum=1,
                range_flag="StarPixSetError",
                reset=6,
            ),
            Field(
                "MaxPixels",
                "u8",
                8,
                "more are an invalid star",
                "px",
                minimum=1,
                maximum=LARGEST_AREA,
                range_flag="StarPixSetError",
                reset=60,
            ),
        ),
        ordered=(("MinPixels", "MaxPixels"),),
    ),
    Message(
        23,
        "setDetectionVariables",
        4,
        "centroiding window, and when the search stops",
        (
            Field(
                "GridSize",
                "u8",
                0,
                "side of the centroiding window",
                "px",
                choices=GridSize,
                range_flag="CentroidingGridSizeSetError",
                reset=GridSize.GRID_5,
            ),
            Field(
                "MaxStars",
                "u8",
                8,
                "stars found",
                minimum=2,
                maximum=20,
                range_flag="MaxStarsSetError",
                reset=20,
            ),
            Field("MaxInvalidStars", "u8", 16, "more areas than this were too large", reset=50),
            Field(
                "MaxNoise",
                "u8",
                24,
                "more areas than this were too small",
                minimum=1,
                range_flag="MaxNoiseSetError",
                reset=255,
            ),
        ),
    ),
    Message(24, "DetectStars", 0, "detect stars in the picture memory"),
)

_IDENTIFICATION = (
    Message(
        25,
        "setIDMode",
        1,
        "how the next picture's stars are identified",
        (
            Field(
                "IdMode",
                "enum8",
                0,
                "tracking starts with an assisted match from setTrackingMode until the first fix",
                choices=IdMode,
                range_flag="SetIDModeError",
                reset=IdMode.LOST_IN_SPACE,
            ),
        ),
    ),
    Message(
        26,
        "setTrackingMode",
        8,
        "rough boresight for the assisted match",
        (
            Field(
                "RightAscension",
                "f32",
                0,
                "right ascension of the boresight",
                "rad",
                minimum=-math.pi,
                maximum=2 * math.pi,
                range_flag="RightAscensionSetError",
            ),
            Field(
                "Declination",
                "f32",
                32,
                "declination of the boresight",
                "rad",
                minimum=-math.pi / 2,
                maximum=math.pi / 2,
                range_flag="DeclinationSetError",
            ),
        ),
    ),
    Message(
        27,
        "setIDMargin",
        1,
        "tolerance of the distance between two stars",
        (Field("Margin", "u8", 0, "tolerance", "rad", scale=10_000, minimum=0.0001, reset=0.001),),
    ),
    Message(28, "IDStars", 0, "identify the detected stars"),
    Message(29, "SelectBestStars", 0, "select the three identified stars of highest confidence"),
    Message(30, "EstimateAttitude", 0, "estimate the attitude from the identified stars"),
)

_OPERATION = (
    Message(31, "ReadConfig", 0, "restore the settings that SaveConfig stored"),
    Message(32, "SaveConfig", 0, "store the settings in flash"),
    Message(33, "ClearConfig", 0, "erase the stored settings and return to the reset values"),
    Message(34, "TestSRAM", 0, "test the picture memory; the picture is lost"),
    Message(35, "TestWDG", 0, "stop serving the watchdog, so that it resets the processor"),
    Message(36, "CaptureAndProcess", 0, "capture a picture, then detect, identify and estimate"),
    Message(37, "ProcessImage", 0, "detect, identify and estimate with the picture in memory"),
    Message(38, "Trigger", 0, "start the 1 s loop; it runs until StopLoop or Reset"),
)

PROCESSING_TELECOMMANDS = _DETECTION + _IDENTIFICATION + _OPERATION
