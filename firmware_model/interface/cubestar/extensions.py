"""CubeStar's telecommands and telemetry added to the published ones: IDs 100-127 and 200-255.

The published interface has no layout for an image upload, quantises the quaternion to 1e-4, and
has no message for the image sensor's frame rate, which the thesis' ground software sets
(CubeStar thesis, appendix A). Sensor figures: appendices D and E there.
"""

import math
from dataclasses import replace

from cubestack.firmware_model.interface.codec.attitude_quality import ATTITUDE_QUALITY
from cubestack.firmware_model.interface.codec.field import (
    bool1,
    byte_array,
    enum8,
    f32,
    u8,
    u16,
    u32,
)
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import switch_messages
from cubestack.firmware_model.interface.cubestar.codes import Disc, MatchMode, RateOutcome, Reason
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.interface.cubestar.telecommands import IMAGE_BYTES

#: Bytes of data per UploadBlock.
UPLOAD_BLOCK_BYTES = 128

MOST_BODIES = 8  #: planets and Moon that the host can list

#: Numbers from here on in place of a Hipparcos number are those of bodies.
FIRST_BODY = 4_000_000_000

_LARGEST_FRAME_RATE = 39  # from 27 MHz and 1322 clocks per line: a frame must outlast its 512 lines

*_SET_SWITCHES, _SWITCHES_SHOWN = switch_messages(
    CubeStarSwitches, 108, 208, "kept by every reset but telecommand Reset"
)

_TELECOMMANDS = (
    Message(100, "UploadBlock", "write a block of the image memory").of(
        u16("BlockNumber", "block n covers bytes 128 n to 128 n + 127, row by row").within(
            None, IMAGE_BYTES // UPLOAD_BLOCK_BYTES - 1, "ImageBlockSizeError"
        ),
        byte_array(UPLOAD_BLOCK_BYTES, "Data", "pixels"),
    ),
    Message(
        101,
        "SelectImageBank",
        "half of the frame buffer that the next capture fills and the next transfer reads",
    ).of(u8("Bank", "bank", high=1)),
    Message(102, "SetFrameRate", "frame rate of the image sensor").of(
        u16(
            "FrameRate",
            "the sensor's register; frames per second = register x crystal / 27 MHz",
            reset=7,
        ).within(6, _LARGEST_FRAME_RATE, "ConfigChangeError")
    ),
    # The reset value is chosen: the published wait that explains the published 68 ms.
    Message(103, "SetDiscardDelay", "wait between enabling the image sensor and storing").of(
        u16("Delay", "below a read-out (67.7 ms) the image is split", "ms", reset=70).within(
            None, 1000, "DelayTimeSetToLong"
        )
    ),
    Message(
        104,
        "SetCameraRegisterPage",
        "page of the image sensor's registers for telecommands 13 and 14",
    ).of(u8("Page", "high byte of the register's address", reset=0x85)),
    Message(105, "WriteCameraRegister", "write an image sensor register").of(
        u16("Address", "register's address"), u8("Value", "value to write")
    ),
    Message(
        106, "SelectCameraRegister", "read an image sensor register into telemetry CameraRegister"
    ).of(u16("Address", "register's address")),
    Message(107, "StopLoop", "end the 1 s loop after the current iteration"),
    *_SET_SWITCHES,
    Message(
        110, "SetBody", "list a planet or the Moon, for switch bodies; forgotten without power"
    ).of(
        u8("Number", "its place in the list", high=MOST_BODIES - 1),
        f32("RightAscension", "right ascension seen from the satellite", "rad").within(
            -math.pi, 2 * math.pi
        ),
        f32("Declination", "its declination", "rad").within(-math.pi / 2, math.pi / 2),
        f32("Radius", "angular radius; 0: a planet, which is a point", "rad").within(0.0, 0.02),
        f32("Accuracy", "standard deviation of the direction in each axis", "rad").within(0.0, 0.1),
        u16("Minutes", "how long it holds; 0 removes it", "min"),
    ),
)

_TELEMETRY = (
    Message(200, "AttitudeQuaternion", "latest attitude in full precision, inertial to camera").of(
        f32("Q0", "vector part, x"),
        f32("Q1", "vector part, y"),
        f32("Q2", "vector part, z"),
        f32("Q3", "scalar part"),
        u32("FrameCounter", "number of the image since power-up", counter=True),
        u32("ImageTime", "uptime at mid-exposure", "ms"),
        enum8("Mode", "mode that identified the image", choices=MatchMode),
        u8("Matched", "stars used for the attitude"),
        bool1("Valid", "this is the attitude of the latest image"),
    ),
    Message(201, "PhaseTimes", "latest time of each phase of an image").of(
        u32("Idle", "waiting or restarting, imager off", "us"),
        u32("Discard", "imager on, undefined frame", "us"),
        u32("Capture", "frame buffer stores the image", "us"),
        u32("Transfer", "frame buffer to processor memory", "us"),
        u32("Detect", "detection, distortion and unit vectors", "us"),
        u32("Match", "identification", "us"),
        u32("Attitude", "attitude estimate", "us"),
        u32("LoopTotal", "whole iteration without the wait for the next", "us"),
    ),
    Message(202, "HipparcosNumber", "next identified star's Hipparcos number", steps=True).of(
        u8("StarNumber", "number of the detected star, from 0; 255: none"),
        u32("Hipparcos", f"Hipparcos number; {FIRST_BODY} plus the number of a body of SetBody"),
        f32("X", "measured column", "px"),
        f32("Y", "measured row", "px"),
    ),
    Message(203, "UploadStatus", "progress of an upload").of(
        u16("NextBlock", "number after the latest block"),
        u16("BlocksReceived", "blocks since UploadImage", counter=True),
    ),
    Message(204, "SupplyReport", "supply monitoring").of(
        u16("SramCurrent", "current of the processor's SRAM", "mA", 10),
        u16("ImagerCurrent", "current of FPGA and imager", "mA", 10),
        u16("LatchUps", "over-currents that opened the switch"),
        u16("PowerCycles", "times that the switch was closed again"),
    ),
    Message(205, "CameraRegister", "image sensor register that SelectCameraRegister read").of(
        u16("Address", "register's address"),
        u8("Value", "value"),
        u8("Valid", "1: the sensor acknowledged"),
    ),
    Message(206, "LoopStatus", "state of the main loop and of the settings that are extensions").of(
        u32("Iterations", "iterations since power-up", counter=True),
        u8("ModeFlag", "mode for the next image", choices=MatchMode),
        u16("FrameRate", "the sensor's frame-rate register"),
        u16("DiscardDelay", "wait after enabling the sensor", "ms"),
        u8("Bank", "half of the frame buffer"),
        u8("CameraPage", "page of telecommands 13 and 14"),
        bool1("Running", "the 1 s loop runs"),
    ),
    Message(207, "MatchSummary", "result of the latest identification").of(
        u8("Detected", "stars detected"),
        u8("Matched", "stars identified"),
        f32("MeanConfidence", "mean confidence of the identified stars, 0 to 1"),
        u8("MaxVotes", "most verification votes of a star"),
    ),
    _SWITCHES_SHOWN,
    Message(209, "Quality", "quality of the latest image's attitude, or why there is none").of(
        u32("FrameCounter", "number of the image since power-up", counter=True),
        enum8("Reason", "why there is no attitude, or SOLVED", choices=Reason),
        *ATTITUDE_QUALITY,
        f32("Background", "mean brightness of the sky", "DN"),
        f32("BackgroundRange", "brightest minus darkest part of the sky", "DN"),
        f32("Noise", "standard deviation of a pixel", "DN"),
        f32("Saturated", "fraction of saturated pixels"),
        u16("Spikes", "single bright pixels: hot ones, particles"),
        u16("Elongated", "areas elongated to streaks"),
        bool1("Valid", "the latest image has an attitude, which this frame rates"),
    ),
    Message(210, "StellarGyro", "body rate between the two latest images, from their stars").of(
        u32("FrameCounter", "number of the later image since power-up", counter=True),
        enum8("Outcome", "why there is no rate, or MEASURED", choices=RateOutcome),
        *(
            f32(f"Rate{axis}", f"rate about the camera's {axis.lower()} axis", "rad/s")
            for axis in "XYZ"
        ),
        *(f32(f"Sigma{axis}", f"standard deviation of Rate{axis}", "rad/s") for axis in "XYZ"),
        u32("Interval", "time between the two exposures, by the processor's timer", "us"),
        u8("Compared", "stars of the earlier image that were looked for"),
        u8("Matched", "stars found again"),
        f32("Residual", "root mean square of their residuals in each axis", "rad"),
        f32("LogFalseAlarm", "decimal logarithm of the probability of such a match by chance"),
    ),
    Message(211, "Bodies", "planets and Moon in the latest image").of(
        u32("FrameCounter", "number of the image since power-up", counter=True),
        u8("Listed", "bodies whose direction holds"),
        u8("Named", "planets identified"),
        u8("Used", "planets that are known well enough for the attitude"),
        enum8("Disc", "the Moon's disc", choices=Disc),
        u16("DiscSamples", "saturated ones, of every fourth pixel in every fourth row"),
        f32("DiscX", "middle of its lit part and glare, column", "px"),
        f32("DiscY", "the same, row", "px"),
        f32("DiscApart", "angle between that and where the attitude puts the Moon", "rad"),
    ),
)

EXTENSION_TELECOMMANDS = tuple(replace(message, extension=True) for message in _TELECOMMANDS)
EXTENSION_TELEMETRY = tuple(replace(message, extension=True) for message in _TELEMETRY)
