"""CubeStar's telecommands and telemetry that are ours: IDs 100-127 and 200-255.

The published interface has no layout for an image upload, quantises the quaternion to 1e-4, and
has no message for the image sensor's frame rate, which the thesis' ground software sets
(CubeStar thesis, appendix A). Sensor figures: appendices D and E there.
"""

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar.codes import MatchMode
from cubestack.firmware_model.interface.cubestar.telecommands import IMAGE_BYTES

__all__ = ["EXTENSION_TELECOMMANDS", "EXTENSION_TELEMETRY", "UPLOAD_BLOCK_BYTES"]

#: Bytes that one UploadBlock carries.
UPLOAD_BLOCK_BYTES = 128

DEFAULT_FRAME_RATE = 7
LARGEST_FRAME_RATE = 39  # of 27 MHz / 1322 clocks a line: a frame outlasts its 512 lines
DEFAULT_DISCARD_MS = 70
DEFAULT_REGISTER_PAGE = 0x85

EXTENSION_TELECOMMANDS = (
    Message(
        100,
        "UploadBlock",
        2 + UPLOAD_BLOCK_BYTES,
        "write a block of the picture memory",
        (
            Field(
                "BlockNumber",
                "u16",
                0,
                "block n covers bytes 128 n to 128 n + 127, row after row",
                maximum=IMAGE_BYTES // UPLOAD_BLOCK_BYTES - 1,
                range_flag="ImageBlockSizeError",
            ),
            Field("Data", f"bytes{UPLOAD_BLOCK_BYTES}", 16, "pixels"),
        ),
        ours=True,
    ),
    Message(
        101,
        "SelectImageBank",
        1,
        "half of the frame buffer that the next capture fills and the next transfer reads",
        (Field("Bank", "u8", 0, "bank", maximum=1),),
        ours=True,
    ),
    Message(
        102,
        "SetFrameRate",
        2,
        "frame rate of the image sensor",
        (
            Field(
                "FrameRate",
                "u16",
                0,
                "the sensor's register; frames a second = register x crystal / 27 MHz",
                minimum=6,
                maximum=LARGEST_FRAME_RATE,
                range_flag="ConfigChangeError",
                reset=DEFAULT_FRAME_RATE,
            ),
        ),
        ours=True,
    ),
    Message(
        103,
        "SetDiscardDelay",
        2,
        "wait between enabling the image sensor and storing",
        (
            Field(
                "Delay",
                "u16",
                0,
                "less than a read-out (67.7 ms) splits the picture",
                "ms",
                maximum=1000,
                range_flag="DelayTimeSetToLong",
                reset=DEFAULT_DISCARD_MS,
            ),
        ),
        ours=True,
    ),
    Message(
        104,
        "SetCameraRegisterPage",
        1,
        "page of the image sensor's registers for telecommands 13 and 14",
        (
            Field(
                "Page",
                "u8",
                0,
                "high byte of the register's address",
                reset=DEFAULT_REGISTER_PAGE,
            ),
        ),
        ours=True,
    ),
    Message(
        105,
        "WriteCameraRegister",
        3,
        "write an image sensor register",
        (
            Field("Address", "u16", 0, "register's address"),
            Field("Value", "u8", 16, "value to write"),
        ),
        ours=True,
    ),
    Message(
        106,
        "SelectCameraRegister",
        2,
        "read an image sensor register into telemetry CameraRegister",
        (Field("Address", "u16", 0, "register's address"),),
        ours=True,
    ),
    Message(107, "StopLoop", 0, "end the 1 s loop after its present iteration", ours=True),
)

EXTENSION_TELEMETRY = (
    Message(
        200,
        "AttitudeQuaternion",
        27,
        "latest attitude in full precision, inertial to camera",
        (
            Field("Q0", "f32", 0, "vector part, x"),
            Field("Q1", "f32", 32, "vector part, y"),
            Field("Q2", "f32", 64, "vector part, z"),
            Field("Q3", "f32", 96, "scalar part"),
            Field("FrameCounter", "u32", 128, "number of the picture since power-up"),
            Field("ImageTime", "u32", 160, "uptime at mid-exposure", "ms"),
            Field("Mode", "enum8", 192, "mode that identified the picture", choices=MatchMode),
            Field("Matched", "u8", 200, "stars that the attitude rests on"),
            Field("Valid", "bool1", 208, "the latest picture gave this attitude"),
        ),
        ours=True,
    ),
    Message(
        201,
        "PhaseTimes",
        32,
        "latest time of each phase of a picture",
        tuple(
            Field(name, "u32", 32 * index, meaning, "us")
            for index, (name, meaning) in enumerate(
                (
                    ("Idle", "waiting or restarting, imager off"),
                    ("Discard", "imager on, undefined frame"),
                    ("Capture", "frame buffer stores the picture"),
                    ("Transfer", "frame buffer to processor memory"),
                    ("Detect", "detection, distortion and unit vectors"),
                    ("Match", "identification"),
                    ("Attitude", "attitude estimate"),
                    ("LoopTotal", "whole iteration without the wait for the next"),
                )
            )
        ),
        ours=True,
    ),
    Message(
        202,
        "HipparcosNumber",
        13,
        "next identified star's Hipparcos number",
        (
            Field("StarNumber", "u8", 0, "number of the detected star, from 0; 255: none"),
            Field("Hipparcos", "u32", 8, "Hipparcos number"),
            Field("X", "f32", 40, "measured column", "px"),
            Field("Y", "f32", 72, "measured row", "px"),
        ),
        ours=True,
        steps=True,
    ),
    Message(
        203,
        "UploadStatus",
        4,
        "progress of an upload",
        (
            Field("NextBlock", "u16", 0, "block behind the latest one"),
            Field("BlocksReceived", "u16", 16, "blocks since UploadImage"),
        ),
        ours=True,
    ),
    Message(
        204,
        "SupplyReport",
        8,
        "supply monitoring",
        (
            Field("SramCurrent", "u16", 0, "current of the processor's SRAM", "mA", 10),
            Field("ImagerCurrent", "u16", 16, "current of FPGA and imager", "mA", 10),
            Field("LatchUps", "u16", 32, "over-currents that opened the switch"),
            Field("PowerCycles", "u16", 48, "times that the switch was closed again"),
        ),
        ours=True,
    ),
    Message(
        205,
        "CameraRegister",
        4,
        "image sensor register that SelectCameraRegister read",
        (
            Field("Address", "u16", 0, "register's address"),
            Field("Value", "u8", 16, "value"),
            Field("Valid", "u8", 24, "1: the sensor acknowledged"),
        ),
        ours=True,
    ),
    Message(
        206,
        "LoopStatus",
        12,
        "state of the main loop and of the settings that are ours",
        (
            Field("Iterations", "u32", 0, "iterations since power-up"),
            Field("ModeFlag", "u8", 32, "mode for the next picture", choices=MatchMode),
            Field("FrameRate", "u16", 40, "the sensor's frame-rate register"),
            Field("DiscardDelay", "u16", 56, "wait after enabling the sensor", "ms"),
            Field("Bank", "u8", 72, "half of the frame buffer"),
            Field("CameraPage", "u8", 80, "page of telecommands 13 and 14"),
            Field("Running", "bool1", 88, "the 1 s loop runs"),
        ),
        ours=True,
    ),
    Message(
        207,
        "MatchSummary",
        7,
        "how well the latest picture was identified",
        (
            Field("Detected", "u8", 0, "stars detected"),
            Field("Matched", "u8", 8, "stars identified"),
            Field("MeanConfidence", "f32", 16, "mean confidence of the identified stars, 0 to 1"),
            Field("MaxVotes", "u8", 48, "most verification votes of a star"),
        ),
        ours=True,
    ),
)
