"""AraMiS' telecommands: the use cases of the thesis, then settings and service.

AraMiS thesis, section 2.2: what the attitude controller, the power management and the integrator
ask of the star tracker. It defines no bytes, so all IDs and layouts are ours; those from 100 on
have no use case behind them.
"""

import math
from dataclasses import replace

from cubestack.firmware_model.interface.aramis.codes import (
    LatchUpStep,
    MeasurementMode,
    OnOff,
    SpikeMethod,
)
from cubestack.firmware_model.interface.cameras.mt9m001 import (
    COLUMNS,
    HIGHEST_GAIN,
    REGISTERS,
    ROWS,
)
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message

__all__ = [
    "BLOCK_BYTES",
    "IMAGE_BYTES",
    "MOST_CATALOGUE_BYTES",
    "MS_PER_DAY",
    "TELECOMMANDS",
]

#: Bytes of a picture: one for each pixel, row after row.
IMAGE_BYTES = COLUMNS * ROWS

#: Bytes that a block of a picture or of the catalogue has.
BLOCK_BYTES = 128

MS_PER_DAY = 86_400_000

MOST_CATALOGUE_BYTES = 65_536 * BLOCK_BYTES
"""Of a catalogue's image: as many blocks as a telecommand can number."""

_DEFAULT_EXPOSURE_ROWS = 6299


def _components(meaning: str) -> tuple[Field, ...]:
    return tuple(
        Field(f"Q{i}", "f32", 32 * i, f"{name} part, {meaning}", minimum=-1, maximum=1, reset=reset)
        for i, (name, reset) in enumerate((("x", 0.0), ("y", 0.0), ("z", 0.0), ("scalar", 1.0)))
    )


_USE_CASES = (
    Message(1, "Activate", 0, "start the camera, load the catalogue, be ready to measure"),
    Message(2, "Deactivate", 0, "stop the loop and the camera; settings stay"),
    Message(
        3,
        "SetSystemTime",
        8,
        "set the clock, at the instant the telecommand came",
        (
            Field("JulianDay", "u32", 0, "whole Julian days, which begin at noon UT", "d"),
            Field("Millisecond", "u32", 32, "since that noon", "ms", maximum=MS_PER_DAY - 1),
        ),
    ),
    Message(4, "GetAttitude", 0, "measure the attitude, lost in space; result: Attitude"),
    Message(
        5,
        "GetAttitudeNearVector",
        12,
        "measure the attitude near a direction; another length than 1 +- 0.1 is refused",
        tuple(
            Field(
                axis,
                "f32",
                32 * index,
                f"{axis} of the boresight's inertial unit vector",
                minimum=-1.1,
                maximum=1.1,
                range_flag="DirectionError",
            )
            for index, axis in enumerate("XYZ")
        ),
    ),
    Message(
        6,
        "GetAttitudeNearPoint",
        8,
        "measure the attitude near a direction",
        (
            Field(
                "RightAscension",
                "f32",
                0,
                "of the boresight",
                "rad",
                minimum=-math.pi,
                maximum=2 * math.pi,
                range_flag="DirectionError",
            ),
            Field(
                "Declination",
                "f32",
                32,
                "of the boresight",
                "rad",
                minimum=-math.pi / 2,
                maximum=math.pi / 2,
                range_flag="DirectionError",
            ),
        ),
    ),
    Message(
        7,
        "LatchUpAction",
        1,
        "turn the camera unit's supply off or on; off ends a latch-up, on sets the camera up again",
        (Field("Step", "enum8", 0, "off, then on", choices=LatchUpStep, reset=LatchUpStep.ON),),
    ),
    Message(
        8,
        "BeginCatalogue",
        8,
        "begin to load a catalogue; the present one stays until CommitCatalogue",
        (
            Field(
                "Length",
                "u32",
                0,
                "of the catalogue's image",
                "bytes",
                minimum=1,
                maximum=MOST_CATALOGUE_BYTES,
                range_flag="UploadError",
                reset=1,
            ),
            Field("Checksum", "u32", 32, "CRC-32 of the image"),
        ),
    ),
    Message(
        9,
        "CatalogueBlock",
        2 + BLOCK_BYTES,
        "a block of the catalogue's image, in any order",
        (
            Field("BlockNumber", "u16", 0, "block n covers bytes 128 n to 128 n + 127"),
            Field("Data", f"bytes{BLOCK_BYTES}", 16, "bytes; those beyond the length do not count"),
        ),
    ),
    Message(
        10,
        "CommitCatalogue",
        0,
        "check what was loaded, write it to flash error-coded, and use it",
    ),
    Message(
        11,
        "SetBodyRotation",
        16,
        "rotation from the star tracker's axes to the spacecraft's; kept in flash",
        _components("v_body = q v_camera q*"),
    ),
)

_EXTENSIONS = (
    Message(
        100,
        "StartLoop",
        3,
        "measure again and again",
        (
            Field("Period", "u16", 0, "of the loop", "ms", minimum=200, maximum=60_000, reset=1000),
            Field(
                "Mode",
                "enum8",
                16,
                "aided: near the latest attitude, and lost in space without one",
                choices=MeasurementMode,
            ),
        ),
    ),
    Message(101, "StopLoop", 0, "stop measuring again and again"),
    Message(
        102,
        "SetExposure",
        2,
        "exposure of the image sensor",
        (
            Field(
                "Rows",
                "u16",
                0,
                "row times of 31.75 us",
                "rows",
                minimum=1,
                maximum=REGISTERS["SHUTTER_WIDTH"].field("ROWS").mask,
                reset=_DEFAULT_EXPOSURE_ROWS,
            ),
        ),
    ),
    Message(
        103,
        "SetGain",
        1,
        "gain of the image sensor; it takes the nearest that it has",
        (
            Field(
                "Gain",
                "u8",
                0,
                "amplification",
                scale=8,
                minimum=1,
                maximum=HIGHEST_GAIN,
                reset=HIGHEST_GAIN,
            ),
        ),
    ),
    Message(
        104,
        "SetDetection",
        9,
        "search for stars",
        (
            Field(
                "Sigmas",
                "u8",
                0,
                "a bright pixel is above the mean by so many standard deviations",
                scale=10,
                maximum=20,
                reset=2,
            ),
            Field(
                "Spikes",
                "enum8",
                8,
                "how spikes are removed",
                choices=SpikeMethod,
                reset=SpikeMethod.CENTRE,
            ),
            Field(
                "Needed",
                "u8",
                16,
                "bright pixels that a window of 25 must have",
                minimum=1,
                maximum=25,
                reset=13,
            ),
            Field("MinPixels", "u16", 24, "smallest star", "px", minimum=1, reset=1),
            Field("MaxPixels", "u16", 40, "largest star", "px", minimum=1, reset=2500),
            Field(
                "MaxStars",
                "u8",
                56,
                "the brightest are kept",
                minimum=3,
                maximum=64,
                reset=30,
            ),
            Field(
                "Subtract",
                "enum8",
                64,
                "take the mean level off before weighing",
                choices=OnOff,
                reset=OnOff.ON,
            ),
        ),
        ordered=(("MinPixels", "MaxPixels"),),
    ),
    Message(
        105,
        "SetIdentification",
        6,
        "identification of the stars",
        (
            Field(
                "Noise",
                "u16",
                0,
                "expected noise of a centroid per axis",
                "px",
                scale=1000,
                minimum=0.01,
                maximum=10,
                reset=0.151,
            ),
            Field("Pivots", "u8", 16, "pivot triangles at most", maximum=3, reset=3),
            Field(
                "Verify",
                "enum8",
                24,
                "further stars must confirm the attitude; off is the published way",
                choices=OnOff,
                reset=OnOff.ON,
            ),
            Field(
                "HintTolerance",
                "u16",
                32,
                "a boresight farther from the rough direction is refused",
                "deg",
                scale=100,
                maximum=180,
                reset=6,
            ),
        ),
    ),
    Message(
        106,
        "SetField",
        5,
        "the lens",
        (
            Field(
                "FieldOfView",
                "f32",
                0,
                "across the picture's height",
                "deg",
                minimum=5,
                maximum=40,
                reset=21.534639,
            ),
            Field(
                "Round",
                "enum8",
                32,
                "only the circle of that diameter is used",
                choices=OnOff,
                reset=OnOff.ON,
            ),
        ),
    ),
    Message(
        107,
        "SetReloadPeriod",
        2,
        "how often the catalogue is loaded from flash anew",
        (Field("Period", "u16", 0, "0: only when it is found damaged", "s", reset=60),),
    ),
    Message(108, "ReloadCatalogue", 0, "load the catalogue from flash now"),
    Message(
        109,
        "RefreshCatalogue",
        0,
        "load the catalogue, then write it to flash anew, which ends corrected errors there",
    ),
    Message(110, "SaveConfig", 0, "write all settings to flash"),
    Message(111, "ClearConfig", 0, "erase the settings in flash, return to the reset values"),
    Message(112, "Reset", 0, "restart the program, inactive"),
    Message(113, "ClearErrorFlags", 0, "clear all flags of telemetry ErrorFlags"),
    Message(
        114,
        "ImageBlockSet",
        2,
        "select the block that telemetry ImageBlock returns",
        (
            Field(
                "BlockNumber",
                "u16",
                0,
                "block of the latest picture, row after row",
                maximum=IMAGE_BYTES // BLOCK_BYTES - 1,
            ),
        ),
    ),
    Message(
        115,
        "StreamDownImage",
        0,
        "send the latest picture as telemetry ImageBlock frames, without requests",
    ),
    Message(
        116,
        "WriteCameraRegister",
        3,
        "write an image sensor register; a measurement sets up exposure and gain again",
        (
            Field("Address", "u8", 0, "register's address"),
            Field("Value", "u16", 8, "value to write"),
        ),
    ),
    Message(
        117,
        "SelectCameraRegister",
        1,
        "read an image sensor register into telemetry CameraRegister",
        (Field("Address", "u8", 0, "register's address"),),
    ),
)

TELECOMMANDS = _USE_CASES + tuple(replace(message, ours=True) for message in _EXTENSIONS)
